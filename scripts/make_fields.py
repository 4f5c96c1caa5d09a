"""docs/fields.md, from the docstrings of the records' fields: `python -m scripts.make_fields`."""

import re
from dataclasses import fields
from pathlib import Path
from typing import Any

import lighting
from lighting.documentation import field_docstrings
from lighting.envmap.relighting import Adjustments
from lighting.light_probe import LightProbe, MainLight
from lighting.photo.metadata import PhotoMetadata
from lighting.photo.reader import Photo, PhotoCrop
from lighting.records import SunDistribution
from lighting.scene.records import Scene

PAGE = Path(__file__).parents[1] / "docs" / "fields.md"
_RECORDS: tuple[Any, ...] = (
    *(lighting.Lighting, lighting.Estimate, SunDistribution, lighting.UserInput, Adjustments),
    *(Photo, PhotoCrop, PhotoMetadata, LightProbe, MainLight, Scene),
)
_ARRAY = re.compile(r"numpy\.ndarray\[.*?numpy\.dtype\[numpy\.(\w+)(?:\[typing\.Any\])?\]\]")  # any numpy's name of one
_HEAD = """# Fields

What the records of the Python package hold: type, unit, range and meaning, as `help` prints them. `python -m
scripts.make_fields` writes this page.
"""


def write_tables() -> str:
    """Return the page: a table of fields for each record of the public face."""
    return "\n".join([_HEAD, *map(_table, _RECORDS)])


def _table(record: Any) -> str:
    told = field_docstrings(record)
    types = {field.name: field.type for field in fields(record)}
    rows = [f"| `{name}` | `{_cell(types[name])}` | {_cell(text)} |" for name, text in told.items()]
    head = [f"## {record.__name__}", "", "| field | type | meaning |", "| --- | --- | --- |"]
    return "\n".join([*head, *rows, ""])


def _cell(content: Any) -> str:
    """A type or a text in a cell of a table."""
    text = content.__name__ if isinstance(content, type) and "[" not in str(content) else str(content).strip("\"'")
    return _ARRAY.sub(r"NDArray[\1]", text).replace("|", "\\|").replace("\n", " ")


if __name__ == "__main__":
    PAGE.write_text(write_tables(), encoding="utf-8")
