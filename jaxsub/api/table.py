"""A table as text and as HTML: what results print, in a terminal, a script and a notebook."""

import dataclasses
import html
import io
from collections.abc import Sequence


@dataclasses.dataclass(frozen=True)
class Table:
    """A table of text.

    **Fields**

    - `heads`: of the columns. `rows`: cells, as many as there are heads in each.
    """

    heads: Sequence[str]
    rows: Sequence[Sequence[str]]

    def text(self) -> str:
        """The table in lines of text, as wide as its cells: none is cut or wrapped."""
        # imported here, so that a result may be made without it
        from rich.console import Console
        from rich.markup import escape
        from rich.measure import Measurement
        from rich.table import Column
        from rich.table import Table as Drawn

        drawn = Drawn(*(Column(escape(head), no_wrap=True, overflow="ignore") for head in self.heads))
        for row in self.rows:
            drawn.add_row(*map(escape, row))
        file = io.StringIO()
        console = Console(file=file, width=10_000, highlight=False)
        width = Measurement.get(console, console.options, drawn).maximum
        Console(file=file, width=width, highlight=False).print(drawn, crop=False)
        return file.getvalue().rstrip("\n")

    def html(self) -> str:
        """The table for a notebook."""
        line = lambda cells, tag: "<tr>" + "".join(f"<{tag}>{html.escape(c)}</{tag}>" for c in cells) + "</tr>"
        body = "".join(line(row, "td") for row in self.rows)
        return f"<table><thead>{line(self.heads, 'th')}</thead><tbody>{body}</tbody></table>"


# what a result says: lines of text and tables, in order
Parts = Sequence[str | Table]


def as_text(parts: Parts) -> str:
    """The parts below each other."""
    return "\n".join(part.text() if isinstance(part, Table) else part for part in parts)


def as_html(parts: Parts) -> str:
    """The parts below each other, for a notebook."""
    return "".join(part.html() if isinstance(part, Table) else f"<p>{html.escape(part)}</p>" for part in parts)
