"""Pictures that the estimate is not for: those of `unsuitable.csv`, and synthetic ones."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from export.crops.augmentation import JPEG_SHARE, recompress
from export.crops.crops import Source
from export.data.panoramas import read_table
from lighting.color import tone_map
from lighting.model import fit_size
from lighting.photo.reader import read_photo
from lighting.records import ModelSpec

Picture = NDArray[np.uint8]

TABLE = "unsuitable.csv"
SYNTHETIC_KINDS = ("on its side", "upside down", "whole panorama", "night", "black", "blown out", "drawing", "plain")


@dataclass(frozen=True, eq=False)
class _Unsuitable:
    """A picture that the estimate is not for."""

    kind: str
    group: str  # owner: pictures of one group are alike
    pixels: Picture


def read_unsuitable(folder: Path) -> list[_Unsuitable]:
    """The folder's unsuitable pictures; none if it lists none.

    Args:
        folder: with `unsuitable.csv` and the pictures.
    """
    if not (folder / TABLE).exists():
        return []
    rows = read_table(folder / TABLE, ("file", "kind", "source"))
    return [_Unsuitable(r["kind"], r["source"].partition(":")[0], read_photo(folder / r["file"]).pixels) for r in rows]


def _vary(pixels: Picture, rng: np.random.Generator, spec: ModelSpec) -> Picture:
    """A random part of a picture at the canvas's size, mirrored and brightened at random."""
    height, width = pixels.shape[:2]
    share = rng.uniform(0.7, 1.0)
    left, top = rng.uniform(0, 1 - share, 2) * (width, height)
    size = fit_size(width, height, spec)
    box = (left, top, left + share * width, top + share * height)
    part = np.asarray(Image.fromarray(pixels).resize(size, Image.Resampling.HAMMING, box=box), dtype=np.float64)
    part = 255 * (part / 255) ** np.exp(rng.normal(0, 0.2)) * np.exp(rng.normal(0, 0.05, 3))
    part = part[:, ::-1] if rng.random() < 0.5 else part
    picture = np.clip(part, 0, 255).astype(np.uint8)
    return recompress(picture, rng) if rng.random() < JPEG_SHARE else picture


def _synthesize(kind: str, crop: Picture, source: Source, rng: np.random.Generator, spec: ModelSpec) -> Picture:
    """A picture of a kind of SYNTHETIC_KINDS, from a crop (h, w, 3) of a panorama or from the panorama itself."""
    match kind:
        case "on its side":
            return np.ascontiguousarray(np.rot90(crop, rng.choice([1, 3])))
        case "upside down":
            return np.ascontiguousarray(crop[::-1, ::-1])
        case "whole panorama":
            return _shrink_panorama(source, rng, spec)
        case "night":
            dark = (crop / 255.0) ** 2.2 * rng.uniform(0.003, 0.03) * np.exp(rng.normal(0, 0.3, 3))
            noisy = np.maximum(dark + rng.normal(0, 0.01, crop.shape), 0.0)
            return np.asarray(np.clip(255 * noisy ** (1 / 2.2), 0, 255), dtype=np.uint8)
        case "black":
            return np.clip(rng.normal(rng.uniform(0, 6), 2, crop.shape), 0, 255).astype(np.uint8)
        case "blown out":
            return np.asarray(np.clip(crop * rng.uniform(0.0, 0.2) + rng.uniform(235, 255), 0, 255), dtype=np.uint8)
        case "drawing":
            return _draw_chart(crop.shape, rng)
        case _:
            color = rng.uniform(0, 255, 3)
            return np.clip(color + rng.normal(0, rng.uniform(0, 8), crop.shape), 0, 255).astype(np.uint8)


def _shrink_panorama(source: Source, rng: np.random.Generator, spec: ModelSpec) -> Picture:
    level = source.levels[-1]
    picture = level if level.dtype == np.uint8 else tone_map(level * rng.uniform(0.5, 1.0))
    rolled = np.roll(picture, int(rng.integers(picture.shape[1])), axis=1)
    return np.asarray(Image.fromarray(rolled).resize(fit_size(2, 1, spec), Image.Resampling.HAMMING))


def _draw_chart(shape: tuple[int, ...], rng: np.random.Generator) -> Picture:
    """Boxes, lines and dots on a plain ground: a chart, a screen, a page."""
    image = Image.new("RGB", (shape[1], shape[0]), tuple(rng.integers(0, 256, 3).tolist()))
    draw = ImageDraw.Draw(image)
    for _ in range(int(rng.integers(5, 80))):
        x0, y0, x1, y1 = (rng.uniform(0, 1, 4) * (*shape[1::-1], *shape[1::-1])).tolist()
        color = tuple(rng.integers(0, 256, 3).tolist())
        box = (min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))
        match int(rng.integers(4)):
            case 0:
                draw.rectangle(box, fill=color)
            case 1:
                draw.line((x0, y0, x1, y1), fill=color, width=int(rng.integers(1, 5)))
            case 2:
                draw.ellipse(box, outline=color)
            case _:
                draw.text((x0, y0), "".join(rng.choice(list("abcdefg hijklmno 12345"), 12)), fill=color)
    return np.asarray(image)


def unsuitable_pictures(
    listed: list[_Unsuitable], crops: Iterator[tuple[Picture, Source]], each: int, spec: ModelSpec
) -> Iterator[tuple[str, Picture]]:
    """Kinds and pictures: variants of the listed ones, and one made of each crop, kind by kind in turn.

    Args:
        listed: those of `read_unsuitable`.
        crops: (h, w, 3) sRGB, each with the panorama that it shows.
        each: variants of every listed picture.
        spec: of the network that the pictures are for.
    """
    rng = np.random.default_rng(0)
    for picture in listed:
        for _ in range(each):
            yield picture.kind, _vary(picture.pixels, rng, spec)
    for number, (crop, source) in enumerate(crops):
        kind = SYNTHETIC_KINDS[number % len(SYNTHETIC_KINDS)]
        yield kind, _synthesize(kind, crop, source, rng, spec)
