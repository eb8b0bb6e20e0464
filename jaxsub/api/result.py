"""What every result of the front door can do: print itself, show itself in a notebook, draw and save."""

import abc
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ..storage import Manifest, place, require_ours, scratch
from .table import Parts, as_html, as_text

if TYPE_CHECKING:
    from ..report import Picture


class AbstractResult(abc.ABC):
    """A result: a short table where it is printed, all that it says by `summary`, a picture by `plot`."""

    @abc.abstractmethod
    def brief(self) -> Parts:
        """What is shown where the result is printed: a line, and a table or two."""

    @abc.abstractmethod
    def parts(self) -> Parts:
        """All that the result says, as the command prints it."""

    @abc.abstractmethod
    def plot(self) -> "Picture":
        """The result's first picture; a notebook shows it as the last value of a cell."""

    @abc.abstractmethod
    def write(self, folder: Path) -> Any:
        """Write what the command writes into a `folder` that is there."""

    def summary(self) -> str:
        """All that the result says, as text."""
        return as_text(self.parts())

    def save(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write what the command writes to the folder `path`, which appears whole or not at all.

        With `overwrite` it takes the place of a folder in which all is as jaxsub wrote it.

        **Raises** `InputError` where something is at `path` that may not be replaced.
        """
        out = Path(path)
        require_replaceable(out, overwrite)
        with scratch(out) as folder:
            new = folder / out.name
            new.mkdir()
            self.write(new)
            manifest = Manifest.of_folder(new)
            manifest.begin(f"{type(self).__name__}.save")
            manifest.add_all()
            place(new, out, folder)

    def __repr__(self) -> str:
        return as_text(self.brief())

    def _repr_html_(self) -> str:
        return as_html(self.brief())


def require_replaceable(out: Path, overwrite: bool) -> None:
    """Raise `InputError` where something is at `out`, unless it is to be overwritten and is as jaxsub wrote it."""
    if not out.exists() and not out.is_symlink():
        return
    if not overwrite:
        raise InputError(str(out), "already exists", "choose another path, or give overwrite=True")
    remedy = "choose another path, or remove it yourself"
    if out.is_symlink() or not out.is_dir():
        raise InputError(str(out), "was not written by jaxsub as a folder, and overwrite replaces nothing else", remedy)
    require_ours(out, "overwrite", remedy)
