"""The rendered example of each verdict, drawn once for all tests."""

import functools

import pytest
from report_examples import VEHICLE, diagnosis

from jaxsub.report import write_report


@pytest.fixture(scope="session")
def report(tmp_path_factory):
    """A function from a verdict to the folder that its report was written to."""

    @functools.cache
    def written(verdict):
        folder = tmp_path_factory.mktemp(verdict)
        write_report(diagnosis(verdict), VEHICLE, folder)
        return folder

    return written


@pytest.fixture(scope="session")
def page(report):
    """A function from a verdict to the text of its page."""
    return lambda verdict: (report(verdict) / "report.html").read_text(encoding="utf-8")
