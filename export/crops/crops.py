"""Limited-view crops of panoramas: the picture a camera standing there would have taken, with its targets.

A crop depends on its panorama's name, its index and its protocol alone: adding panoramas changes no other crop.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from export.crops.cameras import Camera, pinhole, pixel_of
from export.crops.exposure import automatic_gain
from export.crops.sources import Source
from export.data import decode
from lighting.geometry import Floats, camera_directions, direction, sample_latlong, wrap_azimuth
from lighting.photo import fit_size
from lighting.records import ModelSpec

_KERNELS = {  # a bicubic filter would draw a black ring around the sun of an HDR panorama
    "ldr": Image.Resampling.BICUBIC,
    "hdr": Image.Resampling.BILINEAR,
}


VISIBILITY = {"yes": 1.0, "partly": 0.5, "no": 0.0}  # target by whether direct sunlight reaches the scene


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


def take(source: Source, camera: Camera, spec: ModelSpec, sharpness: float = 1.0) -> Crop:
    """The crop that `camera` takes, sized for the canvas of `spec`, with its targets.

    `sharpness` in (0, 1] is the share of the canvas's resolution that is kept. A narrow view holds few panorama pixels;
    training blurs all crops alike, or the network would read the field of view from the blur.
    """
    width, height = fit_size(round(1000 * camera.aspect), 1000, spec)
    kernel = _KERNELS[source.panorama.kind]
    linear = resize(_view(source, camera, width, height, sharpness), width, height, kernel)
    gain = automatic_gain(linear) if source.panorama.kind == "hdr" else 1.0
    side = -1.0 if camera.mirrored else 1.0
    label = source.label
    nan = float("nan")
    return Crop(
        linear=linear[:, ::-1] * gain if camera.mirrored else linear * gain,
        camera=replace(camera, roll=side * camera.roll),
        sun_azimuth=side * float(wrap_azimuth(label.sun_azimuth - camera.azimuth)),
        sun_elevation=max(label.sun_elevation, 0.0),
        sun_uncertainty=label.sun_uncertainty,
        sun_visibility=VISIBILITY.get(label.direct, nan),
        turbidity=label.turbidity if label.fit_ok else nan,
        exposure=label.exposure * gain if label.fit_ok else nan,
        gain=gain,
    )


def finest_side(source: Source, camera: Camera) -> int:
    """Pixels along the longer side of a picture that is as fine as its panorama.

    One that is finer shows the panorama's own rows and columns, which are horizontals and verticals of the world.
    """
    return int(max(camera.aspect, 1.0) * _finest(source, camera))


def _view(source: Source, camera: Camera, width: int, height: int, sharpness: float) -> NDArray[np.float32]:
    """Linear samples of a camera's view, at most (height, width), no finer than the panorama or `sharpness` allow."""
    finest = _finest(source, camera)
    rows = max(8, round(min(height * sharpness, finest)))
    columns = max(8, round(rows * width / height))
    level = int(np.clip(np.floor(np.log2(finest / rows)), 0, len(source.levels) - 1))
    rays = source.stretch.undone(camera_directions(pinhole(camera, columns, rows, camera.azimuth)).astype(np.float32))
    sampled = sample_latlong(source.levels[level], rays).astype(np.float32)
    ldr = source.panorama.kind == "ldr"
    return decode(np.round(sampled).astype(np.uint8)) if ldr else sampled


def is_resolved(source: Source, camera: Camera, rows: float) -> bool:
    """Whether the panorama has `rows` pixels along the view's height; if not, its blur tells the field of view."""
    return _finest(source, camera) >= rows


def _finest(source: Source, camera: Camera) -> float:
    """Panorama pixels along the view's height."""
    return float(source.levels[0].shape[0] / 180.0 * camera.vertical_fov / source.stretch.largest)


def resize(image: NDArray[np.float32], width: int, height: int, kernel: Image.Resampling) -> NDArray[np.float32]:
    """Resampling of (h, w, 3) to (height, width, 3) by a filter of Pillow's."""
    if image.shape[:2] == (height, width):
        return image
    planes = [Image.fromarray(np.ascontiguousarray(image[..., c])) for c in range(3)]
    resized = [np.asarray(p.resize((width, height), kernel)) for p in planes]
    return np.asarray(np.maximum(np.stack(resized, axis=-1), 0.0))
