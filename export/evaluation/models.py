"""The networks that are compared."""

from collections.abc import Sequence
from pathlib import Path

from export.data import DataError
from lighting.model import Model


def load_models(paths: Sequence[Path]) -> dict[str, Model]:
    """ONNX networks by name, in the given order."""
    return by_name([Model.load(path) for path in paths])


def by_name(models: Sequence[Model]) -> dict[str, Model]:
    """Networks by name, and by version if two share a name; DataError if two share both."""
    names = [model.spec.name for model in models]
    labels = [
        name if names.count(name) == 1 else f"{name} {model.spec.version}"
        for name, model in zip(names, models, strict=True)
    ]
    twice = next((label for label in labels if labels.count(label) > 1), None)
    if twice:
        raise DataError(f"Two networks are {twice}; `python -m export onnx --version` gives one another version.")
    return dict(zip(labels, models, strict=True))
