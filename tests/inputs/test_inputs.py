"""Every input of the corpus gets its answer: read as written, or refused in one line that names place and remedy."""

import importlib
from pathlib import Path

import pytest
from corpus import Case

from jaxsub.errors import InputError

MODULES = sorted(path.stem for path in Path(__file__).parent.glob("cases_*.py"))
CASES = [case for name in MODULES for case in importlib.import_module(name).CASES]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_input_gets_its_answer(tmp_path, case: Case):
    assert bool(case.refused) != bool(case.check), "a case is refused or checked"
    if not case.refused:
        case.check(case.make(tmp_path))
        return
    with pytest.raises(InputError) as caught:
        case.make(tmp_path)
    line = str(caught.value)
    assert "\n" not in line and line.count(";") >= 1
    assert all(word in line for word in case.refused), line


def test_names_of_cases_are_unique():
    names = [case.name for case in CASES]
    assert len(set(names)) == len(names)
