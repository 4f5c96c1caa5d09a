"""Crops of panoramas: cameras drawn by protocol, and the picture that each takes, with its targets.

A camera stands at its panorama's center. A crop depends on its panorama's name, its index and its protocol alone:
adding panoramas changes no other crop.
"""

import hashlib
import math
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from export.data.labels import Label, read_labels_of
from export.data.panoramas import Panorama, decode_srgb, read_picture
from lighting.color import luminance
from lighting.geometry import Floats, Pinhole, camera_directions, camera_pixel, direction, sample_latlong, wrap_azimuth
from lighting.model import fit_size
from lighting.prediction import ModelSpec

MAX_HORIZONTAL_FOV = 106.0  # deg, about that of a phone's ultra-wide lens
PHONE_ASPECTS = (9 / 16, 2 / 3, 3 / 4, 1.0, 4 / 3, 3 / 2, 16 / 9)
_MAX_TILTED_ROLL = 45.0  # deg, of a tilted phone
_MAX_AIM_ATTEMPTS = 40  # cameras tried until one sees the sun

VISIBILITY = {"yes": 1.0, "partly": 0.5, "no": 0.0}  # target by whether direct sunlight reaches the scene

_MIN_ROWS = 192  # of the smallest level
_WHITE, _WHITE_PERCENTILE = 0.7, 80  # linear value that this percentile of the luminance has in a photo
_MIN_WHITE = 1e-6  # luminance
# A bicubic filter would draw a black ring around the sun of an HDR panorama.
_KERNELS = {"ldr": Image.Resampling.BICUBIC, "hdr": Image.Resampling.BILINEAR}


@dataclass(frozen=True)
class Camera:
    """How a crop is taken; angles in deg, in the panorama's frame."""

    azimuth: float  # -180 to 180
    elevation: float  # positive looks up
    roll: float
    vertical_fov: float
    aspect: float  # width / height
    mirrored: bool = False  # left and right are swapped in the picture


def paper_camera(rng: np.random.Generator) -> Camera:
    """The protocol of CVPR 2017: elevation within 20 deg, vertical field of view 35 to 68 deg, 4:3, no roll.

    Args:
        rng: draws the angles.
    """
    return Camera(rng.uniform(-180, 180), rng.uniform(-20, 20), 0.0, rng.uniform(35, 68), 4 / 3)


def phone_camera(rng: np.random.Generator) -> Camera:
    """What phones take: elevation within 35 deg, roll within 10, vertical field of view 25 to 90, 9:16 to 16:9.

    Args:
        rng: draws the angles and the aspect.
    """
    aspect = float(rng.choice(PHONE_ASPECTS))
    widest = np.degrees(2 * np.arctan(np.tan(np.radians(MAX_HORIZONTAL_FOV / 2)) / aspect))
    fov = rng.uniform(25, min(90.0, widest))
    return Camera(rng.uniform(-180, 180), rng.uniform(-35, 35), rng.uniform(-10, 10), fov, aspect)


def training_camera(rng: np.random.Generator) -> Camera:
    """Half as phones take photos, half near the paper's protocol with a small roll; half of all are mirrored.

    One in seven of the phones is tilted, by up to 45 deg.

    Args:
        rng: draws the angles.
    """
    if rng.random() < 0.5:
        camera = phone_camera(rng)
        if rng.random() < 1 / 7:
            camera = replace(camera, roll=rng.uniform(-_MAX_TILTED_ROLL, _MAX_TILTED_ROLL))
    else:
        roll = float(np.clip(rng.normal(0, 2), -10, 10))
        camera = replace(paper_camera(rng), roll=roll, vertical_fov=rng.uniform(32, 75))
    return replace(camera, mirrored=bool(rng.random() < 0.5))


def aimed_camera(rng: np.random.Generator, azimuth: float, elevation: float) -> Camera:
    """A training camera whose picture holds the sun; after 40 attempts, any camera.

    Args:
        rng: draws the cameras.
        azimuth: deg, of the sun in the panorama.
        elevation: deg, of the sun.
    """
    for _ in range(_MAX_AIM_ATTEMPTS):
        camera = training_camera(rng)
        camera = replace(camera, azimuth=float(wrap_azimuth(azimuth + rng.uniform(-53, 53))))
        if _direction_to_pixel(camera, azimuth - camera.azimuth, elevation, round(1000 * camera.aspect), 1000):
            break
    return camera


def pinhole_camera(camera: Camera, width: int, height: int, azimuth: float = 0.0) -> Pinhole:
    """The camera of a picture of `width` x `height` pixels.

    Args:
        camera: its elevation, roll and field of view.
        width: pixels.
        height: pixels.
        azimuth: deg, to which it looks, whatever that of `camera`.
    """
    return Pinhole(width, height, camera.vertical_fov, azimuth, camera.elevation, camera.roll)


def _direction_to_pixel(
    camera: Camera, azimuth: float, elevation: float, width: int, height: int
) -> tuple[float, float] | None:
    """Pixel (x, y) of a picture where a direction lies; None if outside.

    Args:
        camera: its elevation, roll and field of view.
        azimuth: deg, relative to the camera, positive to the right.
        elevation: deg above the horizon.
        width: pixels of the picture.
        height: pixels of the picture.
    """
    x, y = camera_pixel(direction(azimuth, elevation), pinhole_camera(camera, width, height))
    return (float(x), float(y)) if 0 <= x <= width and 0 <= y <= height else None


PROTOCOLS: dict[str, Callable[[np.random.Generator], Camera]] = {  # by their names in reports
    "paper": paper_camera,
    "phone": phone_camera,
}


@dataclass(frozen=True)
class Source:
    """A panorama with its label, at several resolutions, so that wide crops do not alias."""

    panorama: Panorama
    levels: tuple[NDArray[Any], ...]  # (H, 2H, 3), (H/2, H, 3), ...; uint8 sRGB or float32 linear
    label: Label


def load_sources(panoramas: Sequence[Panorama], labels: str | Path) -> list[Source]:
    """Panoramas with their labels; DataError if a label is missing.

    Args:
        panoramas: rows of the index.
        labels: CSV file of `python -m export label`.
    """
    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(load_source, panoramas, read_labels_of(panoramas, labels)))


def load_source(panorama: Panorama, label: Label) -> Source:
    """Read a panorama and halve it repeatedly, down to _MIN_ROWS or a little more.

    Args:
        panorama: a row of the index.
        label: of the panorama.
    """
    levels = [read_picture(panorama)]
    while (height := len(levels[-1]) // 2) >= _MIN_ROWS:
        width = levels[-1].shape[1] // 2
        pairs = levels[-1][: 2 * height, : 2 * width].reshape(height, 2, width, 2, 3)
        mean = pairs.mean(axis=(1, 3), dtype=np.float32)
        levels.append(np.round(mean).astype(np.uint8) if pairs.dtype == np.uint8 else mean)
    return Source(panorama, tuple(levels), label)


def sampling_weights(sources: Sequence[Source]) -> Floats:
    """Chances (N,) of drawing each panorama: places count by the root of their size, rare sun elevations more.

    Args:
        sources: the N panoramas of a run.
    """
    return balanced_weights([s.panorama.place for s in sources], [s.label.sun_elevation for s in sources], 0.75)


def balanced_weights(groups: Sequence[str], elevations: Sequence[float], power: float) -> Floats:
    """Chances (N,) that sum to 1: groups count by the root of their size, rare sun elevations more.

    Args:
        groups: name of the group of each picture.
        elevations: deg, of the sun of each picture; NaN without one.
        power: by which pictures of common elevations, in steps of 15 deg, count less; 0 for not at all.
    """
    sizes, elevation = Counter(groups), np.array(elevations)
    bins = np.where(np.isfinite(elevation), np.nan_to_num(np.maximum(elevation, 0)) // 15, -1)
    neighbors = np.array([np.count_nonzero(bins == b) for b in bins], dtype=np.float64)
    weight = np.array([sizes[group] for group in groups], dtype=np.float64) ** -0.5 * neighbors**-power
    return np.asarray(weight / max(weight.sum(), 1e-12))


@dataclass(frozen=True)
class Crop:
    """A picture and its targets; NaN where the panorama does not tell."""

    linear: NDArray[np.float32]  # (h, w, 3) linear Rec.709 in the photo's exposure, not yet clipped
    camera: Camera
    sun_azimuth: float  # deg, relative to the camera, positive to the right
    sun_elevation: float  # deg above the horizon
    sun_std: float  # deg
    sun_visibility: float  # 1 direct sun, 0.5 partly, 0 none
    turbidity: float  # 1 to 10
    exposure: float  # linear values / sky radiance
    gain: float = 1.0  # what the panorama's values were multiplied with

    @property
    def sun_direction(self) -> Floats:
        """Unit vector (3,), NaN without a sun."""
        return direction(self.sun_azimuth, self.sun_elevation)

    @property
    def sun_pixel(self) -> tuple[float, float] | None:
        """Where (x, y) in the picture the sun lies, None if there is none or elsewhere."""
        height, width = self.linear.shape[:2]
        return _direction_to_pixel(self.camera, self.sun_azimuth, self.sun_elevation, width, height)

    @property
    def parameters(self) -> Floats:
        """Targets (6,) in the order of lighting.model.PARAMETERS."""
        c = self.camera
        sky, camera = (self.turbidity, self.exposure), (c.elevation, c.roll, c.vertical_fov)
        return np.array([*sky, *camera, self.sun_visibility], np.float32)


def crop_panorama(source: Source, camera: Camera, spec: ModelSpec, sharpness: float = 1.0) -> Crop:
    """The crop that `camera` takes, sized for the canvas of `spec`, with its targets.

    A narrow view holds few panorama pixels; training blurs all crops alike, or the network would read the field of view
    from the blur.

    Args:
        source: the panorama.
        camera: how the crop is taken, in the panorama's frame.
        spec: of the network that the crop is for.
        sharpness: share of the canvas's resolution that is kept, in (0, 1].
    """
    width, height = fit_size(round(1000 * camera.aspect), 1000, spec)
    kernel, gain = _KERNELS[source.panorama.kind], 1.0
    linear = resize(_view(source, camera, width, height, sharpness), width, height, kernel)
    if source.panorama.kind == "hdr":  # any unit: its brighter parts become nearly white
        gain = float(_WHITE / max(float(np.percentile(luminance(linear), _WHITE_PERCENTILE)), _MIN_WHITE))
    side = -1.0 if camera.mirrored else 1.0
    label = source.label
    nan = math.nan
    return Crop(
        linear=linear[:, ::-1] * gain if camera.mirrored else linear * gain,
        camera=replace(camera, roll=side * camera.roll),
        sun_azimuth=side * float(wrap_azimuth(label.sun_azimuth - camera.azimuth)),
        sun_elevation=max(label.sun_elevation, 0.0),
        sun_std=label.sun_uncertainty,
        sun_visibility=VISIBILITY.get(label.direct, nan),
        turbidity=label.turbidity if label.fit_ok else nan,
        exposure=label.exposure * gain if label.fit_ok else nan,
        gain=gain,
    )


def _view(source: Source, camera: Camera, width: int, height: int, sharpness: float) -> NDArray[np.float32]:
    """Linear samples of a camera's view, at most (height, width), no finer than the panorama or `sharpness` allow."""
    finest = native_rows(source, camera)
    rows = max(8, round(min(height * sharpness, finest)))
    columns = max(8, round(rows * width / height))
    level = int(np.clip(np.floor(np.log2(finest / rows)), 0, len(source.levels) - 1))
    pinhole = pinhole_camera(camera, columns, rows, camera.azimuth)
    rays = camera_directions(pinhole).astype(np.float32)
    sampled = sample_latlong(source.levels[level], rays).astype(np.float32)
    ldr = source.panorama.kind == "ldr"
    return decode_srgb(np.round(sampled).astype(np.uint8)) if ldr else sampled


def native_rows(source: Source, camera: Camera) -> float:
    """How many of the panorama's pixels lie along the view's height.

    A picture with more rows shows the panorama's own rows and columns, which are horizontals and verticals of the
    world. The blur of one with fewer than it should have tells the field of view.

    Args:
        source: the panorama.
        camera: how the view is taken.
    """
    return float(source.levels[0].shape[0] / 180.0 * camera.vertical_fov)


def resize(image: NDArray[np.float32], width: int, height: int, kernel: Image.Resampling) -> NDArray[np.float32]:
    """Resample (h, w, 3) to (height, width, 3); no value becomes negative.

    Args:
        image: (h, w, 3) linear.
        width: pixels.
        height: pixels.
        kernel: a filter of Pillow's.
    """
    if image.shape[:2] == (height, width):
        return image
    planes = [Image.fromarray(np.ascontiguousarray(image[..., c])) for c in range(3)]
    resized = [np.asarray(p.resize((width, height), kernel)) for p in planes]
    return np.asarray(np.maximum(np.stack(resized, axis=-1), 0.0))


def crop_rng(name: str, index: int, purpose: str) -> np.random.Generator:
    """A generator whose seed does not change when panoramas are added or left out.

    Args:
        name: of the panorama.
        index: of the crop.
        purpose: such as "train": crops for another purpose are others.
    """
    digest = hashlib.sha256(f"{purpose}/{name}/{index}".encode()).digest()
    return np.random.default_rng(int.from_bytes(digest[:8], "little"))
