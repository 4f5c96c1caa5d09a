"""The notebooks run, and show what they give."""

import base64
import io
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from tests.helpers.pages import ROOT

NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))
RUN = "import sys, nbformat; from pathlib import Path; from scripts.run_notebook import run_notebook\n"
RUN += "nbformat.write(run_notebook(Path(sys.argv[1])), sys.argv[2])"


def texts(notebook: Any) -> list[str]:
    """What the cells print."""
    outputs = [output for cell in notebook["cells"] for output in cell.get("outputs", [])]
    return ["".join(output["text"]) for output in outputs if output["output_type"] == "stream"]


def pictures(notebook: Any) -> list[tuple[int, int]]:
    """The sizes of the pictures that the cells show."""
    outputs = [output.get("data", {}) for cell in notebook["cells"] for output in cell.get("outputs", [])]
    shown = ["".join(data[kind]) for data in outputs for kind in data if kind.startswith("image/")]
    return [Image.open(io.BytesIO(base64.b64decode(picture))).size for picture in shown]


@pytest.mark.slow
@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.name)
def test_a_notebook_gives_what_it_shows(file: Path, tmp_path: Path) -> None:
    """Where this fails, run `python -m scripts.run_notebook NAME`."""
    again = tmp_path / "again.ipynb"
    done = subprocess.run(
        [sys.executable, "-c", RUN, file, again], cwd=ROOT, capture_output=True, text=True, timeout=200, check=False
    )
    assert done.returncode == 0, done.stderr
    stored, fresh = (json.loads(path.read_text(encoding="utf-8")) for path in (file, again))
    assert texts(fresh) == texts(stored)
    assert pictures(fresh) == pictures(stored)
    assert len(pictures(stored)) >= 3
    assert file.stat().st_size < 500_000
