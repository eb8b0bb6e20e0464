"""How a file of text is written: its encoding, what stands above the headers, and what separates the cells."""

import codecs
import csv
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from jaxsub.errors import InputError
from jaxsub.recording.layout import COMMENTS

_HEAD = 2**18  # bytes of a file in which its dialect is looked for
_PIECE = 2**20
_SAMPLE = 1000  # rows
_MARKS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}
_CONTROL = bytes(set(range(32)) - set(b"\t\n\v\f\r"))
_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars"}


class Dialect(NamedTuple):
    """How a text file is written.

    **Fields**

    - `encoding`, `separator`: as Python names them.
    - `top`: the row of the first line that is neither a comment nor blank.
    - `commented`: cells of the last comment above it.
    - `lines`: number of lines up to the last that is not blank, 0 where that is not known.
    - `rows`: the first rows from `top` on.
    - `said`: how the file is read, where that has to be stated.
    """

    encoding: str
    separator: str
    top: int
    commented: list[str] | None
    lines: int
    rows: list[list[str]]
    said: tuple[str, ...]


def cells_of(lines: Sequence[str], separator: str) -> list[list[str]]:
    """The cells of each row."""
    return list(csv.reader(lines, delimiter=separator, skipinitialspace=True))


def find_dialect(path: Path, source: str) -> Dialect:
    """The dialect of the file at `path`. Raises InputError where it is no text or its separator is in doubt."""
    encoding, count = _encoding(path, source)
    with path.open("rb") as file:
        raw = file.read(_HEAD)
        whole = not file.read(1)
    text = codecs.getincrementaldecoder(encoding)().decode(raw, final=whole)
    lines = re.split(r"(?<=\n)|(?<=\r)(?!\n)", text)
    if not whole:
        lines.pop()  # cut within
    said = [f"text in {encoding}"] if encoding in ("cp1252", "utf-16") else []
    separator, index, comment = None, 0, None
    if lines and (stated := re.fullmatch(r'"?sep=(.)"?', lines[0].strip("\r\n"), re.IGNORECASE)):
        separator, index = stated[1], 1
    while index < len(lines) and (not lines[index].strip() or lines[index].lstrip().startswith(COMMENTS)):
        comment = lines[index] if lines[index].strip() else comment
        index += 1
    if index == len(lines):
        raise InputError(source, "is empty", "write a header and a row for each sample")
    if comment:
        said.append("comments above the first row left out")
    bare = re.sub(rf"^\s*(?:{'|'.join(COMMENTS)})+\s?", "", comment.rstrip("\r\n")) if comment else None
    sample = lines[index : index + _SAMPLE]
    separator = separator or _separator(source, sample, bare)
    if separator != ",":
        said.append(f"{_SEPARATORS.get(separator, repr(separator))} between cells")
    commented = cells_of([bare], separator)[0] if bare else None
    return Dialect(encoding, separator, index + 1, commented, count, cells_of(sample, separator), tuple(said))


def _encoding(path: Path, source: str) -> tuple[str, int]:
    """The encoding, and the number of lines up to the last that is not blank."""
    with path.open("rb") as file:
        mark = file.read(4)
    if mark in (codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE):
        raise InputError(source, "is text in UTF-32", "save it as UTF-8")
    marked = next((name for start, name in _MARKS.items() if mark.startswith(start)), "utf-8")
    if marked == "utf-16":
        return marked, 0
    for encoding in (marked, "cp1252"):
        try:
            return encoding, _lines(path, encoding, source)
        except UnicodeDecodeError:
            continue
    raise InputError(source, "is no text in UTF-8, UTF-16 or cp1252", "save it as UTF-8")


def _lines(path: Path, encoding: str, source: str) -> int:
    decoder = codecs.getincrementaldecoder(encoding)()
    seen = filled = 0
    with path.open("rb") as file:
        while piece := file.read(_PIECE):
            decoder.decode(piece)
            if len(piece.translate(None, _CONTROL)) < len(piece):
                what = "holds control characters, which text does not"
                raise InputError(source, what, "check that it is whole, or save it as UTF-8 text")
            if kept := piece.rstrip():
                filled = seen + kept.count(b"\n") + 1
            seen += piece.count(b"\n")
    decoder.decode(b"", final=True)
    return filled


def _separator(source: str, lines: list[str], comment: str | None) -> str:
    """What separates the cells of the header; where several may, the one that gives every row as many cells."""
    header = lines[0]
    if comment and not re.search(r"[^\W\d]", header.replace("e", "").replace("E", "")):
        header = comment
    found = [mark for mark in _SEPARATORS if len(cells_of([header], mark)[0]) > 1]
    if len(found) > 1:
        filled = [line for line in lines if line.strip(" \r\n")]
        even = [mark for mark in found if len({len(row) for row in cells_of(filled, mark)}) == 1]
        found = even if len(even) == 1 else found
    if len(found) > 1:
        names = " or ".join(_SEPARATORS[mark] for mark in found)
        what = f"its cells may be separated by {names}"
        raise InputError(source, what, "begin the file with a line like sep=; or use one of them only")
    words = header.split()
    if not found and len(words) > 1 and all(len(line.split()) == len(words) for line in lines[1:6] if line.strip()):
        raise InputError(source, "its cells are separated by blanks", "separate them by commas")
    return found[0] if found else ","
