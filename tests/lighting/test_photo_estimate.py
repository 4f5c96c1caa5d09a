"""Estimate: one object that makes its map, preview and scene, the same as the commands."""

import io
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import lighting
from lighting import Estimate, Lighting, UserInput, estimate, read_photo, render
from lighting.envmap.relighting import adjust_lighting
from lighting.envmap.surroundings import render_with_surroundings
from lighting.errors import EnvironmentMapError, ParameterError, PhotoError, SceneError
from lighting.files.exr import read_exr
from lighting.files.radiance_hdr import decode_hdr
from lighting.map_options import Adjustments, MapOptions
from tests.helpers.processes import run_command

EXAMPLES = Path(__file__).parents[2] / "examples"
PHOTO = EXAMPLES / "wide_street.jpg"


@pytest.fixture(scope="module")
def answer() -> Estimate:
    return estimate(PHOTO)


def run_envmap(photo: Path, target: Path, *options: str) -> bytes:
    assert run_command("envmap", photo, "-o", target, *options).returncode == 0
    return target.read_bytes()


@pytest.mark.slow
@pytest.mark.thorough
def test_the_map_is_that_of_the_command_to_the_last_bit(tmp_path: Path) -> None:
    """It is so high that it shows more of the photo's pixels than the network sees."""
    photo = EXAMPLES / "snow_field.jpg"
    estimate(str(photo)).save(tmp_path / "python.exr", 1024)
    assert run_envmap(photo, tmp_path / "command.exr", "--height", "1024") == (tmp_path / "python.exr").read_bytes()


@pytest.mark.slow
def test_a_changed_map_and_preview_are_those_of_the_command(answer: Estimate, tmp_path: Path) -> None:
    changed = answer.replace(sun=(40, 25), exposure=0.5, haze=8)
    changed.save(tmp_path / "python.exr", 64, yaw=30)
    options = ["--sun", "40,25", "--exposure", "+0.5", "--haze", "8"]
    target, png = tmp_path / "command.exr", tmp_path / "command.png"
    written = run_envmap(PHOTO, target, *options, "--height", "64", "--yaw", "30", "--preview", str(png))
    assert written == (tmp_path / "python.exr").read_bytes()
    in_notebook = Image.open(io.BytesIO(changed._repr_png_()))
    with Image.open(png) as picture:
        np.testing.assert_array_equal(np.asarray(in_notebook), np.asarray(picture))
    assert in_notebook.format == "PNG"


def test_a_photo_is_taken_in_every_form(answer: Estimate) -> None:
    data = PHOTO.read_bytes()
    photo = read_photo(PHOTO)
    for source in (str(PHOTO), data, bytearray(data), io.BytesIO(data), photo):
        assert estimate(source).lighting == answer.lighting
    by_array, by_picture = estimate(photo.pixels), estimate(Image.fromarray(photo.pixels))
    assert by_array.lighting == by_picture.lighting
    assert by_array.envmap(64).shape == (64, 128, 3)
    assert isinstance(by_array, Estimate)


@pytest.mark.parametrize("thing", [5, None, [1, 2], {"photo": 1}])
def test_what_is_no_photo_is_refused_in_words(thing: object) -> None:
    with pytest.raises(PhotoError, match="array of pixels or a Photo, not"):
        estimate(thing)  # type: ignore[arg-type]


def test_the_place_is_in_the_map_unless_left_out(answer: Estimate) -> None:
    context = answer.context()
    assert context is not None
    placed, bare = answer.envmap(64), answer.envmap(64, around="plain")
    np.testing.assert_allclose(placed, render_with_surroundings(answer.lighting, context, 64), rtol=1e-4)
    np.testing.assert_allclose(bare, render(answer.lighting, 64), rtol=1e-4)
    assert np.abs(placed - bare).mean() > 0.05 * bare.mean()


def test_a_stored_record_regains_the_place_with_its_photo(answer: Estimate) -> None:
    stored = Lighting.from_dict(json.loads(json.dumps(answer.lighting.to_dict())))
    np.testing.assert_array_equal(render(stored, 64, photo=PHOTO), answer.envmap(64))
    np.testing.assert_array_equal(render(stored, 64, photo=PHOTO, disc=False), answer.envmap(64, disc=False))
    np.testing.assert_allclose(render(stored, 64), answer.envmap(64, around="plain"), rtol=1e-4)
    edited = replace(stored, sun_azimuth=-90.0, sun_elevation=50.0, radius_50=0.0, radius_90=0.0)
    np.testing.assert_array_equal(render(edited, 64, photo=PHOTO), answer.replace(lighting=edited).envmap(64))


def test_a_record_of_what_the_user_stated_regains_the_place_with_that() -> None:
    known = UserInput(time="2024-06-01T18:30+02:00", lat=48.14, lon=11.58, fov=60)
    there = estimate(PHOTO, known)
    stored = Lighting.from_dict(json.loads(json.dumps(there.lighting.to_dict())))
    np.testing.assert_array_equal(render(stored, 64, photo=PHOTO, user_input=known), there.envmap(64))


def test_a_changed_light_is_that_of_the_same_options(answer: Estimate) -> None:
    changed = answer.replace(sun=(40, 25), exposure=0.5, haze=8, overcast=True)
    assert changed.lighting == adjust_lighting(answer.lighting, Adjustments((40, 25), 0.5, 8, True))
    assert answer.replace().lighting == answer.lighting
    assert answer.replace(camera_height=30).lighting.camera_height == 30
    with pytest.raises(ParameterError, match="exposure"):
        answer.replace(exposure=50)
    with pytest.raises(ParameterError, match="camera_height"):
        answer.replace(camera_height=0)
    with pytest.raises(TypeError, match="sun_azimut"):
        answer.replace(sun_azimut=3)  # type: ignore[call-arg]


def test_changes_add_up(answer: Estimate) -> None:
    once, twice = answer.replace(exposure=1), answer.replace(exposure=0.5).replace(exposure=0.5)
    assert twice.lighting.exposure == pytest.approx(once.lighting.exposure, rel=1e-5)
    np.testing.assert_allclose(twice.envmap(32, around="photo"), once.envmap(32, around="photo"), rtol=1e-3)
    np.testing.assert_allclose(once.envmap(32, disc=False).mean(), 2 * answer.envmap(32, disc=False).mean(), rtol=1e-2)


def test_the_photo_stays_what_it_shows_under_another_sun(answer: Estimate) -> None:
    moved = answer.replace(sun=(-90, 50))
    context = answer.context()
    assert context is not None
    expected = render_with_surroundings(moved.lighting, context, 64)
    np.testing.assert_allclose(moved.envmap(64), expected, rtol=1e-4)


def test_maps_are_saved_in_every_format(answer: Estimate, tmp_path: Path) -> None:
    for name in ("sky.exr", "sky.hdr", "sky.png"):
        answer.save(tmp_path / name, 64, yaw=90)
    image, record = read_exr(tmp_path / "sky.exr")
    np.testing.assert_allclose(image, np.roll(answer.envmap(64), 32, axis=1), rtol=1e-3)  # its digits are rounded
    assert record is not None
    assert record.sun_azimuth == pytest.approx(answer.lighting.sun_azimuth + 90)
    assert decode_hdr((tmp_path / "sky.hdr").read_bytes()).shape == (64, 128, 3)
    with pytest.raises(EnvironmentMapError, match=r"must end in \.exr"):
        answer.save(tmp_path / "sky.jpg")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["sky.exr", "sky.hdr", "sky.png"]


def test_a_scene_is_written_for_a_tool(answer: Estimate, tmp_path: Path) -> None:
    scene = answer.scene("usd", tmp_path / "street", height=64, up_axis="Z")
    assert 'upAxis = "Z"' in (tmp_path / "street" / "scene.usda").read_text()
    assert scene.plate.shape == answer.photo.reread(3840).pixels.shape
    with pytest.raises(SceneError, match="not empty"):
        answer.scene("usd", tmp_path / "street")
    with pytest.raises(TypeError, match="up_axes"):
        answer.scene("usd", tmp_path / "other", up_axes="Z")
    with pytest.raises(SceneError, match="blender"):
        answer.scene("maya", tmp_path / "other")
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda light: light.envmap(sun=(40, 25)), "sun"),
        (lambda light: light.preview(surroundings="no"), "surroundings"),
        (lambda light: light.save("never.exr", detail=1), "detail"),
        (lambda light: light.save("never.exr", disc=1), "disc"),
        (lambda light: light.light_probe(sun=0), "sun"),
        (lambda light: light.replace(overcast=1), "overcast"),
        (lambda light: light.replace(sun=40), "sun"),
        (lambda light: light.replace(camera_height="high"), "camera_height"),
        (lambda light: light.envmap("high"), "height"),
        (lambda light: light.envmap(64, yaw="left"), "yaw"),
    ],
)
def test_a_value_of_the_wrong_type_is_a_type_error(
    make: Callable[[Any], object], field: str, answer: Estimate, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(TypeError, match=r"\.$") as caught:
        make(answer)
    assert isinstance(caught.value, ParameterError)
    assert caught.value.field == field
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_changed_since_is_not_taken_for_the_photo(tmp_path: Path) -> None:
    file = tmp_path / "photo.jpg"
    file.write_bytes(PHOTO.read_bytes())
    photo = read_photo(file)
    assert max(photo.reread(600).pixels.shape) >= 600
    file.write_bytes((EXAMPLES / "snow_field.jpg").read_bytes())
    with pytest.raises(PhotoError, match="has changed since it was read"):
        photo.reread(600)
    file.unlink()
    with pytest.raises(FileNotFoundError):
        photo.reread(600)


def test_the_repr_says_where_the_sun_is(answer: Estimate) -> None:
    light = answer.lighting
    assert repr(answer).startswith(f"<Estimate of wide_street.jpg: sun {abs(light.sun_azimuth):.1f}° ")
    assert f"{light.sun_elevation:.1f}° high" in repr(answer)
    assert repr(estimate(answer.photo.pixels)).startswith("<Estimate of 800 x 450 pixels: ")
    assert len(repr(answer)) < 250


def test_the_public_face_is_documented_and_whole() -> None:
    for name in lighting.__all__:
        assert getattr(lighting, name) is not None
    with pytest.raises(AttributeError, match="estimat"):
        _ = lighting.estimat  # type: ignore[attr-defined]


def test_the_light_probe_is_that_of_the_changed_light(answer: Estimate) -> None:
    probe, brighter = answer.light_probe(), answer.replace(exposure=1).light_probe()
    np.testing.assert_allclose(brighter.coefficients, 2 * probe.coefficients, rtol=1e-2)
    np.testing.assert_allclose(answer.replace(sun=(0, 90)).light_probe().main_light.direction, [0, 1, 0], atol=1e-6)
    assert not answer.light_probe(sun=False).main_light.irradiance.any()


def test_keywords_are_options_and_old_ones_warn(answer: Estimate) -> None:
    rendered = answer.render(MapOptions(64, around="photo", sun=False, yaw=20.0))
    with pytest.warns(DeprecationWarning, match=r"MapOptions\.detail is now .*around") as seen:
        old = answer.envmap(64, detail=False, sun=False, yaw=20.0)
    np.testing.assert_array_equal(old, rendered.image)
    assert [Path(warning.filename) for warning in seen] == [Path(__file__)]
    assert rendered.lighting.sun_azimuth == pytest.approx(answer.lighting.sun_azimuth + 20)
    with pytest.warns(DeprecationWarning, match=r"MapOptions\.surroundings is now .*around"):
        np.testing.assert_array_equal(answer.envmap(64, surroundings=False), answer.envmap(64, around="plain"))


def test_an_edited_light_keeps_the_photo_and_its_place(answer: Estimate) -> None:
    edited = answer.edit({"sun_azimuth": 30.0}, photo_exposure=answer.lighting.exposure)
    assert edited.photo_lighting == answer.photo_lighting
    assert edited.lighting.sun_azimuth == 30.0
    darker = answer.edit({}, photo_exposure=2 * answer.lighting.exposure)
    assert darker.photo_lighting.exposure == pytest.approx(2 * answer.lighting.exposure)
    assert darker.lighting == answer.lighting
