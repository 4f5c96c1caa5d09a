"""The records that travel through the pipeline: ModelSpec, Prediction, Lighting, Estimate.

Names and units are the same in Python, HTTP parameters of a sky, EXR attributes and columns of tables;
JSON groups them.
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
from lighting.geometry import Floats, direction
from lighting.sky import MODELS

SKY_MODEL = "hosek-wilkie"
MIN_HEIGHT, MAX_HEIGHT = 16, 4096  # rows of an environment map
EVIDENCE = ("pixels", "time+place", "heading", "focal length", "gravity", "turns", "other photos")
GROUND_ALBEDO = 0.3  # the sky fits of the training data assume it too
SUITABLE = 0.5  # `suitable` below it earns a warning
GROUND_REFLECTANCE = 0.12  # of ground that a photo does not show: about the median under overcast HDR panoramas

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
    "sky_cover": (0.0, 1.0),  # 0 clear, 1 overcast; goes with sky_irradiance
    "suitable": (0.0, 1.0),  # probability that this is an ordinary photo of outdoors by daylight
}

COLOUR_RANGES: dict[str, tuple[float, float]] = {  # red, green and blue, not always known
    "sun_irradiance": (0.0, 1e6),  # of a surface that faces the sun, in the photo's linear units
    "sky_irradiance": (0.0, 1e6),  # of open level ground by the sky without the sun, in the same units
    "ground_color": (0.0, 1.0),  # reflectance of the ground
}

Colour = tuple[float, float, float]  # linear Rec.709
AROUND_SHAPE = (12, 24, 3)  # rows from zenith to nadir, columns of azimuth with 0 in the middle, RGB


@dataclass(frozen=True)
class ModelSpec:
    """A network's input, output layout and licence; stored as JSON in the ONNX file's metadata."""

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
        return spec


@dataclass(frozen=True, eq=False)
class Light:
    """What a network says of the light's strength; in the photo's linear units (sRGB decoded, 1 = white)."""

    sun_irradiance: Floats  # (3,) of a surface that faces the sun
    sky_irradiance: Floats  # (3,) of a level surface by the sky without the sun
    cover: float  # 0 clear to 1 overcast
    suitable: float  # probability, 0 to 1, that this is an ordinary photo of outdoors by daylight
    around: NDArray[np.float32] | None = None  # AROUND_SHAPE, radiance all around the camera without the sun


@dataclass(frozen=True)
class Prediction:
    """The network's output for one photo."""

    spec: ModelSpec
    sun_probability: NDArray[np.float32]  # (N,) over the cells of spec.sun_grid, sums to 1
    sun_visibility: float
    turbidity: float
    exposure: float
    camera_elevation: float
    camera_roll: float
    vertical_fov: float
    light: Light | None = None  # of networks that say it


@dataclass(frozen=True)
class SunEstimate:
    """The sun's direction and radii by a distribution; units as in RANGES."""

    azimuth: float
    elevation: float
    radius_50: float
    radius_90: float


@dataclass(frozen=True)
class Lighting:
    """The light of one photo and the camera that took it; units and ranges in RANGES. ParameterError for any other."""

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
    evidence: tuple[str, ...] = ()  # of EVIDENCE
    warnings: tuple[str, ...] = ()  # sentences, above all about evidence that contradicts the pixels
    camera_heading: float | None = None
    camera_heading_radius_50: float | None = None
    camera_heading_radius_90: float | None = None
    camera_heading_probability: tuple[float, ...] = ()  # of each of 360 whole degrees, if the heading is known
    relative_heading: float | None = None
    latitude: float | None = field(default=None, repr=False)
    longitude: float | None = field(default=None, repr=False)
    sky_model: str = SKY_MODEL  # of MODELS: the shape of the sky
    sun_irradiance: Colour | None = None  # with sky_irradiance: maps then have these irradiances
    sky_irradiance: Colour | None = None
    sky_cover: float | None = None
    ground_color: Colour | None = None
    suitable: float | None = None

    def __post_init__(self) -> None:
        plain_numbers(self, *RANGES, *OPTIONAL_RANGES, *COLOUR_RANGES, "camera_heading_probability")
        for name, (low, high) in RANGES.items():
            check_range(name, getattr(self, name), low, high)
        for name, (low, high) in OPTIONAL_RANGES.items():
            if getattr(self, name) is not None:
                check_range(name, getattr(self, name), low, high)
        for name, limits in COLOUR_RANGES.items():
            _check_colour(name, getattr(self, name), limits)
        _check_headings(self.camera_heading_probability)
        if self.sky_model not in MODELS:
            known = ", ".join(name for name in MODELS if not name[-1].isdigit())
            raise ParameterError(
                f"sky.model is {reprlib.repr(self.sky_model)}; the known ones are {known}, cie-1 to cie-15."
            )
        if (self.sun_irradiance is None) != (self.sky_irradiance is None):
            raise ParameterError("sun.irradiance and sky.irradiance go together; the record has only one of them.")
        if self.sky_cover is not None and self.sky_irradiance is None:
            raise ParameterError("sky.cover needs sky.irradiance and sun.irradiance beside it.")

    @property
    def sun_painted(self) -> bool:
        """Whether maps hold the sun unless asked otherwise: where its irradiance is given, it fades by itself."""
        return self.sun_shines or self.sun_irradiance is not None

    @property
    def sun_shines(self) -> bool:
        """Whether direct sunlight has a probability of at least one half."""
        return self.sun_visibility >= 0.5

    @property
    def sun_direction(self) -> Floats:
        """Unit vector (3,) towards the sun, in the frame of geometry.py."""
        return direction(self.sun_azimuth, self.sun_elevation)

    def to_dict(self) -> dict[str, Any]:
        """The JSON record. It adds `sun.direction` and omits what is unknown."""
        record: dict[str, Any] = {"model": {"name": self.model_name, "version": self.model_version}}
        for section, names in _SECTIONS.items():
            values = {name: getattr(self, attribute) for name, attribute in names.items()}
            record[section] = {name: value for name, value in values.items() if value not in (None, ())}
        record["sun"]["direction"] = [round(float(v), 6) for v in self.sun_direction]
        for section, attribute in _COLOURS.items():
            if (colour := getattr(self, attribute)) is not None:
                record.setdefault(section.split(".")[0], {})[section.split(".")[1]] = list(colour)
        record["sky"]["model"] = self.sky_model
        if self.suitable is not None:
            record["suitable"] = self.suitable
        if self.camera_heading_probability:
            record["camera"]["heading_probability"] = list(self.camera_heading_probability)
        if not record["place"]:
            del record["place"]
        return record | {"evidence": list(self.evidence), "warnings": list(self.warnings)}

    @classmethod
    def from_dict(cls, record: Mapping[str, Any]) -> "Lighting":
        """The Lighting in a record of `to_dict`; absent optional fields take defaults, derived values are ignored.

        Raises ParameterError, which names the field that is missing, of the wrong type or out of range.
        """
        names = (*_SECTIONS, "model", "ground")
        found = {name: _section(record, name, required=name in ("sun", "sky")) for name in names}
        values = {
            attribute: found[section].get(name)
            for section, names in _SECTIONS.items()
            for name, attribute in names.items()
        }
        for name in ("sun_azimuth", "sun_elevation", "turbidity", "exposure"):
            if values[name] is None:
                raise ParameterError(f"The lighting record lacks {name}.")
        values |= {f"model_{name}": _text(found["model"], name) for name in ("name", "version")}
        values |= {name: _texts(record, name) for name in ("evidence", "warnings")}
        values["camera_heading_probability"] = _numbers(
            found["camera"], "heading_probability", "camera.heading_probability"
        )
        for path, attribute in _COLOURS.items():
            section, name = path.split(".")
            values[attribute] = _numbers(found[section], name, path) or None
        values |= {"sky_model": found["sky"].get("model"), "suitable": record.get("suitable")}
        return cls(**{name: value for name, value in values.items() if value is not None})


_SECTIONS = {  # the groups of the JSON record: each name in it, and the attribute that it holds
    "sun": {
        "azimuth": "sun_azimuth",
        "elevation": "sun_elevation",
        "visibility": "sun_visibility",
        "radius_50": "radius_50",
        "radius_90": "radius_90",
    },
    "sky": {
        "turbidity": "turbidity",
        "ground_albedo": "ground_albedo",
        "exposure": "exposure",
        "cover": "sky_cover",
    },
    "camera": {
        "elevation": "camera_elevation",
        "roll": "camera_roll",
        "vertical_fov": "vertical_fov",
        "heading": "camera_heading",
        "heading_radius_50": "camera_heading_radius_50",
        "heading_radius_90": "camera_heading_radius_90",
        "relative_heading": "relative_heading",
    },
    "place": {"latitude": "latitude", "longitude": "longitude"},
}
_COLOURS = {  # where the JSON record has them
    "sun.irradiance": "sun_irradiance",
    "sky.irradiance": "sky_irradiance",
    "ground.color": "ground_color",
}


@dataclass(frozen=True, eq=False)
class SunDistribution:
    """Where the sun may be: a probability for each cell of a grid over the upper hemisphere."""

    grid: str  # layout name, see sun_grid.py
    probability: NDArray[np.float32] = field(repr=False)  # (N,) over the grid's cells, sums to 1


@dataclass(frozen=True, eq=False)
class Estimate:
    """The answer about one photo: its light, and where else the sun may be."""

    lighting: Lighting
    distribution: SunDistribution  # with all evidence counted
    around: NDArray[np.float32] | None = field(default=None, repr=False)  # AROUND_SHAPE, radiance without the sun

    @property
    def evidence(self) -> tuple[str, ...]:
        """What the answer rests on, of EVIDENCE."""
        return self.lighting.evidence

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences for people, above all about evidence that contradicts the pixels."""
        return self.lighting.warnings


def _text(section: Mapping[str, Any], name: str) -> str | None:
    if not isinstance(section.get(name, ""), str):
        raise ParameterError(f"model.{name} must be a text, not {reprlib.repr(section[name])}.")
    return section.get(name)


def _texts(record: Mapping[str, Any], name: str) -> tuple[str, ...]:
    texts = () if record.get(name) is None else record[name]
    if not isinstance(texts, list | tuple) or not all(isinstance(text, str) for text in texts):
        raise ParameterError(f"{name} must be a list of texts, not {reprlib.repr(texts)}.")
    return tuple(texts)


def _numbers(section: Mapping[str, Any], name: str, path: str) -> tuple[float, ...]:
    numbers = () if section.get(name) is None else section[name]
    if not isinstance(numbers, list | tuple):
        raise ParameterError(f"{path} must be a list of numbers, not {reprlib.repr(numbers)}.")
    return tuple(numbers)


def _check_headings(probability: tuple[float, ...]) -> None:
    if probability and len(probability) != 360:
        raise ParameterError(f"camera_heading_probability has {len(probability)} values; it must have 360.")
    for value in probability:
        check_range("camera_heading_probability", value, 0.0, 1.0)


def _check_colour(name: str, colour: object, limits: tuple[float, float]) -> None:
    if colour is None:
        return
    if not isinstance(colour, tuple) or len(colour) != 3:
        raise ParameterError(f"{name} must be three numbers: red, green and blue.")
    for value in colour:
        check_range(name, value, *limits)


def check_range(name: str, value: object, low: float, high: float, field: str | None = None) -> None:
    """Raise a one-sentence ParameterError unless `value` is a finite number in [low, high]; `field` is the error's."""
    if not _is_finite(value):
        raise ParameterError(f"{name} must be a finite number, not {reprlib.repr(value)}.", field)
    if not low <= float(value) <= high:
        raise ParameterError(f"{name} is {float(value):g}; it must lie in {low:g} to {high:g}.", field)


def check_place(latitude: float | None, longitude: float | None) -> None:
    """Raise a one-sentence ParameterError where only one of them is known."""
    if (latitude is None) != (longitude is None):
        missing = "latitude" if latitude is None else "longitude"
        raise ParameterError("A latitude needs a longitude and the other way round.", missing)


def plain_numbers(record: object, *names: str) -> None:
    """Turn numpy's numbers in these fields of a frozen record into Python's, in tuples too."""
    for name in names:
        value = getattr(record, name)
        if isinstance(value, np.generic):
            object.__setattr__(record, name, value.item())
        elif isinstance(value, list | tuple | np.ndarray):
            object.__setattr__(record, name, tuple(v.item() if isinstance(v, np.generic) else v for v in value))


def _is_finite(value: object) -> TypeGuard[int | float]:
    """Whether the value is a finite number that a float can hold; a bool is not a number."""
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
