"""A user's own effect, one small class, is found installed or in a script, and a vehicle file may name it."""

import importlib.metadata

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, oscillator, stacked

from jaxsub.effects import VOCABULARY, from_script, vocabulary
from jaxsub.errors import InputError
from jaxsub.simulation import at_rest, simulate
from jaxsub.vehicle import read_vehicle, write_vehicle

SCRIPT = '''
"""A magnet under the rig."""
from typing import ClassVar
import equinox as eqx
from jaxtyping import Array
from jaxsub.effects import AbstractForce, AbstractSensor, amplitude, shape


class Magnet(AbstractForce):
    r"""$F = -m q e^{-q^2/w^2}$. Source: the workshop."""

    name: ClassVar[str] = "magnet"
    family: ClassVar[str] = "own"
    equation: str = eqx.field(static=True)
    m: Array = amplitude("1")
    w: Array = shape("1", sign=1, default=0.1)

    @classmethod
    def candidates(cls, facts):
        return [cls(e) for e in facts.equations]

    @property
    def where(self):
        return (self.equation,)

    @property
    def expression(self):
        return "-m q exp(-q²/w²)"

    def force(self, motion):
        import jax.numpy as jnp
        q = motion.positions[self.equation]
        return {self.equation: -self.m * q * jnp.exp(-(q / self.w) ** 2)}
'''


@pytest.fixture
def script(tmp_path):
    (tmp_path / "magnet.py").write_text(SCRIPT)
    return tmp_path / "magnet.py"


def test_a_script_gives_its_effect_and_a_vehicle_file_keeps_it(script, tmp_path):
    (kind,) = from_script(script)
    assert kind.name == "magnet"
    vehicle = oscillator().with_effect(kind("x", jnp.asarray(3.0), jnp.asarray(0.2)))
    write_vehicle(vehicle, tmp_path / "rig.toml")
    with pytest.raises(InputError, match="magnet"):
        read_vehicle(tmp_path / "rig.toml")
    again = read_vehicle(tmp_path / "rig.toml", effects=from_script(script))
    assert float(again.values()["magnet[x].w"]) == 0.2
    runs = stacked(vehicle, [driven(vehicle, 0.1 * np.arange(12), seed=1)])
    one, two = (simulate(v, runs, at_rest(v, 1)) for v in (vehicle, again))
    np.testing.assert_array_equal(one, two)
    assert np.abs(one - simulate(oscillator(), runs, at_rest(oscillator(), 1))).max() > 1e-3


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("import nothing_of_that_name", "ModuleNotFoundError"),
        ("def force(", "SyntaxError"),
        ("x = 1", "defines no effect"),
        ("from jaxsub.effects import Current", "defines no effect"),
        (SCRIPT.replace('"magnet"', '"current"'), "the name current is taken"),
        (SCRIPT.replace("    def force(", "    def farce("), "defines no effect"),
    ],
)
def test_a_bad_script_is_refused_with_its_path(text, complaint, tmp_path):
    (tmp_path / "bad.py").write_text(text)
    with pytest.raises(InputError, match=complaint) as caught:
        from_script(tmp_path / "bad.py")
    assert "bad.py" in str(caught.value)


def test_a_script_that_is_not_there_or_no_python_is_refused(tmp_path):
    (tmp_path / "effects.txt").write_text(SCRIPT)
    for name in ("nowhere.py", "effects.txt"):
        with pytest.raises(InputError, match=name):
            from_script(tmp_path / name)


def install(folder, target):
    """A package whose metadata declare one effect, as an installer leaves it."""
    (folder / "magnet_package.py").write_text(SCRIPT)
    info = folder / "magnet_package-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: magnet-package\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[jaxsub.effects]\nmagnet = {target}\n")


def test_an_installed_effect_belongs_to_the_vocabulary_and_is_read_from_a_file(tmp_path, monkeypatch):
    assert vocabulary()[: len(VOCABULARY)] == VOCABULARY
    install(tmp_path, "magnet_package:Magnet")
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    kind = vocabulary()[-1]
    assert kind.name == "magnet"
    vehicle = oscillator().with_effect(kind("x", jnp.asarray(3.0), jnp.asarray(0.2)))
    write_vehicle(vehicle, tmp_path / "rig.toml")
    assert read_vehicle(tmp_path / "rig.toml").effects[0].label == "magnet[x]"


@pytest.mark.parametrize("target", ["magnet_package:Nobody", "magnet_package:ClassVar", "jaxsub.effects:Current"])
def test_an_installed_effect_that_is_none_is_refused(target, tmp_path, monkeypatch):
    install(tmp_path, target)
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    with pytest.raises(InputError, match="entry point magnet"):
        vocabulary()
