"""What a network says of a photo, `Prediction`, by its `ModelSpec`; and the answer made of it, `EstimatedLight`.

It also says what each part of a photo shows, in cells of its canvas, CELL_PIXELS wide. `photo_segments` gives those of
the photo: 24 x 18 for a landscape photo, 18 x 24 for an upright one.
"""

import json
from dataclasses import dataclass, field, fields, replace
from enum import IntEnum
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from lighting.errors import ErrorCode, ModelError, ParameterError
from lighting.fields import describe_fields, is_finite
from lighting.geometry import Floats, fit_in_box
from lighting.records import Lighting
from lighting.sun_grid import bayes_direction

Segments = NDArray[np.float32]  # (R, C, classes) probabilities of SurfaceClass in the cells of a photo, rows from above

CELL_PIXELS = 8  # of the network's canvas, each way
_CELLS = (24, 18)  # of a photo's longer and shorter side


class SurfaceClass(IntEnum):
    """What a cell shows, in the order of the network's output."""

    GROUND = 0  # firm and level, and so near that cells are places
    UNEVEN = 1  # slope, steps, boulders, tall grass
    WATER = 2
    PLANTS = 3
    BUILDING = 4  # or wall, fence, bridge
    VEHICLE = 5
    PERSON = 6  # or animal
    OBJECT = 7
    FAR_TERRAIN = 8
    SKY = 9


THINGS = (  # that stand on the ground, in front of what is behind them
    SurfaceClass.PLANTS,
    SurfaceClass.BUILDING,
    SurfaceClass.VEHICLE,
    SurfaceClass.PERSON,
    SurfaceClass.OBJECT,
    SurfaceClass.SKY,
)
PASSING_THINGS = (SurfaceClass.VEHICLE, SurfaceClass.PERSON, SurfaceClass.OBJECT)  # that tell nothing of a place


def photo_segments(canvas: NDArray[np.float32] | None, width: int, height: int) -> Segments | None:
    """Return what the cells of a photo show by what those of the network's canvas show.

    Args:
        canvas: (R, C, classes) probabilities, as `Prediction.segments` has them. None: not predicted, as the answer.
        width: of the photo, pixels.
        height: of the photo, pixels.
    """
    if canvas is None:
        return None
    rows, columns, _ = canvas.shape
    inside = fit_in_box(width, height, columns * CELL_PIXELS, rows * CELL_PIXELS)
    size = _CELLS if width >= height else _CELLS[::-1]
    across, down = (
        _linear_weights(count, cells, (cells - pixels / CELL_PIXELS) / 2)
        for count, cells, pixels in zip(size, (columns, rows), inside, strict=True)
    )
    return np.moveaxis(_resize_planes(np.moveaxis(canvas, 2, 0), across, down), 0, 2)


def class_share(segments: Segments, *classes: SurfaceClass) -> NDArray[np.float32]:
    """Return the probability (R, C) that cells show one of some classes.

    Args:
        segments: of a photo.
        classes: one or more.
    """
    return np.asarray(segments[..., list(classes)].sum(axis=-1))


def pixel_share(segments: Segments, width: int, height: int, *classes: SurfaceClass) -> NDArray[np.float32]:
    """Return `class_share` for the pixels (h, w) of a picture, linear between the cells' middles.

    Args:
        segments: of the whole picture.
        width: of the picture, pixels.
        height: of the picture, pixels.
        classes: one or more.
    """
    rows, columns, _ = segments.shape
    return _resize_planes(
        class_share(segments, *classes), _linear_weights(width, columns), _linear_weights(height, rows)
    )


def class_planes(segments: Segments, width: int, height: int) -> NDArray[np.float32]:
    """Return `pixel_share` (classes, h, w) of each class by itself.

    Args:
        segments: of the whole picture.
        width: of the picture, pixels.
        height: of the picture, pixels.
    """
    rows, columns, _ = segments.shape
    return _resize_planes(np.moveaxis(segments, 2, 0), _linear_weights(width, columns), _linear_weights(height, rows))


def _resize_planes(planes: NDArray[np.float32], across: Floats, down: Floats) -> NDArray[np.float32]:
    """Planes (..., R, C) whose columns are mixed by weights (w, C), and then their rows by weights (h, R)."""
    wide = np.asarray(planes @ across.T, dtype=np.float32)
    return np.asarray(down @ wide, dtype=np.float32)


@lru_cache(maxsize=32)  # photos of one shape need eight
def _linear_weights(count: int, cells: int, margin: float = 0.0) -> Floats:
    """How far (count, cells) cells, but for a margin at both ends, count for pixels: linear between their middles.

    Fewer pixels than cells mix all the cells that lie within one pixel's width. Rows sum to 1.
    """
    step = (cells - 2 * margin) / count  # cells
    middle = margin + (np.arange(count)[:, None] + 0.5) * step
    distance = np.abs(np.arange(cells) + 0.5 - middle) / max(step, 1.0)
    weights = np.maximum(1.0 - distance, 0.0)
    weights /= weights.sum(axis=1, keepdims=True)
    weights.setflags(write=False)
    return weights


@dataclass(frozen=True)
class ModelSpec:
    """A network's input, output layout and licence; stored as JSON in the ONNX file's metadata."""

    name: str
    """Name of the network."""
    version: str
    """Version of the network, such as 4.0.0."""
    width: int
    """Columns of the input, pixels, 1 or more."""
    height: int
    """Rows of the input, pixels, 1 or more."""
    mean: tuple[float, float, float]
    """RGB of sRGB values, 0 to 1, that becomes 0; it also fills the canvas around the photo."""
    std: tuple[float, float, float]
    """RGB over 0, by which sRGB values of 0 to 1, less the mean, are divided."""
    sun_grid: str
    """Name of the grid of directions, see `sun_grid`."""
    licence: str = "Apache-2.0"
    """SPDX name of the weights' licence."""
    training_data: str = ""
    """What the network was trained on, in a sentence."""

    def __post_init__(self) -> None:
        for name in ("name", "version", "sun_grid", "licence", "training_data"):
            _check_spec(name, isinstance(getattr(self, name), str))
        for name in ("width", "height"):
            _check_spec(name, type(getattr(self, name)) is int and getattr(self, name) > 0)
        for name in ("mean", "std"):
            _check_spec(name, len(getattr(self, name)) == 3 and all(map(is_finite, getattr(self, name))))
        _check_spec("std", min(self.std) > 0)

    def to_json(self) -> str:
        """Write the spec as one line of JSON."""
        return json.dumps({f.name: getattr(self, f.name) for f in fields(self)})

    @classmethod
    def from_json(cls, text: str) -> "ModelSpec":
        """Read the spec that `to_json` wrote.

        Args:
            text: JSON.

        Raises:
            ModelError: it is of another layout.
        """
        try:
            values = json.loads(text)
            return cls(**{**values, "mean": tuple(values["mean"]), "std": tuple(values["std"])})
        except (ValueError, TypeError, KeyError) as error:
            raise ModelError(f"The model's metadata does not describe its input: {error}.") from error


@dataclass(frozen=True, eq=False)
class Light:
    """What a network says of the light's strength; in the photo's linear units (sRGB decoded, 1 = white)."""

    sun_irradiance: Floats
    """(3,) RGB, 0 or more, of a surface that faces the sun, in the photo's linear units."""
    sky_irradiance: Floats
    """(3,) RGB, 0 or more, of level ground by the sky without the sun, in the same units."""
    cover: float
    """0 to 1: clear to overcast."""
    suitable: float
    """Probability, 0 to 1, that this is an ordinary photo of outdoors by daylight."""
    surroundings: NDArray[np.float32] | None = None
    """(12, 24, 3) RGB, 0 or more: radiance all around, without the sun, zenith first. None: not said."""


@dataclass(frozen=True)
class Prediction:
    """The network's output for one photo; units as in RANGES, values not yet clipped to them."""

    spec: ModelSpec
    """The network that said it."""
    sun_probability: NDArray[np.float32]
    """(N,) of the cells of the network's sun grid, 0 to 1; sums to 1."""
    sun_visibility: float
    """Probability, about 0 to 1, that direct sunlight reaches the scene."""
    turbidity: float
    """Linke's turbidity, about 1 to 10."""
    exposure: float
    """Factor over 0: the clear sky's radiance times it is the photo's linear values."""
    camera_elevation: float
    """Deg, about -90 to 90: positive looks up."""
    camera_roll: float
    """Deg, about -180 to 180: positive turns the camera clockwise."""
    vertical_fov: float
    """Deg, about 1 to 170, of the upright photo."""
    light: Light | None = None
    """How strong the light is. None: the network says nothing of it."""
    segments: NDArray[np.float32] | None = None
    """(R, C, K) probabilities, 0 to 1, what the canvas shows, by `prediction.SurfaceClass`. None: not predicted."""

    @cached_property
    def sun_direction(self) -> Floats:
        """Unit vector (3,) towards the sun by the pixels alone, in the frame of geometry.py; read-only."""
        vector = bayes_direction(self.sun_probability, self.spec.sun_grid)
        vector.flags.writeable = False
        return vector

    def with_camera(self, elevation: float, roll: float, vertical_fov: float | None = None) -> "Prediction":
        """Return the same with another camera; where the sun is, is not computed again.

        Args:
            elevation: deg, positive looks up.
            roll: deg, positive turns the camera clockwise.
            vertical_fov: deg; None: as it is.
        """
        fov = self.vertical_fov if vertical_fov is None else vertical_fov
        other = replace(self, camera_elevation=elevation, camera_roll=roll, vertical_fov=fov)
        if (sun := vars(self).get("sun_direction")) is not None:
            vars(other)["sun_direction"] = sun
        return other


@dataclass(frozen=True)
class SunEstimate:
    """The sun's direction and radii by a distribution; units as in RANGES."""

    azimuth: float
    """Deg, -180 to 180: 0 = where the camera points, positive to the right."""
    elevation: float
    """Deg above the horizon, -4.2 to 90."""
    radius_50: float
    """Deg, 0 to 180: the cone around the direction that holds half of the probability."""
    radius_90: float
    """Deg, 0 to 180: the cone that holds nine tenths."""


@dataclass(frozen=True, eq=False)
class SunDistribution:
    """Where the sun may be: a probability for each cell of a grid over the upper hemisphere."""

    grid: str
    """Name of the grid of directions, see `sun_grid`."""
    probability: NDArray[np.float32] = field(repr=False)
    """(N,) of the grid's cells, 0 to 1; sums to 1."""


@dataclass(frozen=True, eq=False)
class EstimatedLight:
    """The answer about one photo: its light, and where else the sun may be."""

    lighting: Lighting
    """The light and the camera."""
    distribution: SunDistribution
    """Where the sun may be, with all evidence counted."""
    surroundings: NDArray[np.float32] | None = field(default=None, repr=False)
    """(12, 24, 3) RGB, 0 or more: radiance all around as the network predicts it, zenith first. None: not predicted."""
    segments: NDArray[np.float32] | None = field(default=None, repr=False)
    """(R, C, K) probabilities, 0 to 1, of what the photo shows, by `prediction.SurfaceClass`. None: not sought."""

    @property
    def evidence(self) -> tuple[str, ...]:
        """What the answer rests on: values of EvidenceKind."""
        return self.lighting.evidence

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences for people, above all about evidence that contradicts the pixels."""
        return self.lighting.warnings


describe_fields(ModelSpec, Light, Prediction, SunEstimate, SunDistribution, EstimatedLight)


def check_estimate(thing: object) -> None:
    """Raise ParameterError for what is no Estimate.

    Args:
        thing: what a caller passed as one.
    """
    if not isinstance(thing, EstimatedLight):
        sentence = f"An Estimate is needed, not {type(thing).__name__}; an Estimator makes one of a photo."
        raise ParameterError(sentence, code=ErrorCode.WRONG_TYPE)


def _check_spec(name: str, fits: bool) -> None:
    if not fits:
        raise ModelError(f"The model's metadata does not describe its input: {name} is not as it should be.")
