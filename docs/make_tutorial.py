"""Run the tutorial from top to bottom and keep what it shows: `uv run --dev python docs/make_tutorial.py`.

Pictures are kept once, as PNG, which every viewer of notebooks shows.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import nbformat
from nbclient import NotebookClient

TUTORIAL = Path(__file__).parent / "tutorials" / "your-vehicle-your-maneuver.ipynb"


def executed(path: Path, folder: Path) -> nbformat.NotebookNode:
    """Run a notebook in a folder. Raises CellExecutionError where a cell fails."""
    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(folder)}}).execute()
    return notebook


def main() -> None:
    """Run the tutorial and write it."""
    with TemporaryDirectory() as folder:
        notebook = executed(TUTORIAL, Path(folder))
    for cell in notebook.cells:
        cell.metadata.clear()
        for output in cell.get("outputs", ()):
            if "image/png" in output.get("data", {}):
                output.data.pop("text/html", None)
    nbformat.write(notebook, TUTORIAL)


if __name__ == "__main__":
    main()
