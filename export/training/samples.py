"""A picture of rendered places as training sees them, before augmentation."""

from pathlib import Path

import numpy as np
from PIL import Image

from export.crops import generator, load_sources, paper_camera, take
from export.data import DataError, read_index
from export.networks import specs
from export.towns import LABELS
from lighting.colour import tone_map
from lighting.files import replacing

ACROSS, DOWN = 8, 6  # one crop each of the first 48 places


def write_samples(folder: Path, target: Path) -> None:
    """One crop of each of the first ACROSS x DOWN places of a folder, as a JPEG; DataError if it holds fewer."""
    panoramas = read_index(folder, "train")[: ACROSS * DOWN]
    if len(panoramas) < ACROSS * DOWN:
        raise DataError(f"{folder} holds {len(panoramas)} places; the picture shows {ACROSS * DOWN}.")
    spec = specs("")["outdoor"]
    sources = load_sources(panoramas, folder / LABELS)
    crops = [take(source, paper_camera(generator(source.panorama.name, 0, "sample")), spec) for source in sources]
    tiles = np.stack([tone_map(crop.linear) for crop in crops])
    height, width = tiles.shape[1:3]
    rows = tiles.reshape(DOWN, ACROSS, height, width, 3).swapaxes(1, 2)
    with replacing(target) as temporary:
        Image.fromarray(rows.reshape(DOWN * height, ACROSS * width, 3)).save(temporary, "JPEG", quality=80)
