"""What a reader or a check reports about its input: where it is, what is wrong and what to do."""

import dataclasses
from collections.abc import Iterable
from typing import Any, Literal

from jaxsub.errors import InputError

Severity = Literal["error", "warning", "note"]
_LISTED = 3


@dataclasses.dataclass(frozen=True)
class Finding:
    """One thing that is wrong or odd with a recording or a vehicle.

    **Fields**

    - `check`: identifier of the check, such as `input-gap` or `sentinel`.
    - `severity`: an `error` stops a command; a `warning` does not; a `note` says how something was read.
    - `where`: the file, or the vehicle file's key.
    - `what`: what is wrong, with value, unit and threshold; `remedy`: what to do, empty for a note.
    - `channel`: the column or channel, empty where it concerns the whole file.
    - `rows`: intervals (first, last) of the file's rows; `times`: intervals (start, end), s.
    - `count`: how many samples are affected, 0 where that has no meaning.
    """

    check: str
    severity: Severity
    where: str
    what: str
    remedy: str = ""
    channel: str = ""
    rows: tuple[tuple[int, int], ...] = ()
    times: tuple[tuple[float, float], ...] = ()
    count: int = 0

    @property
    def place(self) -> str:
        """File, rows and channel as text."""
        shown = [f"{first}" if first == last else f"{first} to {last}" for first, last in self.rows[:_LISTED]]
        more = [f"{len(self.rows) - _LISTED} more intervals"] if len(self.rows) > _LISTED else []
        rows = f", rows {', '.join([*shown, *more])}" if shown else ""
        return f"{self.where}{rows}{f', column {self.channel!r}' if self.channel else ''}"

    def line(self) -> str:
        """The finding as one line of text."""
        # quoted library messages may span lines
        return " ".join(f"{self.place}: {self.what}{f'; {self.remedy}' if self.remedy else ''}".split())

    def error(self) -> InputError:
        """The finding as the error that stops a command."""
        return InputError(self.place, self.what, self.remedy or "mend the file")

    def to_json(self) -> dict[str, Any]:
        """The finding as JSON has it."""
        return dataclasses.asdict(self)


def require_none(findings: Iterable[Finding]) -> None:
    """Raise `InputError` for the first finding that is an error."""
    for finding in findings:
        if finding.severity == "error":
            raise finding.error()
