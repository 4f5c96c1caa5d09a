"""The model card: what the network is for, what it was trained on, how accurate it is, where it fails."""

import os
import shutil
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from export.data.labels import check_rendered, read_labels, sun_agreement
from export.data.panoramas import Panorama, is_permissive, read_index
from export.evaluation.evaluate import Evaluation, Options
from export.evaluation.failures import RELIABILITY_FILE
from export.evaluation.report import write_figures
from lighting.files.atomic import atomic_write
from lighting.model import MODEL_CARD, Model, network_sha256, weights_path

ROOT = Path(__file__).parents[2]
CAPTION = "True suns inside the region that holds a given probability, by that probability"
TEMPLATE = Path(__file__).with_name("card_template.md")


def write_card(evaluation: Evaluation, options: Options) -> Path:
    """Write the card and the figures of the first network beside it, its reliability diagram into docs/images/.

    Returns the card's path.

    Args:
        evaluation: its report and figures.
        options: of that evaluation; its first network is ours.
    """
    model = options.models[0]
    target, docs = model.parent / MODEL_CARD, ROOT / "docs" / "images"
    train, val = read_index(options.data, "train"), read_index(options.data, "val")
    given = sun_agreement([*train, *val], read_labels(options.labels))
    loaded = Model.load(model)
    values = {
        **_of_model(loaded, model),
        **_of_data(train, val),
        "agreement": f"- Given suns: {given}\n- Skies that the project renders: {check_rendered()}",
        "report": evaluation.report.strip(),
        "reliability": f"![{CAPTION}]({_publish(options.out / RELIABILITY_FILE, docs, target)})",
        "date": datetime.now(UTC).date(),
    }
    with atomic_write(target) as path:
        path.write_text(TEMPLATE.read_text(encoding="utf-8").format(**values), encoding="utf-8")
    write_figures(loaded.spec, evaluation.figures, model.parent)
    return target


def _publish(picture: Path, docs: Path, card: Path) -> str:
    """Copy a picture into `docs`; returns its link from the card."""
    with atomic_write(docs / picture.name) as path:
        shutil.copyfile(picture, path)
    return Path(os.path.relpath(docs / picture.name, card.parent)).as_posix()


def _of_model(loaded: Model, path: Path) -> dict[str, object]:
    spec = loaded.spec
    metadata = loaded.session.get_modelmeta().custom_metadata_map
    return {
        "name": spec.name,
        "version": spec.version,
        "grid": spec.sun_grid.rpartition(":")[2],
        "width": spec.width,
        "height": spec.height,
        "training_data": spec.training_data,
        "file": path.name,
        "size": sum(file.stat().st_size for file in (path, weights_path(path)) if file.is_file()) / 1e6,
        "sha256": network_sha256(path),
        **{
            key: metadata.get(key, "unknown")
            for key in ("commit", "networks", "parity", "temperature", "elevation_scale")
        },
    }


def _of_data(train: Sequence[Panorama], val: Sequence[Panorama]) -> dict[str, object]:
    return {
        "train": len(train),
        "train_places": len({p.place for p in train}),
        "permissive": sum(is_permissive(p.licence) for p in train),
        "val": len(val),
        "val_places": len({p.place for p in val}),
    }
