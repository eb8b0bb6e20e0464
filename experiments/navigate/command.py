"""One call of the command in a process of its own, and what it wrote."""

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

from jaxsub.recording import Recording, load, save


class Written(NamedTuple):
    """What `jaxsub navigate` wrote of a log: recordings, the content of `navigation.json`, and the seconds it took."""

    filtered: Recording
    smoothed: Recording
    content: dict
    seconds: float


def navigated(log: Recording, sensors: str, folder: Path) -> Written:
    """The `log` through the command, with the sensor file's text; files stay in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    path, file, out = folder / f"{log.name}.parquet", folder / "sensors.toml", folder / log.name
    save(log, path)
    file.write_text(sensors, encoding="utf-8")
    words = ["navigate", str(path), "--sensors", str(file), "--out", str(out), "--overwrite", "--quiet", "--json"]
    begin = time.perf_counter()
    subprocess.run([sys.executable, "-m", "jaxsub", *words], check=True, stdout=subprocess.DEVNULL)
    seconds = time.perf_counter() - begin
    content = json.loads((out / "navigation.json").read_text(encoding="utf-8"))
    return Written(load(out / "filtered.parquet"), load(out / "navigation.parquet"), content, seconds)


def columns(names: str, values) -> dict:
    """Columns `gx`, `gy`, `gz` of (K, 3) values, and the like."""
    return {f"{names}{axis}": column for axis, column in zip("xyz", values.T, strict=True)}
