"""The chain from a photo to its light."""

import pickle
from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lighting
from lighting import estimator
from lighting import model as model_module
from lighting.decoding import blend_to_clear_sun, lighting_from_prediction
from lighting.errors import ModelError, ParameterError, PhotoError, warning_code
from lighting.estimator import Estimator, _view, estimate
from lighting.fusion.estimate import apply_photo_colors
from lighting.fusion.single_view import Gravity, Observations
from lighting.fusion.user_input import UserInput
from lighting.geometry import angle_between, direction
from lighting.model import Model
from lighting.photo.metadata import PhotoMetadata
from lighting.photo.reader import Photo, photo_from_array, read_photo
from lighting.records import Lighting
from tests.conftest import AROUND, encode, scene, write_network
from tests.helpers.predictions import UNIFORM, grid_prediction

UNSUITABLE = "Probably not an outdoor daylight photo: do not trust this result."


@pytest.fixture
def packaged(monkeypatch: pytest.MonkeyPatch, network: Path) -> Iterator[None]:
    """The tiny network in the place of the packaged one."""
    monkeypatch.setattr(model_module, "packaged_model", lambda: network)
    estimator._packaged_estimator.cache_clear()
    yield
    estimator._packaged_estimator.cache_clear()


LIFTED = tuple(np.array([0.4, 0.5, 0.8]) * 2 ** (0.7 * 0.2))  # the sky of LIT, by its cover of 0.2


def test_an_estimator_gives_the_lighting_of_its_prediction(network: Path, photo_path: Path) -> None:
    estimator = Estimator(Model.load(network))
    photo = read_photo(photo_path)
    prediction = estimator.predict(photo)
    lighting = estimator(photo).lighting
    assert lighting.sun_candidates[0].azimuth == lighting.sun_azimuth
    bare = replace(lighting, ground_visible=None, spot_pixel=None, spot_direction=None, sun_candidates=())
    assert bare == lighting_from_prediction(prediction)
    assert np.array_equal(estimator(photo).distribution.probability, prediction.sun_probability)
    assert prediction.sun_probability.sum() == pytest.approx(1.0, abs=1e-5)


def test_the_same_photo_gives_the_same_light_and_another_gives_another(network: Path) -> None:
    estimator = Estimator(Model.load(network))
    bright, dark = (read_photo(encode(np.full((64, 96, 3), v, dtype=np.uint8))) for v in (220, 30))
    assert estimator(bright).lighting == estimator(bright).lighting
    assert estimator(bright).lighting.turbidity != estimator(dark).lighting.turbidity


@pytest.mark.usefixtures("packaged")
def test_estimate_takes_a_path_bytes_or_a_stream(photo_path: Path) -> None:
    expected = Estimator()(read_photo(photo_path))
    assert isinstance(expected.lighting, Lighting)
    data = photo_path.read_bytes()
    for source in (photo_path, str(photo_path), data, bytearray(data), memoryview(data), BytesIO(data)):
        assert estimate(source).lighting == expected.lighting


@pytest.mark.usefixtures("packaged")
def test_estimate_loads_the_network_once(photo_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    estimate(photo_path)
    monkeypatch.setattr(model_module, "packaged_model", lambda: pytest.fail("loaded again"))
    estimate(photo_path)


@pytest.mark.usefixtures("packaged")
def test_errors_pass_through(tmp_path: Path) -> None:
    with pytest.raises(PhotoError):
        estimate(b"not a photo")
    with pytest.raises(FileNotFoundError):
        estimate(tmp_path / "absent.jpg")


def test_a_missing_network_is_a_model_error(tmp_path: Path) -> None:
    with pytest.raises(ModelError):
        Estimator(Model.load(tmp_path / "absent.onnx"))


def test_the_public_face_is_lazy_and_small() -> None:
    assert len(lighting.__all__) <= 11
    assert lighting.Estimator is Estimator
    assert lighting.estimate is estimate
    assert set(lighting.__all__) <= set(dir(lighting))
    with pytest.raises(AttributeError, match="has no attribute 'nonsense'"):
        _ = lighting.nonsense  # type: ignore[attr-defined]


@pytest.mark.parametrize("thing", ["photo.jpg", np.zeros((64, 64, 3), np.uint8), None])
def test_an_estimator_says_what_it_takes(network: Path, thing: Any) -> None:
    estimator = Estimator(Model.load(network))
    with pytest.raises(PhotoError, match=r"A Photo is needed.*read_photo.*photo_from_array"):
        estimator(thing)
    with pytest.raises(PhotoError, match="A Photo is needed"):
        estimator.estimate_views([thing, thing])


def test_photos_taken_together_are_a_list_and_matching_is_a_choice(network: Path) -> None:
    estimator, photo = Estimator(Model.load(network)), photo_from_array(np.zeros((64, 64, 3), np.uint8))
    things: tuple[Any, ...] = ((p for p in [photo, photo]), photo, None)
    for thing in things:
        with pytest.raises(PhotoError, match="Several photos are given as a list, not as"):
            estimator.estimate_views(thing)
    matching: Any = "yes"
    with pytest.raises(ParameterError, match="register must be True, False or a function, not 'yes'"):
        estimator.estimate_views([photo, photo], register=matching)


@pytest.mark.parametrize("model", ["network.onnx", ""])
def test_a_network_is_a_model_not_the_path_of_its_file(model: Any) -> None:
    with pytest.raises(ParameterError, match=r"A Model is needed, not str.*Model\.load"):
        Estimator(model)


@pytest.mark.parametrize("given", [{"latitude": 48.0, "longitude": 11.0}, None])
def test_what_is_known_of_a_photo_is_a_given(network: Path, photo_path: Path, given: Any) -> None:
    estimator, photo = Estimator(Model.load(network)), read_photo(photo_path)
    for ask in (
        lambda: estimator(photo, given),
        lambda: estimator.estimate_views([photo, photo], given),
    ):
        with pytest.raises(ParameterError, match=f"is a UserInput, not {type(given).__name__}"):
            ask()


def test_no_photos_together_give_no_answers_and_headings_are_one_each(network: Path, photo_path: Path) -> None:
    estimator, photo = Estimator(Model.load(network)), read_photo(photo_path)
    assert estimator.estimate_views([]) == []
    with pytest.raises(ParameterError, match="one photo has a heading"):
        estimator.estimate_views([photo], headings=[0.0, 1.0])
    with pytest.raises(ParameterError, match="3 photos need 3 headings, not 2"):
        estimator.estimate_views([photo] * 3, headings=[0.0, 1.0])
    with pytest.raises(ParameterError, match="heading"):
        estimator.estimate_views([photo] * 2, UserInput(heading=90.0))


def test_the_answer_can_be_pickled_and_printed_on_a_line(network: Path, photo_path: Path) -> None:
    found = Estimator(Model.load(network))(read_photo(photo_path))
    again = pickle.loads(pickle.dumps(found))
    assert again.lighting == found.lighting
    assert np.array_equal(again.distribution.probability, found.distribution.probability)
    assert "\n" not in repr(found) + repr(read_photo(photo_path))


@pytest.mark.usefixtures("packaged")
def test_photo_to_map_puts_the_sun_where_the_record_says(photo_path: Path) -> None:
    found = estimate(photo_path).lighting
    image = lighting.render(found, 128, sun=True)
    row, column = np.unravel_index(int(image.sum(axis=-1).argmax()), image.shape[:2])
    azimuth, elevation = (column + 0.5) / 256 * 360 - 180, 90 - (row + 0.5) / 128 * 180
    assert angle_between(direction(azimuth, elevation), found.sun_direction) < 1.5


def test_a_portrait_photo_is_letterboxed(network: Path) -> None:
    photo = read_photo(encode(scene(200, 600)))
    assert isinstance(Estimator(Model.load(network))(photo).lighting, Lighting)


def test_a_network_that_says_so_gives_irradiances_ground_and_the_place(lit_network: Path) -> None:
    estimate = Estimator(Model.load(lit_network))(read_photo(encode(scene(320, 240) // 2)))  # too dark to be sky
    light = estimate.lighting
    stated = 2**0.6 * np.array([1.9, 1.5, 0.9])
    assert light.sun_irradiance == pytest.approx(blend_to_clear_sun(stated, light.sun_elevation, 0.5), rel=1e-4)
    assert light.sky_irradiance == pytest.approx(LIFTED, rel=1e-4)
    assert (light.sky_cover, light.suitable) == pytest.approx((0.2, 0.97))
    assert light.ground_color is not None
    assert light.ground_color[1] > light.ground_color[2]  # the picture's green grows downwards, its blue does not
    assert estimate.surroundings == pytest.approx(AROUND)
    assert not estimate.warnings


def test_what_is_no_such_photo_earns_a_warning(tmp_path: Path, photo_path: Path) -> None:
    doubtful = {"light": np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.5, 0.1])}
    estimator = Estimator(Model.load(write_network(tmp_path / "n.onnx", more=doubtful)))
    assert estimator(read_photo(photo_path)).warnings == (UNSUITABLE,)


@pytest.mark.parametrize("grey", [0, 90, 255])
def test_an_empty_frame_is_no_photo_whatever_the_network_says(lit_network: Path, grey: int) -> None:
    noise = np.random.default_rng(0).normal(grey, 4, (48, 64, 3))
    empty, other = photo_from_array(np.clip(noise, 0, 255).astype(np.uint8)), photo_from_array(scene(64, 48))
    estimator = Estimator(Model.load(lit_network))
    told = estimator(empty)
    assert told.warnings == (UNSUITABLE,)
    assert told.lighting.suitable == 0.01
    assert UNSUITABLE in estimator.estimate_views([empty, other])[0].warnings
    assert estimator(other).lighting.suitable == pytest.approx(0.97)


def test_pictures_of_several_views_are_no_photos_whatever_the_network_says(lit_network: Path) -> None:
    """Collages by pixels, panoramas and temperatures by files; the latter two not where the file does not count."""
    estimator, plain = Estimator(Model.load(lit_network)), photo_from_array(scene(320, 240))
    collage = replace(plain, is_collage=True, warnings=("A collage.",))
    panorama = replace(plain, metadata=PhotoMetadata(is_panorama=True))
    thermal = replace(plain, metadata=PhotoMetadata(is_thermal=True))
    kinds = (collage, "A collage."), (panorama, "The file says"), (thermal, "Probably a picture of a thermal camera")
    for photo, told in kinds:
        estimate = estimator(photo)
        assert estimate.lighting.suitable == 0.01
        assert estimate.warnings[0].startswith(told)
        assert estimator.estimate_views([photo, plain])[0].warnings[0].startswith(told)
    by_pixels = estimator(panorama, UserInput(metadata=False))
    assert by_pixels.warnings == estimator(plain).warnings
    assert by_pixels.lighting.suitable == pytest.approx(0.97)


def test_a_lens_that_the_pixels_exclude_is_that_of_the_pixels(lit_network: Path) -> None:
    """Unless the user states it."""
    estimator = Estimator(Model.load(lit_network))
    plain = photo_from_array(scene(320, 240))
    wrong = replace(plain, metadata=PhotoMetadata(focal_length=400.0, vertical_fov=5.0))
    estimate = estimator(wrong)
    assert estimate.lighting.vertical_fov == estimator(plain).lighting.vertical_fov
    assert "focal length" not in estimate.evidence
    assert [warning_code(warning) for warning in estimate.warnings] == ["lens-contradicted"]
    assert estimator(wrong, UserInput(vertical_fov=5.0)).lighting.vertical_fov == 5.0


def test_one_photo_together_is_answered_as_alone(lit_network: Path, photo_path: Path) -> None:
    """The service takes every request as photos of one place."""
    estimator, given = Estimator(Model.load(lit_network)), UserInput(vertical_fov=62.0)
    photo = read_photo(photo_path)
    (together,), alone = estimator.estimate_views([photo], given), estimator(photo, given)
    assert together.lighting == alone.lighting
    assert together.lighting.evidence == ("pixels", "focal length")


def test_photos_together_share_the_colour_of_the_sky_that_some_of_them_show(lit_network: Path) -> None:
    dark, blue, red = scene(320, 240) // 2, scene(320, 240), scene(320, 240)
    sky = np.arange(320) % 40 < np.arange(140)[:, None]  # above a jagged skyline
    blue[:140], red[:140] = (
        np.where(sky[::-1, :, None], c, p[:140]) for c, p in (((100, 160, 240), blue), ((240, 160, 100), red))
    )
    first, second, third = (read_photo(encode(picture)) for picture in (dark, blue, red))
    said = Estimator(Model.load(lit_network))(first)

    def skies(*photos: Photo) -> list[np.ndarray]:
        answers = apply_photo_colors(photos, [said] * len(photos))
        return [np.array(answer.lighting.sky_irradiance) for answer in answers]

    (unseen,), (blue_sky,), (red_sky,) = skies(first), skies(second), skies(third)
    assert unseen == pytest.approx(LIFTED, rel=1e-4)
    assert blue_sky[2] / blue_sky[0] > 1.1 * unseen[2] / unseen[0] > 1.2 * red_sky[2] / red_sky[0]
    assert skies(first, second) == [pytest.approx(blue_sky)] * 2
    assert skies(first, second, third) == [pytest.approx(np.sqrt(blue_sky * red_sky), rel=1e-5)] * 3


def test_photos_together_share_the_strength_of_the_light(lit_network: Path) -> None:
    photos = [read_photo(encode(scene(320, 240) // 2)) for _ in range(2)]
    one, two = Estimator(Model.load(lit_network)).estimate_views(photos)
    assert one.lighting.sky_irradiance == pytest.approx(LIFTED, rel=1e-4)
    assert one.lighting.ground_color == two.lighting.ground_color is not None
    assert two.surroundings == pytest.approx(AROUND)


@pytest.mark.needs("cv2")
@pytest.mark.parametrize(("elevation", "sigma"), [(None, 2.5), (-6.0, 0.96), (60.0, 2.5)])
def test_a_photo_that_is_matched_is_levelled_by_its_gravity(elevation: float | None, sigma: float) -> None:
    """Unless the pixels contradict it."""
    photo, said = Photo(scene(320, 240), 320, 240, "JPEG"), grid_prediction(UNIFORM)
    gravity = None if elevation is None else Gravity(elevation, 5.0, 1.0)
    shot = _view(photo, said, Observations(vertical_fov=53.0, gravity=gravity)).with_features()
    assert shot.up_std == pytest.approx(sigma, abs=0.01)
    used = sigma < 2.0
    assert shot.camera_elevation == pytest.approx(-5.4 if used else said.camera_elevation, abs=0.1)
    assert shot.camera_roll == pytest.approx(4.1 if used else said.camera_roll, abs=0.1)
    assert (shot.predicted_fov, shot.metadata_fov) == (50.0, 53.0)
