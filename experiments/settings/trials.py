"""Which settings are changed, to what, and on which cases of `experiments.concealed_physics`."""

import dataclasses
import inspect
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from jaxsub.discrepancy import settings

from ..concealed_physics.plan import Case, cases

FACTORS = (0.5, 2.0)
# quick ones of several conditions and vehicles, the first two of them with nothing concealed; those of --quick
CASES = ("none_white-003", "none_coloured-000", "weak-007", "weak-002", "sigma-000", "short-008")
QUICK = ("none_white-003", "weak-007")
_SETTING = re.compile(r"^# (?P<section>[^a-z].+)$\n\n|(?P<meaning>(?:^# .+\n)+)^(?P<name>[A-Z_]+): Final", re.MULTILINE)

Value = int | float | tuple[float, ...]


@dataclasses.dataclass(frozen=True)
class Trial:
    """One case, judged with one setting at a multiple of its value; with all as they are where no name is given."""

    case: Case
    setting: str = ""
    factor: float = 1.0

    @property
    def name(self) -> str:
        """Its name among the lines."""
        return f"{self.setting or 'as it is'} x{self.factor:g} {self.case.name}"


def described() -> dict[str, dict[str, str]]:
    """The section and the meaning of every setting, as `settings.py` says them, in its order."""
    section, found = "", {}
    for match in _SETTING.finditer(inspect.getsource(settings)):
        section = match["section"] or section
        if match["name"]:
            meaning = " ".join(line.removeprefix("# ") for line in match["meaning"].splitlines())
            found[match["name"]] = {"section": section, "meaning": meaning}
    return found


def scaled(value: Value, factor: float) -> Value:
    """A setting's `value` times a `factor`: a whole number is rounded, a share or a level stays one."""
    if isinstance(value, int):
        return max(1, round(factor * value))
    within = lambda one: min(1.0, factor * one) if one < 1.0 else factor * one
    return tuple(map(within, value)) if isinstance(value, tuple) else within(value)


@contextmanager
def changed(name: str, factor: float) -> Iterator[None]:
    """The setting `name`, if any, at a multiple of its value, for all that reads it meanwhile."""
    if not name:
        yield
        return
    before = getattr(settings, name)
    setattr(settings, name, scaled(before, factor))
    try:
        yield
    finally:
        setattr(settings, name, before)


def trials(chosen: Sequence[str], names: Sequence[str]) -> list[Trial]:
    """The `chosen` cases with the settings as they are, then with each of `names` at each factor."""
    judged = [cases(condition, int(number) + 1)[-1] for condition, number in (one.rsplit("-", 1) for one in chosen)]
    changes = [("", 1.0), *((name, factor) for name in names for factor in FACTORS)]
    return [Trial(case, name, factor) for name, factor in changes for case in judged]
