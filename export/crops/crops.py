"""Limited-view crops of panoramas: what a camera standing there would have taken, with everything known about it.

A crop is decided by its panorama's name, its index and its protocol alone: adding panoramas changes no other crop.
"""

import hashlib
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from export.data.labels import Label
from export.data.panoramas import Panorama, decode, read_picture
from lighting.colour import luminance
from lighting.geometry import camera_directions, camera_pixel, direction, sample_latlong, wrap_azimuth
from lighting.photo import fit_size
from lighting.records import ModelSpec

MAX_HORIZONTAL_FOV = 106.0  # deg, about what the ultra-wide lens of a phone takes
PHONE_ASPECTS = (9 / 16, 2 / 3, 3 / 4, 1.0, 4 / 3, 3 / 2, 16 / 9)

_KERNELS = {  # a bicubic filter would draw a black ring around the sun of an HDR panorama
    "ldr": Image.Resampling.BICUBIC,
    "hdr": Image.Resampling.BILINEAR,
}

Floats = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Camera:
    """How a crop is taken; angles in deg, in the panorama's frame."""

    azimuth: float  # -180 to 180
    elevation: float
    roll: float
    vertical_fov: float
    aspect: float  # width / height
    mirrored: bool = False


@dataclass(frozen=True)
class Source:
    """A panorama in memory with its label: pixels halved repeatedly, so that wide crops do not alias."""

    panorama: Panorama
    levels: tuple[NDArray[Any], ...]  # (H, 2H, 3), (H/2, H, 3), ...; uint8 sRGB or float32 linear
    label: Label


@dataclass(frozen=True)
class Crop:
    """A picture and its targets; NaN where the panorama does not tell."""

    linear: NDArray[np.float32]  # (h, w, 3) linear Rec.709 in the photo's exposure, not yet clipped
    camera: Camera
    sun_azimuth: float  # deg, relative to the camera
    sun_elevation: float
    sun_uncertainty: float  # deg, one sigma
    sun_visibility: float  # 1 direct sun, 0.5 partly, 0 none
    turbidity: float
    exposure: float
    gain: float = 1.0  # what the panorama's values were multiplied with

    @property
    def sun_direction(self) -> Floats:
        """Unit vector (3,), NaN without a sun."""
        return direction(self.sun_azimuth, self.sun_elevation)

    @property
    def sun_pixel(self) -> tuple[float, float] | None:
        """Where (x, y) in the picture the sun lies, None if there is none or elsewhere."""
        height, width = self.linear.shape[:2]
        return pixel_of(self.camera, self.sun_azimuth, self.sun_elevation, width, height)

    @property
    def parameters(self) -> Floats:
        """Targets (6,) in the order of lighting.model.PARAMETERS."""
        c = self.camera
        return np.array(
            [self.turbidity, self.exposure, c.elevation, c.roll, c.vertical_fov, self.sun_visibility], np.float32
        )


def generator(name: str, index: int, purpose: str) -> np.random.Generator:
    """Randomness that depends on the panorama's name, the crop's index and what it is for alone."""
    digest = hashlib.sha256(f"{purpose}/{name}/{index}".encode()).digest()
    return np.random.default_rng(int.from_bytes(digest[:8], "little"))


def load_source(panorama: Panorama, label: Label) -> Source:
    """Read a panorama and halve it down to 192 rows."""
    levels = [read_picture(panorama)]
    while levels[-1].shape[0] >= 2 * 192:
        levels.append(_halve(levels[-1]))
    return Source(panorama, tuple(levels), label)


def _halve(image: NDArray[Any]) -> NDArray[Any]:
    height, width = image.shape[0] // 2, image.shape[1] // 2
    mean = image[: 2 * height, : 2 * width].reshape(height, 2, width, 2, 3).mean(axis=(1, 3), dtype=np.float32)
    return np.asarray(np.round(mean).astype(np.uint8) if image.dtype == np.uint8 else mean)


def paper_camera(rng: np.random.Generator) -> Camera:
    """The protocol of CVPR 2017: elevation within 20 deg, vertical field of view 35 to 68 deg, 4:3, no roll."""
    return Camera(rng.uniform(-180, 180), rng.uniform(-20, 20), 0.0, rng.uniform(35, 68), 4 / 3)


def phone_camera(rng: np.random.Generator) -> Camera:
    """What phones take: elevation within 35 deg, roll within 10, vertical field of view 25 to 90, 9:16 to 16:9."""
    aspect = float(rng.choice(PHONE_ASPECTS))
    widest = np.degrees(2 * np.arctan(np.tan(np.radians(MAX_HORIZONTAL_FOV / 2)) / aspect))
    fov = rng.uniform(25, min(90.0, widest))
    return Camera(rng.uniform(-180, 180), rng.uniform(-35, 35), rng.uniform(-10, 10), fov, aspect)


def training_camera(rng: np.random.Generator) -> Camera:
    """Half of the crops as phones take them, half near the paper's with the small roll of a hand; half mirrored."""
    if rng.random() < 0.5:
        camera = phone_camera(rng)
    else:
        roll = float(np.clip(rng.normal(0, 2), -10, 10))
        camera = replace(paper_camera(rng), roll=roll, vertical_fov=rng.uniform(32, 75))
    return replace(camera, mirrored=bool(rng.random() < 0.5))


def aimed_camera(rng: np.random.Generator, azimuth: float, elevation: float) -> Camera:
    """A training camera turned until its picture holds a sun there [deg]; whatever it is after forty turns."""
    for _ in range(40):
        camera = training_camera(rng)
        camera = replace(camera, azimuth=float(wrap_azimuth(azimuth + rng.uniform(-53, 53))))
        if pixel_of(camera, azimuth - camera.azimuth, elevation, round(1000 * camera.aspect), 1000):
            break
    return camera


def pixel_of(camera: Camera, azimuth: float, elevation: float, width: int, height: int) -> tuple[float, float] | None:
    """Pixel (x, y) of a picture where a direction [deg] lies, its azimuth relative to the camera; None if outside."""
    towards = direction(azimuth, elevation)
    x, y = camera_pixel(towards, width, height, camera.vertical_fov, 0.0, camera.elevation, camera.roll)
    return (float(x), float(y)) if 0 <= x <= width and 0 <= y <= height else None


PROTOCOLS: dict[str, Callable[[np.random.Generator], Camera]] = {
    "paper": paper_camera,
    "phone": phone_camera,
    "train": training_camera,
}


def take(source: Source, camera: Camera, spec: ModelSpec, sharpness: float = 1.0) -> Crop:
    """The crop that `camera` takes, sized for the canvas of `spec`, with its targets.

    `sharpness` (0 to 1] is the share of the canvas's resolution that is kept: a narrow view has few panorama pixels,
    and without equal blur for all the network would read the field of view from it.
    """
    width, height = fit_size(round(1000 * camera.aspect), 1000, spec)
    kernel = _KERNELS[source.panorama.kind]
    linear = resize(view(source, camera, width, height, sharpness), width, height, kernel)
    gain = _automatic_gain(linear) if source.panorama.kind == "hdr" else 1.0
    side = -1.0 if camera.mirrored else 1.0
    label = source.label
    nan = float("nan")
    return Crop(
        linear=linear[:, ::-1] * gain if camera.mirrored else linear * gain,
        camera=replace(camera, roll=side * camera.roll),
        sun_azimuth=side * float(wrap_azimuth(label.sun_azimuth - camera.azimuth)),
        sun_elevation=max(label.sun_elevation, 0.0),
        sun_uncertainty=label.sun_uncertainty,
        sun_visibility={"yes": 1.0, "partly": 0.5, "no": 0.0}.get(label.direct, nan),
        turbidity=label.turbidity if label.fit_ok else nan,
        exposure=label.exposure * gain if label.fit_ok else nan,
        gain=gain,
    )


def view(source: Source, camera: Camera, width: int, height: int, sharpness: float) -> NDArray[np.float32]:
    """Linear samples of a camera's view, at most (height, width), no finer than the panorama or `sharpness` allow."""
    finest = _finest(source, camera)
    rows = max(8, round(min(height * sharpness, finest)))
    columns = max(8, round(rows * width / height))
    level = int(np.clip(np.floor(np.log2(finest / rows)), 0, len(source.levels) - 1))
    rays = camera_directions(columns, rows, camera.vertical_fov, camera.azimuth, camera.elevation, camera.roll).astype(
        np.float32
    )
    sampled = sample_latlong(source.levels[level], rays).astype(np.float32)
    return decode(np.round(sampled).astype(np.uint8)) if source.panorama.kind == "ldr" else sampled


def is_resolved(source: Source, camera: Camera, rows: float) -> bool:
    """Whether the panorama has `rows` pixels along the view's height; if not, its blur tells the field of view."""
    return _finest(source, camera) >= rows


def _finest(source: Source, camera: Camera) -> float:
    """Panorama pixels along the view's height."""
    return float(source.levels[0].shape[0] / 180.0 * camera.vertical_fov)


def resize(image: NDArray[np.float32], width: int, height: int, kernel: Image.Resampling) -> NDArray[np.float32]:
    """Resampling of (h, w, 3) to (height, width, 3) by a filter of Pillow's."""
    if image.shape[:2] == (height, width):
        return image
    planes = [Image.fromarray(np.ascontiguousarray(image[..., c])) for c in range(3)]
    resized = [np.asarray(p.resize((width, height), kernel)) for p in planes]
    return np.asarray(np.maximum(np.stack(resized, axis=-1), 0.0))


def _automatic_gain(linear: NDArray[np.float32]) -> float:
    """What takes a scene-referred view to a photo's exposure: the brighter parts end just below white."""
    return float(0.7 / max(float(np.percentile(luminance(linear), 80)), 1e-6))


def sampling_weights(sources: Sequence[Source]) -> Floats:
    """Chances (N,) of drawing each panorama: places count by the root of their size, rare sun elevations more."""
    places = Counter(s.panorama.place for s in sources)
    size = np.array([places[s.panorama.place] for s in sources], dtype=np.float64)
    elevation = np.array([s.label.sun_elevation for s in sources])
    bins = np.where(np.isfinite(elevation), np.nan_to_num(np.maximum(elevation, 0)) // 15, -1)
    crowd = np.array([np.count_nonzero(bins == b) for b in bins], dtype=np.float64)
    weight = size**-0.5 * crowd**-0.75
    return np.asarray(weight / max(weight.sum(), 1e-12))
