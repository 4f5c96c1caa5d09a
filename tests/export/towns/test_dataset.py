"""Rendered places: seeded geometry, skies, radiances against what can be computed by hand, the folder they make."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from export.__main__ import cli
from export.crops.crops import Camera, load_source, take
from export.data.labels import read_labels, write_labels
from export.data.panoramas import DataError, read_index
from export.data.sun_finder import find_sun
from export.networks.network import specs
from export.towns import dataset, place, samples
from export.towns.llvm import VARIABLE, find_llvm
from export.towns.mesh import Mesh, box, join, moved, turned
from export.towns.path_trace import Place, despeckle
from export.towns.place import EYE, KINDS
from export.towns.sky import HEIGHT, Sky, random_sky
from lighting.envmap import render
from lighting.geometry import angle_between, direction, latlong_directions
from lighting.records import Lighting

ALBEDO = (0.2, 0.4, 0.6)


@pytest.fixture
def llvm() -> None:
    try:
        find_llvm()
    except DataError as error:
        pytest.skip(str(error))


def plain(size: float = 400.0) -> Mesh:
    """A level square of ground."""
    h = size / 2
    return Mesh(np.array([[[-h, 0, -h], [-h, 0, h], [h, 0, h], [h, 0, -h]]]), np.array([ALBEDO]))


NOTHING = box(np.array([900.0, 900.0]), np.ones(3), 0, np.array(ALBEDO))


def clear(elevation: float = 40.0, sunlight: float = 1.0) -> Sky:
    lighting = Lighting(sun_azimuth=60.0, sun_elevation=elevation, turbidity=3.0, exposure=0.02)
    radiance = render(lighting, HEIGHT, sun=False)
    radiance[HEIGHT // 2 :] = 0.0
    return Sky(radiance, lighting, sunlight)


# --- geometry --------------------------------------------------------------------------------------------------------


def test_a_seed_gives_one_place() -> None:
    (a, b), (c, d) = (place.place(np.random.default_rng(5)) for _ in range(2))
    for one, other in ((a, c), (b, d)):
        np.testing.assert_array_equal(one.corners, other.corners)
        np.testing.assert_array_equal(one.albedo, other.albedo)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_place_is_sound(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(place, "KINDS", (kind,))
    for seed in range(4):
        for mesh in place.place(np.random.default_rng(seed)):
            assert mesh.corners.shape == (len(mesh.albedo), 4, 3)
            assert np.isfinite(mesh.corners).all()
            assert ((mesh.albedo > 0) & (mesh.albedo < 0.9)).all()
            near = np.hypot(mesh.corners[..., 0], mesh.corners[..., 2]) < 50
            assert (mesh.corners[..., 1][near] > -1.0).all()


def test_a_box_stands_on_the_ground_and_turns() -> None:
    stood = box(np.array([10.0, -4.0]), np.array([2.0, 3.0, 6.0]), 90.0, np.array(ALBEDO)).corners.reshape(-1, 3)
    np.testing.assert_allclose(stood.min(axis=0), [7, 0, -5], atol=1e-9)
    np.testing.assert_allclose(stood.max(axis=0), [13, 3, -3], atol=1e-9)


def test_meshes_join_turn_and_move() -> None:
    joined = join([plain(), NOTHING])
    assert len(joined.corners) == len(joined.albedo) == 6
    np.testing.assert_allclose(turned(np.array([0.0, 2.0, 1.0]), 90.0), [1, 2, 0], atol=1e-12)
    np.testing.assert_allclose(moved(np.array([1.0, 2.0, 3.0]), np.array([10.0, 20.0])), [11, 2, 23])


# --- skies -----------------------------------------------------------------------------------------------------------


def test_skies_are_of_every_kind_and_black_below() -> None:
    skies = [random_sky(np.random.default_rng(seed)) for seed in range(40)]
    sunlight = np.array([sky.sunlight for sky in skies])
    assert (sunlight == 0).any()
    assert (sunlight == 1).any()
    assert ((sunlight > 0.03) & (sunlight < 1)).any()
    for sky in skies:
        assert sky.radiance.shape == (HEIGHT, 2 * HEIGHT, 3)
        assert np.isfinite(sky.radiance).all()
        assert (sky.radiance >= 0).all()
        assert (sky.radiance[HEIGHT // 2 :] == 0).all()
        assert sky.radiance[: HEIGHT // 2].min() > 0
        assert sky.is_overcast == (sky.sunlight < 0.03)
        assert 2 <= sky.lighting.sun_elevation <= 80


def test_the_disc_holds_the_sun_s_irradiance() -> None:
    sky, height = clear(sunlight=0.5), 512
    weight = np.pi / height * np.cos(np.radians(90 - (np.arange(height) + 0.5) * 180 / height)) * np.pi / height
    flux = (sky.disc(height) * weight[:, None, None]).sum(axis=(0, 1))
    np.testing.assert_allclose(flux, sky.sun_irradiance, rtol=0.02)


# --- rendering -------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("llvm")
def test_the_sky_is_seen_where_it_is() -> None:
    sky, height = clear(), 64
    seen = Place(plain(4.0), NOTHING, sky).panorama(height, 0)
    upper = sky.radiance[: HEIGHT // 2].reshape(height // 2, 4, 2 * height, 4, 3).mean(axis=(1, 3))
    near = angle_between(latlong_directions(height)[: height // 2], sky.lighting.sun_direction) < 12
    ratio = (seen[: height // 2] / upper)[~near]
    assert np.percentile(np.abs(ratio - 1), 90) < 0.03
    peak = latlong_directions(height).reshape(-1, 3)[seen.sum(axis=2).argmax()]
    assert angle_between(peak, sky.lighting.sun_direction) < 3.0


@pytest.mark.usefixtures("llvm")
def test_level_ground_shines_by_lambert_s_law() -> None:
    """Under an even sky L: albedo x L. Under the sun alone: albedo / pi x E x sin(elevation)."""
    even = np.where(latlong_directions(HEIGHT)[..., 1:2] > 0, 1.0, 0.0).repeat(3, axis=2).astype(np.float32)
    overcast = Sky(even, clear().lighting, 0.0)
    below = Place(plain(), NOTHING, overcast).panorama(32, 1)[22:28]
    np.testing.assert_allclose(below.mean(axis=(0, 1)), ALBEDO, rtol=0.02)
    sunny = Sky(np.zeros_like(even) + 1e-6, clear().lighting, 1.0)
    lit = Place(plain(), NOTHING, sunny).panorama(32, 1)[22:28].mean(axis=(0, 1))
    np.testing.assert_allclose(
        lit, np.array(ALBEDO) / np.pi * sunny.sun_irradiance * np.sin(np.radians(40.0)), rtol=0.02
    )


@pytest.mark.usefixtures("llvm")
def test_a_shadow_falls_away_from_the_sun() -> None:
    """Of a tower in the sun's direction: the ground on our side is dark, and so are we; behind us it is lit."""
    sky = clear(elevation=30.0)
    toward = direction(60.0, 0.0)[[0, 2]]
    tower = box(15 * toward, np.array([6.0, 30.0, 6.0]), -60.0, np.array(ALBEDO))
    scene = Place(join([plain(), tower]), NOTHING, sky)
    here, aside = np.array([[0.0, EYE, 0.0]]), np.array([[*(20 * toward[::-1] * [1, -1])]])
    aside = np.array([[aside[0, 0], EYE, aside[0, 1]]])
    assert scene.sunlit(here) == 0.0
    assert scene.sunlit(aside) == 1.0
    assert scene.sunlit(np.concatenate([here, aside])) == 0.5
    assert scene.is_clear()


@pytest.mark.usefixtures("llvm")
def test_a_camera_in_a_corner_is_not_clear() -> None:
    wall = box(np.array([0.0, 0.9]), np.array([8.0, 3.0, 0.4]), 0.0, np.array(ALBEDO))
    assert not Place(join([plain(), wall]), NOTHING, clear()).is_clear()


def test_single_bright_and_dark_pixels_go_and_edges_stay() -> None:
    image = np.ones((20, 30, 3), np.float32)
    image[:, 15:] = 5.0
    speckled = image.copy()
    speckled[4, 4], speckled[9, 22] = 80.0, 0.0
    np.testing.assert_array_equal(despeckle(speckled), image)


# --- the folder ------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("llvm")
def test_a_folder_is_filled_gone_on_with_and_read(tmp_path: Path) -> None:
    run = CliRunner().invoke
    folder = tmp_path / "towns"
    command = ["synthesize", "--out", str(folder), "--height", "32", "--count"]
    assert run(cli, [*command, "2"]).exit_code == 0
    before = (folder / "panoramas" / "town_00000.exr").stat().st_mtime_ns
    assert run(cli, [*command, "4"]).exit_code == 0
    assert (folder / "panoramas" / "town_00000.exr").stat().st_mtime_ns == before
    panoramas, labels = read_index(folder, "train"), read_labels(folder / dataset.LABELS)
    assert [p.name for p in panoramas] == [label.name for label in labels] == [f"town_{i:05d}" for i in range(4)]
    write_labels(labels[:2], folder / dataset.LABELS)  # as if killed between the index and the labels
    assert run(cli, [*command, "4"]).exit_code == 0
    assert len(read_index(folder, "train")) == len(read_labels(folder / dataset.LABELS)) == 4
    again = dataset.render_place(1, 32)
    assert again.label.sun_elevation == pytest.approx(labels[1].sun_elevation, rel=1e-5)
    crop = take(load_source(panoramas[1], labels[1]), Camera(20, 0, 0, 60, 4 / 3), specs("0")["outdoor"])
    assert np.isfinite(crop.linear).all()


@pytest.mark.usefixtures("llvm")
def test_samples_are_one_crop_of_each_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(samples, "DOWN", 1)
    dataset.synthesize(tmp_path / "towns", 8, 16)
    samples.write_samples(tmp_path / "towns", tmp_path / "samples.jpg")
    with Image.open(tmp_path / "samples.jpg") as picture:
        assert picture.size == (8 * 224, 168)
        tiles = np.asarray(picture, float).reshape(168, 8, 224, 3).mean(axis=(0, 2, 3))
    assert len(np.unique(np.round(tiles))) > 4
    monkeypatch.setattr(samples, "DOWN", 2)
    with pytest.raises(DataError, match="holds 8 places; the picture shows 16"):
        samples.write_samples(tmp_path / "towns", tmp_path / "more.jpg")
    assert not (tmp_path / "more.jpg").exists()


@pytest.mark.usefixtures("llvm")
def test_visible_suns_are_found_where_the_labels_have_them() -> None:
    errors = []
    for number in range(14):
        rendered = dataset.render_place(number, 64)
        label, found = rendered.label, find_sun(rendered.radiance)
        if rendered.sun_visible:
            assert found is not None
            errors.append(angle_between(found.direction, direction(label.sun_azimuth, label.sun_elevation)))
    assert len(errors) >= 4
    assert np.median(errors) < 1.5


def test_without_llvm_one_sentence_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    with pytest.raises(DataError, match="libllvm"):
        find_llvm(tmp_path)


def test_the_newest_llvm_is_taken_unless_one_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "x86_64-linux-gnu"
    folder.mkdir()
    for name in ("libLLVM-9.so", "libLLVM-15.so", "libLLVM.so.19.1", "libLLVM-C.so"):
        (folder / name).touch()
    monkeypatch.setenv(VARIABLE, "/elsewhere/libLLVM.so")
    assert find_llvm(tmp_path) == "/elsewhere/libLLVM.so"
    monkeypatch.setenv(VARIABLE, "")
    assert find_llvm(tmp_path) == str(folder / "libLLVM.so.19.1")
