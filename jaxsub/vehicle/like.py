"""Published vehicles as files to start from."""

from pathlib import Path

import tomlkit

from ..errors import require_known
from ..recording import Recording
from .initial.columns import Columns
from .read import vehicle_from
from .toml import read_toml

_FOLDER = Path(__file__).parent / "published"
PUBLISHED = tuple(sorted(path.stem.replace("_", "-") for path in _FOLDER.glob("*.toml")))


def published_file(name: str, log: Recording | None = None) -> tuple[str, list[str]]:
    """The text of the published vehicle `name`, one of `PUBLISHED`, and the columns of the `log` that it does not use.

    Inputs are the columns of the log that have their name or that of their column; outputs are its channels.

    **Raises** `InputError` for a vehicle that there is not, and for a log without a channel that it produces.
    """
    require_known("vehicle", [name], PUBLISHED, "the catalogue")
    path = _FOLDER / f"{name.replace('-', '_')}.toml"
    text = path.read_text(encoding="utf-8")
    if log is None:
        return text, []
    layout = vehicle_from(read_toml(path), name).layout
    file, columns, missing = tomlkit.parse(text), Columns(log), []
    for one, column in layout.inputs:
        unit = layout.input_unit(one)
        command = columns.named((column, one), [unit] if unit else [])
        if command is None:
            missing.append(one)
            continue
        entry = file["inputs"][one]
        if isinstance(entry, dict):
            entry["column"] = command.column
        else:
            file["inputs"][one] = command.column
    outputs = tomlkit.table()
    for channel, sigma in columns.outputs(layout.channels):
        outputs.add(tomlkit.key([channel, "sigma"]), tomlkit.value(sigma))
    # behind all else: a published file may have them in one line above its tables
    del file["outputs"]
    file["outputs"] = outputs
    said = [f"# Not used of the log: {columns.said_of_left}.\n"] if columns.left else []
    said += [f"# Not in the log: {', '.join(missing)}. Name their columns under [inputs].\n"] if missing else []
    return "".join([*said, tomlkit.dumps(file)]), columns.left
