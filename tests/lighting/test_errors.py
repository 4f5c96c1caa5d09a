"""Errors as sentences, and old names."""

import pickle
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lighting
from lighting import errors
from lighting.envmap.relighting import edit_lighting, rotate_lighting
from lighting.envmap.shadow_mask import ground_shadow_mask
from lighting.envmap.surroundings import PhotoContext, render_view, render_with_surroundings, surroundings_gain
from lighting.errors import (
    _GONE_IN,
    RENAMED,
    ErrorCode,
    LightingError,
    MissingExtraError,
    ParameterError,
    PhotoError,
    PhotoExtraError,
    PhotoTooLargeError,
    describe_error,
    require_extra,
)
from lighting.estimator import Estimator
from lighting.fields import check_range, option_name, record_path
from lighting.files import FileOptions, write_envmap
from lighting.files.exr import write_exr
from lighting.map_options import MapOptions
from lighting.model import Model
from lighting.photo.reader import check_photo, photo_from_array
from lighting.photo.timestamps import parse_time, parse_utc_offset
from lighting.preview.picture import draw_preview_pixels
from lighting.records import Lighting
from lighting.scene.records import make_scene
from lighting.scene.writer import write_scene, zip_scene
from tests.helpers.scenes import estimate, outdoors, photo, plain_scene, small_map

LIGHT = outdoors(30.0, 40.0)
ESTIMATE = estimate(LIGHT)
PIXELS = photo(64, 48)
PLACE = PhotoContext(PIXELS)
MAP = small_map(LIGHT)
WRONG = [
    "x",
    float("nan"),
    [1, 2],
    {},
    b"abc",
    LIGHT.sun_direction,
    object(),
    np.zeros(3),
    np.zeros((4, 4, 3)),
    np.zeros((0, 0, 3), np.uint8),
]
TAKERS: dict[str, Callable[[Any], object]] = {
    "render_with_surroundings: light": lambda thing: render_with_surroundings(thing, PLACE, 16),
    "render_with_surroundings: context": lambda thing: render_with_surroundings(LIGHT, thing, 16),
    "surroundings_gain: context": lambda thing: surroundings_gain(LIGHT, thing),
    "PhotoContext: photo": PhotoContext,
    "MapOptions: height": MapOptions,
    "MapOptions: around": lambda thing: MapOptions(around=thing),
    "MapOptions: adjustments": lambda thing: MapOptions(adjustments=thing),
    "FileOptions: format": FileOptions,
    "FileOptions: colors": lambda thing: FileOptions(colors=thing),
    "FileOptions: compression": lambda thing: FileOptions(compression=thing),
    "ground_shadow_mask: photo": lambda thing: ground_shadow_mask(thing, LIGHT),
    "ground_shadow_mask: light": lambda thing: ground_shadow_mask(PIXELS, thing),
    "turn: light": lambda thing: rotate_lighting(thing, 10.0),
    "turn: yaw": lambda thing: rotate_lighting(LIGHT, thing),
    "change: light": lambda thing: edit_lighting(thing, {"sun_azimuth": 3.0}),
    "draw_preview_pixels: photo": lambda thing: draw_preview_pixels(thing, ESTIMATE, MAP),
    "draw_preview_pixels: estimate": lambda thing: draw_preview_pixels(PIXELS, thing, MAP),
    "draw_preview_pixels: map": lambda thing: draw_preview_pixels(PIXELS, ESTIMATE, thing),
    "read_time: text": parse_time,
    "read_offset: text": parse_utc_offset,
    "make_scene: photo": lambda thing: make_scene(thing, LIGHT, map_height=16),
    "write_scene: scene": lambda thing: write_scene(thing, "usd", "never"),
    "zip_scene: scene": lambda thing: zip_scene(thing, "usd"),
    "Lighting: sky": lambda thing: Lighting(0.0, 30.0, 3.0, 1.0, sky_model=thing),
}


@pytest.mark.parametrize(
    ("error", "sentence"),
    [
        (FileNotFoundError(2, "No such file or directory", "secret/photo.jpg"), "No such file or directory."),
        (OSError("the disk is gone"), "the disk is gone."),
        (PhotoError("The photo is empty."), "The photo is empty."),
    ],
)
def test_a_reason_is_one_sentence_without_the_file(error: Exception, sentence: str) -> None:
    assert describe_error(error) == sentence


@pytest.mark.parametrize("name", TAKERS)
def test_public_functions_refuse_what_they_cannot_take_in_one_sentence(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for thing in WRONG:
        with pytest.raises(LightingError) as caught:
            TAKERS[name](thing)
        assert str(caught.value).endswith(".")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "take",
    [
        lambda: write_exr("never.exr", MAP, LIGHT, "x"),  # type: ignore[arg-type]
        lambda: write_envmap(5, MAP, LIGHT),  # type: ignore[arg-type]
        lambda: write_scene(make_scene(photo_from_array(PIXELS), LIGHT, map_height=16), "usd", 5),  # type: ignore[arg-type]
        lambda: render_view(LIGHT, 16, yaw="x"),  # type: ignore[arg-type]
        lambda: Model.load(5),  # type: ignore[arg-type]
    ],
)
def test_targets_and_options_of_the_wrong_kind_are_refused_in_one_sentence(take: Callable[[], object]) -> None:
    with pytest.raises(LightingError, match=r"\.$") as caught:
        take()
    assert isinstance(caught.value, TypeError)
    assert caught.value.code is ErrorCode.WRONG_TYPE


@pytest.mark.parametrize(
    ("value", "is_type_error"), [("3", True), (None, True), (True, True), (float("nan"), False), (500.0, False)]
)
def test_only_a_value_of_the_wrong_type_is_a_type_error(value: Any, is_type_error: bool) -> None:
    """It is a ParameterError, and so a ValueError, in any case."""
    with pytest.raises(ParameterError) as caught:
        Lighting(0.0, value, 3.0, 1.0)
    assert isinstance(caught.value, TypeError) == is_type_error
    again = caught.value.renamed(record_path).prefixed("a.json")
    assert isinstance(pickle.loads(pickle.dumps(again)), TypeError) == is_type_error
    assert str(again).startswith("a.json: sun.elevation ")


@pytest.mark.parametrize(
    "take",
    [
        lambda: lighting.estimate(5),  # type: ignore[arg-type]
        lambda: lighting.read_photo(5),  # type: ignore[arg-type]
        lambda: Estimator(5),  # type: ignore[arg-type]
        lambda: check_photo("photo.jpg"),
        lambda: photo_from_array(PIXELS.astype(float)),
        lambda: parse_time(5),  # type: ignore[arg-type]
        lambda: lighting.UserInput(latitude=True, longitude=3),
        lambda: lighting.render(ESTIMATE, 16),  # type: ignore[arg-type]
        lambda: lighting.Lighting.from_dict([]),  # type: ignore[arg-type]
        lambda: lighting.read_exr(5),  # type: ignore[arg-type]
        lambda: lighting.write_exr("never.exr", "map", LIGHT),  # type: ignore[arg-type]
        lambda: write_scene(plain_scene(), 5, "never"),  # type: ignore[arg-type]
        lambda: render_view(LIGHT, 16.0),  # type: ignore[arg-type]
    ],
)
def test_python_gets_a_type_error_where_it_has_one(take: Callable[[], object]) -> None:
    with pytest.raises(TypeError, match=r"\.$") as caught:
        take()
    assert isinstance(caught.value, LightingError)


def test_every_error_of_the_package_has_one_base() -> None:
    raised = [value for value in vars(errors).values() if isinstance(value, type) and issubclass(value, Exception)]
    assert len(raised) > 5
    assert all(issubclass(error, LightingError) for error in raised)
    assert issubclass(ParameterError, ValueError)
    assert issubclass(PhotoTooLargeError, PhotoError)


@pytest.mark.parametrize(
    ("name_of", "field"),
    [(str, "latitude"), (option_name, "--latitude"), (record_path, "place.latitude")],
)
def test_each_surface_has_its_own_name_of_a_field(name_of: Callable[[str], str], field: str) -> None:
    with pytest.raises(ParameterError) as caught:
        check_range("latitude", 95.0, -90.0, 90.0)
    error = caught.value.renamed(name_of)
    assert (error.field, error.code) == (field, "out-of-range")
    assert str(error) == f"{field} is 95; it must lie in -90 to 90."
    assert str(error.prefixed("a.json")) == f"a.json: {error}"


def test_a_sentence_that_names_no_field_stays_as_it_is() -> None:
    error = ParameterError("A time needs a place.", "latitude", ErrorCode.MISSING).renamed(option_name)
    assert (str(error), error.field, error.code) == ("A time needs a place.", "--latitude", "missing")
    nobody = ParameterError("Wrong.")
    assert nobody.renamed(option_name) is nobody
    assert (nobody.field, nobody.code) == (None, "failed")


def test_field_and_code_travel_between_processes() -> None:
    error = ParameterError.about("exposure", "is 0.", ErrorCode.OUT_OF_RANGE)
    copy = pickle.loads(pickle.dumps(error))
    assert (str(copy), copy.field, copy.code) == ("exposure is 0.", "exposure", ErrorCode.OUT_OF_RANGE)
    assert str(copy.renamed(record_path)) == "sky.exposure is 0."


def test_a_missing_extra_is_named() -> None:
    with pytest.raises(MissingExtraError) as caught:
        require_extra("no_such_module", "This needs that", "stereo")
    assert (caught.value.extra, caught.value.code) == ("stereo", "missing-extra")
    assert str(caught.value) == "This needs that: pip install 'outdoor-lighting[stereo]'."
    with pytest.raises(PhotoError, match="RAW photos need rawpy"):
        require_extra("no_such_module", "RAW photos need rawpy", "raw", PhotoExtraError)
    assert require_extra("json", "Never missing", "none").loads("[1]") == [1]


# Old names.

ATTRIBUTES = {  # of classes, and parameters
    "lighting.Estimate.save.colours",
    "lighting.Estimator.together",
    "lighting.MapOptions.detail",
    "lighting.MapOptions.surroundings",
    "lighting.UserInput.use_exif",
    "lighting.photo.reader.Photo.facts",
    "lighting.video.stream.Tracker.given",
    "lighting.write_exr.colours",
}


def release(text: str) -> tuple[int, ...]:
    """A version's numbers, in the order of releases."""
    return tuple(int(part) for part in text.split("."))


def test_the_release_without_the_old_names_has_not_come() -> None:
    """Where this fails, remove the old names."""
    assert release(lighting.__version__) < release(_GONE_IN)


@pytest.mark.parametrize("old", sorted(RENAMED.keys() - ATTRIBUTES))
def test_an_old_name_is_the_new_one_and_warns(old: str) -> None:
    package, _, name = old.rpartition(".")
    module, _, new = RENAMED[old].rpartition(".")
    with pytest.warns(DeprecationWarning, match=rf"^{old} is now {module}\.{new}; .* {_GONE_IN}\.$") as seen:
        value = getattr(import_module(package), name)
    assert value is getattr(import_module(module), new)
    assert [Path(warning.filename) for warning in seen] == [Path(__file__)]


def test_what_was_never_public_is_an_attribute_error() -> None:
    for package in {old.rpartition(".")[0] for old in RENAMED.keys() - ATTRIBUTES}:
        with pytest.raises(AttributeError, match=f"^module '{package}' has no attribute 'nonsense'$"):
            _ = import_module(package).nonsense


def test_photos_taken_together_are_estimate_views(network: Path) -> None:
    estimator, photo = Estimator(Model.load(network)), photo_from_array(np.zeros((64, 64, 3), np.uint8))
    new = estimator.estimate_views([photo] * 2, headings=[0.0, 30.0], register=False)
    with pytest.warns(DeprecationWarning, match=r"Estimator\.together is now .*Estimator\.estimate_views") as seen:
        old = estimator.together([photo] * 2, headings=[0.0, 30.0], match=False)
    assert [estimate.lighting for estimate in old] == [estimate.lighting for estimate in new]
    assert [Path(warning.filename) for warning in seen] == [Path(__file__)]


def test_the_facts_of_a_photo_are_its_metadata() -> None:
    photo = photo_from_array(np.zeros((64, 64, 3), np.uint8))
    with pytest.warns(DeprecationWarning, match=r"Photo\.facts is now .*Photo\.metadata") as seen:
        assert photo.facts is photo.metadata
    assert [Path(warning.filename) for warning in seen] == [Path(__file__)]


def test_the_exif_switch_of_user_input_is_its_metadata() -> None:
    with pytest.warns(DeprecationWarning, match=r"UserInput\.use_exif is now .*UserInput\.metadata") as seen:
        old = lighting.UserInput(use_exif=False)
    assert old == lighting.UserInput(metadata=False)
    assert [Path(warning.filename) for warning in seen] == [Path(__file__)]
    with pytest.warns(DeprecationWarning, match=r"UserInput\.use_exif is now"):
        assert old.use_exif is False
