"""`python -m experiments.notebooks [NAME …]`: execute the notebooks and keep what they show.

A notebook runs in a folder of its own that is thrown away, as in a fresh copy of this project, so that it neither
leaves files behind nor leans on any. Its outputs are kept without what differs from one machine and day to the next.
"""

import argparse
import os
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient

from .data import folders

HERE = Path(__file__).resolve().parent.parent / "notebooks"
_LONGEST = 3600  # s, a cell


def execute(path: Path, environment: dict[str, str] | None = None) -> nbformat.NotebookNode:
    """The notebook with the outputs of a fresh run, numbered from one; `environment` joins that of its kernel.

    **Raises** `nbclient.exceptions.CellExecutionError` where a cell fails.
    """
    notebook = nbformat.read(path, as_version=4)
    data = [str(place.resolve()) for place in folders() if place.is_dir()]
    with tempfile.TemporaryDirectory() as folder:
        client = NotebookClient(
            notebook,
            timeout=_LONGEST,
            kernel_name="python3",
            record_timing=False,
            resources={"metadata": {"path": folder}},
        )
        own = {"PYTHONPATH": os.pathsep.join(filter(None, [str(HERE.parent), os.environ.get("PYTHONPATH")]))}
        known = {"JAXSUB_DATA": data[0]} if data else {}
        client.execute(env={**os.environ, **own, **known, **(environment or {})})
    notebook.metadata.pop("widgets", None)
    notebook.metadata["language_info"] = {"name": "python"}
    return notebook


def needs(notebook: nbformat.NotebookNode) -> str | None:
    """The data set without which a notebook shows nothing; None where it makes its own."""
    return notebook.metadata.get("jaxsub", {}).get("data")


def main() -> None:
    """Run those named, or all, and write each back with its outputs."""
    parser = argparse.ArgumentParser(prog="python -m experiments.notebooks", description=__doc__)
    parser.add_argument("names", nargs="*", help="such as 01_first_diagnosis; all by default")
    chosen = parser.parse_args()
    paths = [HERE / f"{name}.ipynb" for name in chosen.names] or sorted(HERE.glob("*.ipynb"))
    for path in paths:
        print(path.stem, flush=True)
        nbformat.write(execute(path), path)


if __name__ == "__main__":
    main()
