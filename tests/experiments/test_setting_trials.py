"""Settings halved and doubled: what is changed, for whom, and what is counted."""

import numpy as np
import pytest

from experiments.settings.assemble import assemble
from experiments.settings.tables import tables
from experiments.settings.trials import CASES, changed, described, scaled, trials
from jaxsub.discrepancy import settings
from jaxsub.discrepancy.accept.cross_validation import Comparison, Gain


@pytest.mark.parametrize(
    ("value", "half", "double"),
    [
        (4, 2, 8),
        (1, 1, 2),
        (0.01, 0.005, 0.02),
        (0.9, 0.45, 1.0),
        (3.0, 1.5, 6.0),
        ((0.1, 0.6), (0.05, 0.3), (0.2, 1.0)),
    ],
)
def test_a_share_stays_a_share_and_a_count_a_count(value, half, double):
    """Claim: whole numbers stay whole and above zero, shares end at one, and lists are scaled as a whole."""
    assert np.allclose(scaled(value, 0.5), half) and np.allclose(scaled(value, 2.0), double)
    assert type(scaled(value, 2.0)) is type(value)


def test_another_value_holds_for_what_reads_it_and_no_longer_than_asked():
    """Claim: a gain of p = 0.015 is accepted at twice the level alone, and the level is as before after an error."""
    gain = Comparison(Gain(9.0, 0.015, 0.985), Gain(9.0, 0.5, 0.5), 0.9, True)
    assert not gain.accepted
    with changed("SIGNIFICANCE", 2.0):
        assert gain.accepted
    with pytest.raises(ZeroDivisionError), changed("SIGNIFICANCE", 2.0):
        raise ZeroDivisionError
    assert not gain.accepted


def test_every_setting_is_tried_on_every_case_and_none_twice():
    """Claim: all names of `settings.py` are described, with trials at two factors and one as it is, all named apart."""
    names = [name for name in vars(settings) if name.isupper()]
    assert [*described()] == names
    assert all(about["section"] and about["meaning"] for about in described().values())
    made = trials(CASES, names)
    assert len({trial.name for trial in made}) == len(made) == len(CASES) * (1 + 2 * len(names))


def line(judged, names, verdict, setting="", factor=1.0, effects=()):
    physics = [{"effect": effect, "rivals": []} for effect in effects]
    answer = {"verdict": verdict, "physics": physics, "cpu_seconds": 2.0}
    return {"judged": judged, "names": names, "setting": setting, "factor": factor, "engine": {}, "answer": answer}


def test_recovery_and_false_alarms_are_counted_by_setting():
    """Claim: of a case found by all but the half, and a clean one named by the double, each row says so."""
    lines = []
    for setting, factor in (("", 1.0), ("LEVEL", 0.5), ("LEVEL", 2.0)):
        missed = factor == 0.5
        lines.append(line("a", ["x"], "none" if missed else "named", setting, factor, () if missed else ("x",)))
        lines.append(line("b", [], "named" if factor == 2.0 else "none", setting, factor, ("y",) * (factor == 2.0)))
    results = assemble(lines)
    half, double = (results["settings"]["LEVEL"]["found"][factor] for factor in ("x0.5", "x2"))
    assert (half["recovery"]["rate"], double["recovery"]["rate"]) == (0.0, 1.0)
    assert (half["false_alarms"]["rate"], double["false_alarms"]["rate"]) == (0.0, 1.0)
    assert ([*half["other"]], [*double["other"]]) == (["a"], ["b"])
    found = tables(results)
    assert "| `LEVEL` | 0.05 | 0 of 1 | 1 of 1 | 0 of 1 | 1 of 1 | 1 | 1 |" in found["Levels and shares"]
    assert "| `MAJORITY` | – |" in found["Levels and shares"]
