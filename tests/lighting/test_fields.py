"""Fields of records: their docstrings, ranges and values in words."""

import ast
import pydoc
import re
from dataclasses import fields

import pytest

import lighting
from lighting.fields import COLOR_RANGES, OPTIONAL_RANGES, RANGES, describe_fields, field_docstrings
from lighting.formatting import format_azimuth, format_side, format_sun_elevation, format_tilt
from lighting.map_options import Adjustments
from lighting.photo.metadata import PhotoMetadata
from lighting.photo.reader import Photo, PhotoCrop, PhotoOrigin
from lighting.prediction import EstimatedLight, Light, ModelSpec, Prediction, SunDistribution, SunEstimate
from lighting.records import Lighting, LightProbe, MainLight
from lighting.scene.records import CameraMotion, Scene
from tests.helpers.pages import ROOT

RECORDS: list[type] = [
    *(
        lighting.Estimate,
        lighting.UserInput,
        EstimatedLight,
        Light,
        Lighting,
        ModelSpec,
        Prediction,
        SunDistribution,
        SunEstimate,
    ),
    *(Photo, PhotoCrop, PhotoMetadata, PhotoOrigin, Scene, CameraMotion),
    *(Adjustments, LightProbe, MainLight),
]
NUMBERS = re.compile(r"float|int|Floats|NDArray|Color")  # types of fields that hold numbers
UNITS = re.compile(r"\d|\b(deg|pixels|bytes|meters|mm|hours|hz|ev)\b", re.IGNORECASE)


def annotation(record: type, name: str) -> str:
    return str(next(field.type for field in fields(record) if field.name == name))


@pytest.mark.parametrize("record", RECORDS)
def test_every_field_has_a_docstring_with_unit_or_range(record: type) -> None:
    told = field_docstrings(record)
    assert list(told) == [field.name for field in fields(record)]
    for name, text in told.items():
        assert text[0].isupper() or text[0] in "(01", name
        assert text.endswith("."), name
        if NUMBERS.search(annotation(record, name)):
            assert UNITS.search(text), name


def test_the_ranges_of_a_light_are_those_that_are_checked() -> None:
    told = field_docstrings(Lighting)
    for name, (low, high) in (RANGES | OPTIONAL_RANGES | COLOR_RANGES).items():
        numbers = f"{format_number(low)} to {format_number(high)}"
        assert numbers in told[name], name


def format_number(value: float) -> str:
    """A limit as prose has it: 0.1, 20,000, 1e6."""
    return f"{value:,.0f}" if 1000 <= value < 1e6 else f"{value:g}".replace("e-0", "e-").replace("e+0", "e")


def is_record(node: ast.stmt) -> bool:
    """Whether a statement defines a public dataclass."""
    if not isinstance(node, ast.ClassDef) or node.name.startswith("_"):
        return False
    return any("dataclass" in ast.unparse(decorator) for decorator in node.decorator_list)


def undocumented_fields(definition: ast.stmt) -> list[str]:
    body = getattr(definition, "body", [])
    return [
        ast.unparse(statement.target)
        for statement, below in zip(body, [*body[1:], None], strict=True)
        if isinstance(statement, ast.AnnAssign) and not ast.unparse(statement.target).startswith("_")
        if not (isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant))
    ]


def test_no_field_of_a_public_record_lacks_a_docstring() -> None:
    """Also of those that no user meets."""
    missing = {
        f"{path.relative_to(ROOT)}:{getattr(node, 'name', '')}": names
        for path in sorted((ROOT / "lighting").rglob("*.py"))
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if is_record(node) and (names := undocumented_fields(node))
    }
    assert missing == {}


@pytest.mark.parametrize("record", RECORDS)
def test_help_lists_the_fields(record: type) -> None:
    text = pydoc.plain(pydoc.render_doc(record))
    for name, line in field_docstrings(record).items():
        assert f"{name}: {line.splitlines()[0]}" in text


def test_a_record_without_its_source_keeps_its_sentence() -> None:
    namespace: dict[str, type] = {}
    exec('from dataclasses import dataclass\n@dataclass\nclass Made:\n    """One."""\n    x: int\n', namespace)
    made = namespace["Made"]
    describe_fields(made)
    assert made.__doc__ == "One."
    assert field_docstrings(made) == {}


@pytest.mark.parametrize(
    ("azimuth", "digits", "words"),
    [
        (-41.2, 0, "41° left"),
        (33.04, 1, "33.0° right"),
        (0.3, 0, "straight ahead"),
        (0.3, 1, "0.3° right"),
        (-0.04, 1, "straight ahead"),
        (179.8, 0, "straight behind"),
        (-179.8, 1, "179.8° left (behind)"),
        (90.0, 0, "90° right"),
        (120.0, 0, "120° right (behind)"),
    ],
)
def test_an_azimuth_is_told_by_its_side(azimuth: float, digits: int, words: str) -> None:
    assert format_azimuth(azimuth, digits) == words


def test_the_side_of_anything_is_told_without_what_lies_behind() -> None:
    assert (format_side(-170.0), format_side(0.0, 1)) == ("170° left", "0.0° right")


@pytest.mark.parametrize(
    ("elevation", "digits", "words"),
    [(-7.31, 1, "7.3° down"), (-0.04, 1, "0.0° up"), (-0.4, 0, "0° up"), (4.1, 0, "4° up")],
)
def test_a_tilt_is_told_by_its_direction(elevation: float, digits: int, words: str) -> None:
    assert format_tilt(elevation, digits) == words


def test_a_sun_stands_high_or_below_the_horizon() -> None:
    assert format_sun_elevation(33.4) == "33° high"
    assert format_sun_elevation(-0.04, 1) == "0.0° high"
    assert format_sun_elevation(-3.14, 1) == "3.1° below the horizon"
