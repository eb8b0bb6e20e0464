"""What commands print: results on standard output; progress, warnings and errors on standard error."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from ..api.table import Parts, Table
from ..findings import Finding
from ..plain import to_json
from .options import options

results = Console(highlight=False, markup=False, soft_wrap=True)
console = Console(stderr=True, highlight=False, markup=False, soft_wrap=True)


def emit(content: Any, show: Callable[[], None]) -> None:
    """The result on standard output: `content` with `--json`, else what `show` prints."""
    if options().json:
        results.file.write(to_json(content) + "\n")
    else:
        show()


def say(line: str) -> None:
    """A line of the result."""
    results.print(line)


def note(line: str) -> None:
    """A line beside the result, on standard error; none with `--quiet`."""
    if not options().quiet:
        console.print(line)


def warn(findings: Iterable[Finding]) -> None:
    """Print findings on standard error, a line each, and count the warnings; notes not with `--quiet`."""
    for finding in findings:
        if finding.severity == "note":
            note(f"note: {finding.line()}")
        else:
            options().warnings += 1
            console.print(f"warning: {finding.line()}")


def count(findings: Iterable[Finding]) -> None:
    """Count warnings that the result itself shows."""
    options().warnings += sum(finding.severity == "warning" for finding in findings)


def table(headers: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """A table on standard output. Cells are never cut or wrapped, however narrow the terminal is."""
    results.file.write(f"{Table(headers, list(rows)).text()}\n")


def show(parts: Parts) -> None:
    """The lines and tables of a result."""
    for part in parts:
        if isinstance(part, Table):
            table(part.heads, part.rows)
        else:
            say(part)


@contextmanager
def progress(title: str) -> Iterator[Callable[[str], None]]:
    """A spinner that says what is being done; on a pipe, a line for each thing."""
    if not console.is_terminal or options().quiet:
        yield lambda message: note(f"{title}: {message}")
        return
    columns = (
        SpinnerColumn(),
        TextColumn("{task.fields[title]}"),
        TextColumn("[bold]{task.description}"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("starting", total=None, title=escape(title))
        yield lambda message: bar.update(task, description=escape(message))


@contextmanager
def counted(title: str) -> Iterator[Callable[[int, int], None]]:
    """A bar that is called with how many are done of how many; on a pipe, a line for each further tenth."""
    if not console.is_terminal or options().quiet:
        shown = [-1]

        def tell(done: int, total: int) -> None:
            if 10 * done // total > shown[0]:
                shown[0] = 10 * done // total
                note(f"{title}: {done} of {total}")

        yield tell
        return
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn()
    )  # fmt: skip
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(escape(title), total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)
