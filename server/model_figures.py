"""The accuracy that was measured for a network, as the service returns it."""

import json
from pathlib import Path
from typing import Any

from lighting.model import figures_path
from lighting.records import ModelSpec


def accuracy(spec: ModelSpec, folder: Path) -> dict[str, Any]:
    """Figures by protocol and name, from the JSON file in a network's folder; empty if there is none."""
    path = figures_path(spec, folder)
    return dict(json.loads(path.read_text(encoding="utf-8"))["accuracy"]) if path.is_file() else {}
