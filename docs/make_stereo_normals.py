"""Draw docs/stereo-normals.png: a made vessel, its normals as found on two simulated days, and how far they are off.

Run from the repository's root: python docs/make_stereo_normals.py
"""

from pathlib import Path

import click
import numpy as np

from export.stereo.objects import Subject
from export.stereo.relief import relief
from export.stereo.trials import SEASONS, Trial, angle, photograph, session
from lighting.colour import srgb_encode
from lighting.files import encode_png
from lighting.stereo import Network
from lighting.stereo.days import in_grey

SIDE, SEED, WORST = 192, 37, 45.0  # pixels; of the shape; deg, drawn white


def main() -> None:
    """Write the picture and print the errors: photos at 9, 12 and 16 h, normals by search and with the network."""
    subject = Subject("vessel", "made", relief(SIDE, np.random.default_rng(SEED)))
    surface, network, rows = subject.surface, Network.load(), []
    for name in ("47° N, March", "47° N, June"):
        trial = Trial(SEASONS[name], shadows=True)
        photos = photograph(subject, trial, in_grey(trial.day.skies()))[[0, 3, 7], ..., 0]
        (found,) = session([subject], trial, network)
        search, both = found.errors()
        errors = (f"{np.median(part):.1f} / {part.mean():.1f}" for part in (search, both))
        click.echo(" ".join((name, *errors)))
        tiles = [np.repeat(srgb_encode(photo / photos.max())[..., None], 3, axis=-1) for photo in photos]
        maps = (surface.normals, found.search, found.network)
        tiles += [(normals + 1) / 2 * surface.mask[..., None] for normals in maps]
        off = np.clip(angle(found.network, surface.normals) / WORST, 0, 1) * surface.mask
        rows.append(np.concatenate([*tiles, np.repeat(off[..., None], 3, axis=-1)], axis=1))
    pixels = np.round(255 * np.concatenate(rows)).astype(np.uint8)
    Path("docs/stereo-normals.png").write_bytes(encode_png(pixels))


if __name__ == "__main__":
    main()
