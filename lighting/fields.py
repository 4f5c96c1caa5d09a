"""The fields of records: ranges and units of a light's, checks against them, values clipped to them, JSON, words.

Names and units are the same in Python, HTTP parameters of a sky, EXR attributes and columns of tables. JSON groups them
(_RECORD_PATHS). Some have other names where people type them (_SHORT_NAMES). Python itself keeps the docstrings of
fields nowhere; `describe_fields` gives them to `help`.
"""

import math
import reprlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, fields, is_dataclass
from datetime import UTC, datetime
from enum import Enum
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeGuard, cast

from lighting.errors import ErrorCode, ParameterError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Json = dict[str, Any]  # an object of JSON, as it is read or written

RANGES: dict[str, tuple[float, float]] = {
    "sun_azimuth": (-180.0, 180.0),  # deg, 0 = where the camera points, positive to the right
    "sun_elevation": (-4.2, 90.0),  # deg above the horizon; below it as far as the Prague sky reaches
    "sun_visibility": (0.0, 1.0),  # probability that direct sunlight reaches the scene
    "radius_50": (0.0, 180.0),  # deg around the sun's direction that hold 50 % of the probability
    "radius_90": (0.0, 180.0),  # the same for 90 %
    "turbidity": (1.0, 10.0),  # Linke, as Hosek-Wilkie uses it
    "ground_albedo": (0.0, 1.0),
    "exposure": (1e-6, 1e6),  # photo's linear values / sky radiance
    "camera_elevation": (-90.0, 90.0),  # deg, positive looks up
    "camera_roll": (-180.0, 180.0),  # deg, positive turns the camera clockwise
    "vertical_fov": (1.0, 170.0),  # deg
    "camera_height": (0.1, 20000.0),  # m above the ground; 1.6 where nothing tells it
}

OPTIONAL_RANGES: dict[str, tuple[float, float]] = {  # what is not always known
    "camera_heading": (0.0, 360.0),  # deg clockwise from true north, where azimuth 0 points
    "camera_heading_radius_50": (0.0, 180.0),  # deg to either side of it that hold 50 % of its probability
    "camera_heading_radius_90": (0.0, 180.0),  # the same for 90 %
    "relative_heading": (0.0, 360.0),  # deg clockwise from the first of several photos
    "latitude": (-90.0, 90.0),  # deg, positive north; only where the user asked for it
    "longitude": (-180.0, 180.0),  # deg, positive east
    "utc_offset": (-12.0, 14.0),  # h, local minus universal time
    "sky_cover": (0.0, 1.0),  # 0 clear, 1 overcast; goes with sky_irradiance
    "suitable": (0.0, 1.0),  # probability that this is an ordinary photo of outdoors by daylight
    "ground_visible": (0.0, 1.0),  # share of the picture that shows firm, level ground near by
}

COLOR_RANGES: dict[str, tuple[float, float]] = {  # red, green and blue, not always known
    "sun_irradiance": (0.0, 1e6),  # of a surface that faces the sun, in the photo's linear units
    "sky_irradiance": (0.0, 1e6),  # of open level ground by the sky without the sun, in the same units
    "ground_color": (0.0, 1.0),  # reflectance of the ground
}

PLAIN_RANGES = RANGES | OPTIONAL_RANGES  # of plain numbers
_PLAIN = (int, float, type(None))  # types of Python's own

_RECORD_PATHS: dict[str, str] = {  # where the JSON record has the fields of a Lighting, in its order
    "model_name": "model.name",
    "model_version": "model.version",
    "sun_azimuth": "sun.azimuth",
    "sun_elevation": "sun.elevation",
    "sun_visibility": "sun.visibility",
    "radius_50": "sun.radius_50",
    "radius_90": "sun.radius_90",
    "sun_direction": "sun.direction",
    "sun_candidates": "sun.candidates",
    "sun_irradiance": "sun.irradiance",
    "turbidity": "sky.turbidity",
    "ground_albedo": "sky.ground_albedo",
    "exposure": "sky.exposure",
    "sky_cover": "sky.cover",
    "sky_irradiance": "sky.irradiance",
    "sky_model": "sky.model",
    "sky_painted": "sky.painted",
    "camera_elevation": "camera.elevation",
    "camera_roll": "camera.roll",
    "vertical_fov": "camera.vertical_fov",
    "camera_height": "camera.height",
    "camera_heading": "camera.heading",
    "camera_heading_radius_50": "camera.heading_radius_50",
    "camera_heading_radius_90": "camera.heading_radius_90",
    "relative_heading": "camera.relative_heading",
    "camera_heading_probability": "camera.heading_probability",
    "latitude": "place.latitude",
    "longitude": "place.longitude",
    "utc_offset": "time.utc_offset",
    "utc_time": "time.utc",
    "time_source": "time.source",
    "ground_visible": "ground.visible",
    "ground_color": "ground.color",
    "spot_pixel": "ground.spot.pixel",
    "spot_direction": "ground.spot.direction",
    **{name: name for name in ("suitable", "trust", "evidence", "warnings")},
}
_SECTIONS = {name: path.split(".") for name, path in _RECORD_PATHS.items()}  # and the name in the last one
_DERIVED = ("sun_direction", "trust")  # by the record from the others
_NEEDED = ("sun_azimuth", "sun_elevation", "turbidity", "exposure")
_LISTS = ("camera_heading_probability", *COLOR_RANGES, "spot_pixel", "spot_direction")  # of numbers

_SHORT_NAMES: dict[str, str] = {  # of the fields that URLs and options call otherwise
    "fov": "lens_fov",
    "shadows": "shadow",
    "verticals": "vertical",
    "first": "date",
    "last": "until",
}


def record_path(field: str) -> str:
    """Return where the JSON record of a light has a field: sun.azimuth.

    Args:
        field: as Python names it.
    """
    return _RECORD_PATHS.get(field, field)


def parameter_name(field: str) -> str:
    """Return what a URL calls a field: metadata.

    Args:
        field: as Python names it.
    """
    return _SHORT_NAMES.get(field, field)


def option_name(field: str) -> str:
    """Return what the command line calls a field: --utc-offset.

    Args:
        field: as Python names it.
    """
    return "--" + parameter_name(field).replace("_", "-")


def is_finite(value: object) -> TypeGuard[int | float]:
    """Tell whether a value is a finite number.

    Args:
        value: any.
    """
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # an integer of hundreds of digits
        return False


def check_range(field: str, value: object, low: float, high: float, subject: str | None = None) -> None:
    """Raise a one-sentence ParameterError unless a field's value is a finite number in [low, high].

    Args:
        field: as Python names it.
        value: of the field.
        low: least allowed value, in the field's unit.
        high: largest allowed value, in the field's unit.
        subject: how the sentence begins; None is with the field's name.
    """
    if not is_finite(value):
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        predicate = f"must be a finite number, not {reprlib.repr(value)}."
        code = ErrorCode.OUT_OF_RANGE if is_number else ErrorCode.WRONG_TYPE
    elif not low <= float(value) <= high:
        predicate, code = f"is {float(value):g}; it must lie in {low:g} to {high:g}.", ErrorCode.OUT_OF_RANGE
    else:
        return
    if subject is not None:
        raise ParameterError(f"{subject} {predicate}", field, code)
    raise ParameterError.about(field, predicate, code)


def check_location(latitude: float | None, longitude: float | None) -> None:
    """Raise a one-sentence ParameterError where only one of the two is known.

    Args:
        latitude: deg, positive north; None where unknown.
        longitude: deg, positive east; None where unknown.
    """
    if (latitude is None) != (longitude is None):
        missing = "latitude" if latitude is None else "longitude"
        raise ParameterError(f"Latitude and longitude go together; {missing} is missing.", missing, ErrorCode.MISSING)


def round_significant(value: float) -> float:
    """Round a value to six significant digits, as records hold it.

    Args:
        value: finite.
    """
    return float(f"{value:.6g}")


def round_all(values: "ArrayLike") -> list[float]:
    """Round all values of an array, one after the other, as `round_significant` does; there is no -0.

    Args:
        values: finite.
    """
    import numpy as np

    return [round_significant(value) for value in (np.ravel(values) + 0.0).tolist()]


def clip_to_range(name: str, value: float) -> float:
    """Clip a value to the range that RANGES has for a field, and round it as records hold it.

    Args:
        name: field of a Lighting in RANGES.
        value: in the field's unit.
    """
    low, high = RANGES[name]
    return round_significant(min(max(float(value), low), high))


def clip_color(values: "ArrayLike", name: str) -> tuple[float, float, float]:
    """Clip a color to the range that COLOR_RANGES has for a field, and round it as records hold it.

    Args:
        values: (3,) red, green and blue.
        name: field of a Lighting in COLOR_RANGES.
    """
    import numpy as np

    red, green, blue = (round_significant(float(v)) for v in np.clip(values, *COLOR_RANGES[name]))
    return red, green, blue


def convert_numpy_numbers(record: object, *names: str) -> None:
    """Turn numpy's numbers in fields of a frozen record into Python's, in tuples and arrays without axes too.

    Args:
        record: an instance of a frozen dataclass.
        names: its fields.
    """
    for name in names:
        value = getattr(record, name)
        if type(value) in _PLAIN or (type(value) is tuple and all(type(part) in _PLAIN for part in value)):
            continue
        import numpy as np  # 100 ms, which the command line's help is spared

        if isinstance(value, np.generic | np.ndarray) and value.ndim == 0:
            object.__setattr__(record, name, value.item())
        elif isinstance(value, list | tuple | np.ndarray):
            object.__setattr__(record, name, tuple(v.item() if isinstance(v, np.generic) else v for v in value))


class _RecordDoc:
    """A class's `__doc__` that lists the fields; the source is read when somebody asks for it."""

    def __init__(self, summary: str) -> None:
        self._summary, self._text = summary, ""

    def __get__(self, _instance: object, owner: type) -> str:
        from inspect import cleandoc

        if not self._text:
            lines = [f"    {name}: {text}" for name, text in field_docstrings(owner).items()]
            self._text = "\n".join([cleandoc(self._summary), *(["", "Fields:", *lines] if lines else [])])
        return self._text


def describe_fields(*records: type) -> None:
    """Let `help` list the fields of dataclasses with their docstrings; a module calls it below its last one.

    Args:
        records: dataclasses.
    """
    for record in records:
        record.__doc__ = _RecordDoc(record.__doc__ or "")  # type: ignore[assignment]  # Python asks it, as any descriptor


def field_docstrings(record: type) -> dict[str, str]:
    """Return the docstrings of a record's fields, by name, those of its bases too; none where there is no source.

    Args:
        record: a dataclass, or an enumeration, whose members count.
    """
    found: dict[str, str] = {}
    for owner in reversed(record.__mro__):
        found |= _own_docstrings(owner)
    names = record.__members__ if issubclass(record, Enum) else [field.name for field in fields(cast(Any, record))]
    return {name: found[name] for name in names if name in found}


def _own_docstrings(owner: type) -> dict[str, str]:
    """The docstrings below the names of a class."""
    import ast
    import inspect
    from textwrap import dedent

    try:
        source = inspect.getsource(owner)
    except (OSError, TypeError):  # of a class that C defines, or a program without its sources
        return {}
    (definition,) = ast.parse(dedent(source)).body
    body = definition.body if isinstance(definition, ast.ClassDef) else []
    found: dict[str, str] = {}
    for statement, below in pairwise(body):
        match statement, below:
            case ((ast.AnnAssign(ast.Name(name)) | ast.Assign([ast.Name(name)])), ast.Expr(ast.Constant(str(text)))):
                found[name] = inspect.cleandoc(text)
    return found


# JSON in and out.


def nest_fields(values: Json) -> Json:
    """Return the JSON record of the fields of a Lighting and what it derives, without what is unknown.

    Args:
        values: of the fields, by name; `sun_direction` and `trust` too.
    """
    record: Json = {}
    for attribute, (*sections, name) in _SECTIONS.items():
        value = values[attribute]
        if value is None or (value == () and attribute not in ("evidence", "warnings")):
            continue
        group = record
        for section in sections:
            group = group.setdefault(section, {})
        group[name] = _as_json(value)
    if values["ground_visible"] is not None:
        record["ground"].setdefault("spot", None)  # it was sought, and there is none
    return record


def _as_json(value: Any) -> Any:
    if isinstance(value, tuple):
        return [asdict(part) if is_dataclass(part) and not isinstance(part, type) else part for part in value]
    return value.astimezone(UTC).isoformat().replace("+00:00", "Z") if isinstance(value, datetime) else value


def flatten_record(record: Mapping[str, Any]) -> Json:
    """Return the fields of a Lighting, by name, that a JSON record holds.

    Args:
        record: an object of JSON.

    Raises:
        ParameterError: one is missing or of the wrong type; the error's field is the path in the record.
    """
    if not isinstance(record, Mapping):
        sentence = f"A lighting record must be an object, not {reprlib.repr(record)}."
        raise ParameterError(sentence, code=ErrorCode.WRONG_TYPE)
    values: Json = {}
    for attribute, (*sections, name) in _SECTIONS.items():
        group = record
        for section in sections:
            group = _section(group, section)
        if attribute not in _DERIVED and (value := group.get(name)) is not None:
            values[attribute] = value
    for attribute in _NEEDED:
        if attribute not in values:
            path = _RECORD_PATHS[attribute]
            raise ParameterError(f"The lighting record lacks {path}.", path, ErrorCode.MISSING)
    for attribute in (name for name in _LISTS if name in values):
        if not isinstance(values[attribute], list | tuple):
            raise ParameterError.wrong_type(_RECORD_PATHS[attribute], "a list of numbers", values[attribute])
        values[attribute] = tuple(values[attribute])
    if isinstance(values.get("utc_time"), str):
        with suppress(ValueError):  # a text that is no time is refused later
            values["utc_time"] = datetime.fromisoformat(values["utc_time"])
    return values


def _section(record: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    section = record.get(name)
    if section is None and name not in ("sun", "sky"):
        return {}
    if not isinstance(section, Mapping):
        code = ErrorCode.MISSING if section is None else ErrorCode.WRONG_TYPE
        raise ParameterError(f"The lighting record needs an object {name!r}.", name, code)
    return section
