"""The records between the network and the sky: what it expects, what it said, what the user gets.

Names and units are the same in Python, JSON, command-line options, HTTP parameters, EXR attributes and CSV columns.
"""

import json
import math
import reprlib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from lighting.errors import ModelError, ParameterError
from lighting.geometry import angles, direction
from lighting.sky import sky_coefficients
from lighting.sun_grid import best_guess, grid_directions, radii

SKY_MODEL = "hosek-wilkie"
GROUND_ALBEDO = 0.3  # the sky fits of the training data assume it too

RANGES: dict[str, tuple[float, float]] = {
    "sun_azimuth": (-180.0, 180.0),  # deg, 0 = where the camera points, positive to the right
    "sun_elevation": (0.0, 90.0),  # deg above the horizon
    "sun_visibility": (0.0, 1.0),  # probability that direct sunlight reaches the scene
    "radius_50": (0.0, 180.0),  # deg around the sun's direction that hold 50 % of the probability
    "radius_90": (0.0, 180.0),  # the same for 90 %
    "turbidity": (1.0, 10.0),  # Linke, as Hosek-Wilkie uses it
    "ground_albedo": (0.0, 1.0),
    "exposure": (1e-6, 1e6),  # photo's linear values / sky radiance
    "camera_elevation": (-90.0, 90.0),  # deg, positive looks up
    "camera_roll": (-180.0, 180.0),  # deg, positive turns the camera clockwise
    "vertical_fov": (1.0, 170.0),  # deg
}

OPTIONAL_RANGES: dict[str, tuple[float, float]] = {  # what is not always known
    "camera_heading": (0.0, 360.0),  # deg clockwise from true north, where azimuth 0 points
    "camera_heading_radius_50": (0.0, 180.0),  # deg to either side of it that hold 50 % of its probability
    "camera_heading_radius_90": (0.0, 180.0),  # the same for 90 %
    "relative_heading": (0.0, 360.0),  # deg clockwise from the first of several photos
    "latitude": (-90.0, 90.0),  # deg, positive north; only where the user asked for it
    "longitude": (-180.0, 180.0),  # deg, positive east
}


@dataclass(frozen=True)
class ModelSpec:
    """What a network expects and means; travels as JSON in the ONNX file's metadata."""

    name: str
    version: str
    width: int  # of the input canvas, pixels
    height: int
    mean: tuple[float, float, float]  # of sRGB values in [0, 1]; also fills the canvas around the photo
    std: tuple[float, float, float]
    sun_grid: str  # layout name, see sun_grid.py
    licence: str = "Apache-2.0"
    training_data: str = ""

    def __post_init__(self) -> None:
        for name in ("name", "version", "sun_grid", "licence", "training_data"):
            _check_spec(name, isinstance(getattr(self, name), str))
        for name in ("width", "height"):
            _check_spec(name, type(getattr(self, name)) is int and getattr(self, name) > 0)
        for name in ("mean", "std"):
            _check_spec(name, len(getattr(self, name)) == 3 and all(_is_finite(v) for v in getattr(self, name)))
        _check_spec("std", min(self.std) > 0)

    def to_json(self) -> str:
        """One line of JSON."""
        return json.dumps({f.name: getattr(self, f.name) for f in fields(self)})

    @classmethod
    def from_json(cls, text: str) -> "ModelSpec":
        """The spec that `to_json` wrote; ModelError if it is of another layout."""
        try:
            values = json.loads(text)
            spec = cls(**{**values, "mean": tuple(values["mean"]), "std": tuple(values["std"])})
        except (ValueError, TypeError, KeyError) as error:
            raise ModelError(f"The model's metadata does not describe its input: {error}.") from error
        grid_directions(spec.sun_grid)
        return spec


@dataclass(frozen=True)
class Prediction:
    """What the network said about one photo."""

    spec: ModelSpec
    sun_probability: NDArray[np.float32]  # (N,) over the cells of spec.sun_grid, sums to 1
    sun_visibility: float
    turbidity: float
    exposure: float
    camera_elevation: float
    camera_roll: float
    vertical_fov: float


@dataclass(frozen=True)
class Sun:
    """Where a distribution puts the sun; units as in RANGES."""

    azimuth: float
    elevation: float
    radius_50: float
    radius_90: float


@dataclass(frozen=True)
class Lighting:
    """The light of one photo and the camera that took it; units and ranges in RANGES."""

    sun_azimuth: float
    sun_elevation: float
    turbidity: float
    exposure: float
    ground_albedo: float = GROUND_ALBEDO
    sun_visibility: float = 1.0
    radius_50: float = 0.0
    radius_90: float = 0.0
    camera_elevation: float = 0.0
    camera_roll: float = 0.0
    vertical_fov: float = 50.0
    model_name: str = "none"
    model_version: str = "0"
    evidence: tuple[
        str, ...
    ] = ()  # what it rests on: "pixels", "time+place", "heading", "focal length", "other photos"
    warnings: tuple[str, ...] = ()  # sentences, above all about evidence that contradicts the pixels
    camera_heading: float | None = None
    camera_heading_radius_50: float | None = None
    camera_heading_radius_90: float | None = None
    camera_heading_probability: tuple[float, ...] = ()  # of each of 360 whole degrees, if the heading is known
    relative_heading: float | None = None
    latitude: float | None = field(default=None, repr=False)
    longitude: float | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        for name, (low, high) in RANGES.items():
            check_range(name, getattr(self, name), low, high)
        for name, (low, high) in OPTIONAL_RANGES.items():
            if getattr(self, name) is not None:
                check_range(name, getattr(self, name), low, high)
        _check_headings(self.camera_heading_probability)

    @property
    def sun_shines(self) -> bool:
        """Whether direct sunlight is at least as likely as not: the sun's disc is painted then, unless told."""
        return self.sun_visibility >= 0.5

    @property
    def sun_direction(self) -> NDArray[np.floating[Any]]:
        """Unit vector (3,) towards the sun, in the frame of geometry.py."""
        return direction(self.sun_azimuth, self.sun_elevation)

    def to_dict(self) -> dict[str, Any]:
        """The JSON record; `sun.direction` and `sky.coefficients` follow from the other fields."""
        return {
            "model": {"name": self.model_name, "version": self.model_version},
            "sun": {
                "azimuth": self.sun_azimuth,
                "elevation": self.sun_elevation,
                "direction": [round(float(v), 6) for v in self.sun_direction],
                "visibility": self.sun_visibility,
                "radius_50": self.radius_50,
                "radius_90": self.radius_90,
            },
            "sky": {
                "model": SKY_MODEL,
                "turbidity": self.turbidity,
                "ground_albedo": self.ground_albedo,
                "exposure": self.exposure,
                "coefficients": sky_coefficients(self.sun_elevation, self.turbidity, self.ground_albedo),
            },
            "camera": {
                "elevation": self.camera_elevation,
                "roll": self.camera_roll,
                "vertical_fov": self.vertical_fov,
                **self._headings(),
            },
            "evidence": list(self.evidence),
            "warnings": list(self.warnings),
            **self._place(),
        }

    def _headings(self) -> dict[str, Any]:
        known = {name: getattr(self, attribute) for name, attribute in _HEADINGS.items()}
        said = {name: value for name, value in known.items() if value is not None}
        if self.camera_heading_probability:
            said["heading_probability"] = list(self.camera_heading_probability)
        return said

    def _place(self) -> dict[str, Any]:
        if self.latitude is None and self.longitude is None:
            return {}
        return {"place": {"latitude": self.latitude, "longitude": self.longitude}}

    @classmethod
    def from_dict(cls, record: Mapping[str, Any]) -> "Lighting":
        """The record that `to_dict` wrote; what may be absent takes its default, derived values are recomputed.

        Raises ParameterError, naming the field, for one that is missing, of the wrong type or out of range.
        """
        sun, sky = _section(record, "sun", required=True), _section(record, "sky", required=True)
        camera, model, place = (_section(record, name) for name in ("camera", "model", "place"))
        if sky.get("model", SKY_MODEL) != SKY_MODEL:
            raise ParameterError(f"sky.model is {reprlib.repr(sky['model'])}; only {SKY_MODEL!r} is known.")
        given: dict[str, Any] = {
            "sun_azimuth": sun.get("azimuth"),
            "sun_elevation": sun.get("elevation"),
            "sun_visibility": sun.get("visibility"),
            "radius_50": sun.get("radius_50"),
            "radius_90": sun.get("radius_90"),
            "turbidity": sky.get("turbidity"),
            "ground_albedo": sky.get("ground_albedo"),
            "exposure": sky.get("exposure"),
            "camera_elevation": camera.get("elevation"),
            "camera_roll": camera.get("roll"),
            "vertical_fov": camera.get("vertical_fov"),
            **{attribute: camera.get(name) for name, attribute in _HEADINGS.items()},
            "camera_heading_probability": _numbers(camera, "heading_probability"),
            "latitude": place.get("latitude"),
            "longitude": place.get("longitude"),
            "evidence": _texts(record, "evidence"),
            "warnings": _texts(record, "warnings"),
        }
        for name in ("sun_azimuth", "sun_elevation", "turbidity", "exposure"):
            if given[name] is None:
                raise ParameterError(f"The lighting record lacks {name}.")
        present = {name: value for name, value in given.items() if value is not None}
        for name in ("name", "version"):
            if not isinstance(model.get(name, ""), str):
                raise ParameterError(f"model.{name} must be a text, not {reprlib.repr(model[name])}.")
        return cls(**present, model_name=model.get("name", "none"), model_version=model.get("version", "0"))


_HEADINGS = {  # names inside the record's `camera`
    "heading": "camera_heading",
    "heading_radius_50": "camera_heading_radius_50",
    "heading_radius_90": "camera_heading_radius_90",
    "relative_heading": "relative_heading",
}


def _texts(record: Mapping[str, Any], name: str) -> tuple[str, ...]:
    texts = () if record.get(name) is None else record[name]
    if not isinstance(texts, list | tuple) or not all(isinstance(text, str) for text in texts):
        raise ParameterError(f"{name} must be a list of texts, not {reprlib.repr(texts)}.")
    return tuple(texts)


def _numbers(section: Mapping[str, Any], name: str) -> tuple[float, ...]:
    numbers = () if section.get(name) is None else section[name]
    if not isinstance(numbers, list | tuple):
        raise ParameterError(f"{name} must be a list of numbers, not {reprlib.repr(numbers)}.")
    return tuple(numbers)


def _check_headings(probability: tuple[float, ...]) -> None:
    if probability and len(probability) != 360:
        raise ParameterError(f"camera_heading_probability has {len(probability)} values; it must have 360.")
    for value in probability:
        check_range("camera_heading_probability", value, 0.0, 1.0)


def check_range(name: str, value: object, low: float, high: float) -> None:
    """Raise a one-sentence ParameterError unless `value` is a finite number in [low, high]."""
    if not _is_finite(value):
        raise ParameterError(f"{name} must be a finite number, not {reprlib.repr(value)}.")
    if not low <= float(value) <= high:
        raise ParameterError(f"{name} is {float(value):g}; it must lie in {low:g} to {high:g}.")


def _is_finite(value: object) -> TypeGuard[int | float]:
    """Whether it is a number (a bool is not) that a float can hold."""
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # an integer of hundreds of digits
        return False


def _check_spec(name: str, fits: bool) -> None:
    if not fits:
        raise ModelError(f"The model's metadata does not describe its input: {name} is not as it should be.")


def _section(record: Mapping[str, Any], name: str, *, required: bool = False) -> Mapping[str, Any]:
    section = record.get(name) if isinstance(record, Mapping) else None
    if section is None and not required:
        return {}
    if not isinstance(section, Mapping):
        raise ParameterError(f"The lighting record needs an object {name!r}.")
    return section


def sun_of(prediction: Prediction) -> Sun:
    """Where the pixels alone put the sun."""
    grid = prediction.spec.sun_grid
    sun = best_guess(prediction.sun_probability, grid)
    azimuth, elevation = angles(sun)
    radius_50, radius_90 = radii(prediction.sun_probability, grid_directions(grid), sun)
    return Sun(float(azimuth), float(elevation), radius_50, radius_90)


def lighting_from(prediction: Prediction, sun: Sun | None = None) -> Lighting:
    """What the user gets of what the network said: every value inside its range.

    The sun is where the pixels put it unless something else is known, see fusion.py.
    """
    where = sun or sun_of(prediction)
    values = {
        "sun_azimuth": where.azimuth,
        "sun_elevation": where.elevation,
        "sun_visibility": prediction.sun_visibility,
        "radius_50": where.radius_50,
        "radius_90": where.radius_90,
        "turbidity": prediction.turbidity,
        "exposure": prediction.exposure,
        "camera_elevation": prediction.camera_elevation,
        "camera_roll": prediction.camera_roll,
        "vertical_fov": prediction.vertical_fov,
    }
    inside: dict[str, Any] = {
        name: _significant(float(np.clip(value, *RANGES[name]))) for name, value in values.items()
    }
    spec = prediction.spec
    return Lighting(**inside, model_name=spec.name, model_version=spec.version, evidence=("pixels",))


def _significant(value: float, digits: int = 6) -> float:
    return float(f"{value:.{digits}g}")
