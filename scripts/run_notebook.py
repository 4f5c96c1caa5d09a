"""Run a notebook in examples/ and keep its texts and pictures: `python -m scripts.run_notebook first_light`."""

import os
import sys
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

EXAMPLES = Path(__file__).parents[1] / "examples"
_SECONDS = 120  # for one cell
_METADATA = {
    "kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"},
    "language_info": {"name": "python"},
}


def run_notebook(file: Path) -> Any:
    """Return a notebook whose cells have run, pictures as JPEG where a cell gives them so, which are small.

    Args:
        file: of the notebook, in whose folder it runs.

    Raises:
        CellExecutionError: a cell fails.
    """
    root = str(EXAMPLES.parent)
    paths = [root, *filter(None, [os.environ.get("PYTHONPATH")])]
    os.environ["PYTHONPATH"] = os.pathsep.join(paths)  # the kernel is a process of its own
    notebook = nbformat.read(file, as_version=4)  # type: ignore[no-untyped-call]
    where = {"metadata": {"path": str(file.parent)}}
    NotebookClient(notebook, timeout=_SECONDS, kernel_name="python3", resources=where, record_timing=False).execute()
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            if "image/jpeg" in output.get("data", {}):
                output.data.pop("image/png", None)
    notebook.metadata = nbformat.from_dict(_METADATA)  # type: ignore[no-untyped-call]
    return notebook


def main(name: str) -> None:
    """Run a notebook, and write it with what its cells gave.

    Args:
        name: of the notebook, without its suffix.
    """
    file = EXAMPLES / f"{name}.ipynb"
    nbformat.write(run_notebook(file), file)  # type: ignore[no-untyped-call]


if __name__ == "__main__":
    main(*sys.argv[1:])
