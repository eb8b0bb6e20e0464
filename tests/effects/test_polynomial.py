"""Terms of polynomials that a user's own model lacks."""

import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array

import jaxsub as js
from jaxsub.effects import ActuatorGain, Facts, PolynomialTerm, candidates, with_numbers
from jaxsub.errors import InputError
from jaxsub.vehicle import own_model


class Pair(js.Model):
    """Two states, each of which fades, and one input."""

    states, inputs, outputs = ("a", "b"), ("push",), {"a": 0.01, "b": 0.01}
    fade: Array

    def rates(self, state, inputs, time):
        """Linear."""
        return {"a": inputs["push"] - self.fade * state["a"], "b": self.fade * (state["a"] - state["b"])}


class Whole(Pair):
    """The same, with a term more in the rate of b."""

    c: Array

    def rates(self, state, inputs, time):
        """With the product."""
        linear = super().rates(state, inputs, time)
        return linear | {"b": linear["b"] + self.c * state["a"] * inputs["push"]}


def recorded(vehicle, noise=True):
    t = 0.1 * np.arange(300)
    runs = [js.Recording(f"run {i}", t, {"push": js.prbs(300, 12, 1.0, seed=i)}, "a pair") for i in (1, 2, 3)]
    return js.synthetic(vehicle, runs, seed=6, noise=noise)


def test_vehicle_with_the_term_moves_as_equations_that_have_it():
    """Claim: to 1e-9, the product of a state and an input, and the constant, each written into the class instead."""
    term = with_numbers(PolynomialTerm("b", "a*push"), {"c": 0.7})
    ours = recorded(own_model(Pair(fade=0.8)).with_effect(term), noise=False)
    theirs = recorded(own_model(Whole(fade=0.8, c=0.7)), noise=False)
    plain = recorded(own_model(Pair(fade=0.8)), noise=False)
    for one, two, three in zip(ours, theirs, plain, strict=True):
        np.testing.assert_allclose(one.column("b"), two.column("b"), atol=1e-9)
        assert np.abs(one.column("b") - three.column("b")).max() > 0.1


def test_models_of_a_user_have_every_term_and_other_vehicles_none():
    """Claim: of two states and an input, the constant, the state itself and six products in each rate."""
    of = lambda kind: Facts(kind, ("a", "b"), ("push",), ("a",), (), 0.0, 0.0, {"a": 1.0, "b": 1.0}, 0.1)
    found = candidates(of("model"), (PolynomialTerm,))
    assert len({effect.label for effect in found}) == 2 * (1 + 1 + 6)
    assert candidates(of("mechanism"), (PolynomialTerm,)) == []


def test_file_keeps_a_term_and_refuses_one_of_a_signal_that_is_not_there(tmp_path):
    path = tmp_path / "pair.py"
    path.write_text(
        "import jaxsub as js\nfrom jaxtyping import Array\nclass Pair(js.Model):\n"
        "    states, inputs = ('a', 'b'), ('push',)\n"
        "    fade: Array\n    def rates(self, state, inputs, time):\n"
        "        return {'a': inputs['push'] - self.fade * state['a'], 'b': -self.fade * state['b']}\n"
    )
    text = (
        'schema = 1\nname = "pair"\nkind = "model"\nclass = "pair.py:Pair"\n'
        'coefficients.fade = 0.8\ninputs.push = "u"\noutputs.a.sigma = 0.1\n'
        '[[effects]]\neffect = "polynomial-term"\nequation = "b"\nproduct = "a*push"\n'
        "parameters = { c = 0.7 }\n"
    )
    file = tmp_path / "pair.toml"
    file.write_text(text)
    (effect,) = js.read_vehicle(file).effects
    assert effect.label == "polynomial-term[b,a*push]" and float(effect.c) == 0.7
    file.write_text(text.replace("a*push", "a*pusch"))
    with pytest.raises(InputError, match=r"pusch.*no state and no input.*push"):
        js.read_vehicle(file)


def test_missing_product_is_named():
    """Claim: of three runs with a product left out, that product is named, its number within three standard errors."""
    logs = recorded(own_model(Whole(fade=0.8, c=0.3)))
    found = js.diagnose(own_model(Pair(fade=0.7)), logs[:2], logs[2:])
    assert found.verdict == "named"
    (physics,) = found.physics
    assert physics.label == "polynomial-term[b,a*push]"
    estimate = physics.parameters["c"]
    assert abs(estimate.value - 0.3) < 3.0 * estimate.standard_error


def test_gain_of_an_input_is_a_candidate_where_no_free_number_has_it():
    """Claim: offered for every input of a user's model; with a free number that scales the input it is absorbed."""
    known = Facts("model", ("a",), ("push",), ("a",), (), 0.0, 0.0, {"a": 1.0}, 0.1, fixed_gains=("push",))
    assert [effect.label for effect in candidates(known, (ActuatorGain,))] == ["actuator-gain[push]"]
    assert own_model(Pair(fade=jnp.asarray(0.8))).fixed_gains == ("push",)
