"""How the JSON record of a light groups its fields."""

import reprlib
from collections.abc import Mapping
from typing import Any

from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import Floats
from lighting.ranges import COLOUR_RANGES, OPTIONAL_RANGES, RANGES, RECORD_PATHS


def _sections() -> dict[str, dict[str, str]]:
    """The groups of the JSON record that hold plain numbers: each name in it, and the attribute that it holds."""
    groups: dict[str, dict[str, str]] = {}
    for attribute, path in RECORD_PATHS.items():
        if attribute in RANGES or attribute in OPTIONAL_RANGES:
            group, name = path.split(".")
            groups.setdefault(group, {})[name] = attribute
    return groups


_SECTIONS = _sections()
_COLOURS = {RECORD_PATHS[attribute]: attribute for attribute in COLOUR_RANGES}


def record_of(values: Mapping[str, Any], sun_direction: Floats) -> dict[str, Any]:
    """The JSON record of the fields of a Lighting, with `sun.direction` and without what is unknown."""
    record: dict[str, Any] = {"model": {"name": values["model_name"], "version": values["model_version"]}}
    for section, names in _SECTIONS.items():
        found = {name: values[attribute] for name, attribute in names.items()}
        record[section] = {name: value for name, value in found.items() if value is not None}
    record["sun"]["direction"] = [round(float(v), 6) for v in sun_direction]
    for path, attribute in _COLOURS.items():
        if (colour := values[attribute]) is not None:
            section, name = path.split(".")
            record.setdefault(section, {})[name] = list(colour)
    record["sky"]["model"] = values["sky_model"]
    if values["suitable"] is not None:
        record["suitable"] = values["suitable"]
    if values["camera_heading_probability"]:
        record["camera"]["heading_probability"] = list(values["camera_heading_probability"])
    if not record["place"]:
        del record["place"]
    return record | {"evidence": list(values["evidence"]), "warnings": list(values["warnings"])}


def values_in(record: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of a Lighting that a record holds; ParameterError for one that is missing or of the wrong type.

    The error's field is the path in the record.
    """
    if not isinstance(record, Mapping):
        raise ParameterError(
            f"A lighting record must be an object, not {reprlib.repr(record)}.", code=ErrorCode.WRONG_TYPE
        )
    names = (*_SECTIONS, "model", "ground")
    found = {name: _section(record, name, required=name in ("sun", "sky")) for name in names}
    values = {
        attribute: found[section].get(name) for section, names in _SECTIONS.items() for name, attribute in names.items()
    }
    for name in ("sun_azimuth", "sun_elevation", "turbidity", "exposure"):
        if values[name] is None:
            path = RECORD_PATHS[name]
            raise ParameterError(f"The lighting record lacks {path}.", path, ErrorCode.MISSING)
    values |= {f"model_{name}": found["model"].get(name) for name in ("name", "version")}
    values |= {name: record.get(name) for name in ("evidence", "warnings", "suitable")}
    values["camera_heading_probability"] = _numbers(
        found["camera"], "heading_probability", "camera.heading_probability"
    )
    for path, attribute in _COLOURS.items():
        section, name = path.split(".")
        values[attribute] = _numbers(found[section], name, path) or None
    values["sky_model"] = found["sky"].get("model")
    return {name: value for name, value in values.items() if value is not None}


def _numbers(section: Mapping[str, Any], name: str, path: str) -> tuple[float, ...]:
    numbers = () if section.get(name) is None else section[name]
    if not isinstance(numbers, list | tuple):
        predicate = f"must be a list of numbers, not {reprlib.repr(numbers)}."
        raise ParameterError.about(path, predicate, ErrorCode.WRONG_TYPE)
    return tuple(numbers)


def _section(record: Mapping[str, Any], name: str, *, required: bool = False) -> Mapping[str, Any]:
    section = record.get(name)
    if section is None and not required:
        return {}
    if not isinstance(section, Mapping):
        code = ErrorCode.MISSING if section is None else ErrorCode.WRONG_TYPE
        raise ParameterError(f"The lighting record needs an object {name!r}.", name, code)
    return section
