"""Rendered towns: LLVM, skies, light and shadows, and the folder of panoramas."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from export.__main__ import export_cli
from export.crops.crops import Camera, crop_panorama, load_source
from export.data import rendered_towns
from export.data.labels import read_labels, write_labels
from export.data.panoramas import DataError, read_index
from export.data.procedural_towns import EYE, _box, _join
from export.data.rendered_towns import TOWN_HEIGHT, VARIABLE, RenderedTown, _despeckle, _Sky, find_llvm, random_sky
from export.networks.outdoor import network_specs
from lighting.geometry import angle_between, direction, latlong_directions
from lighting.probe.sun_detection import find_sun
from tests.helpers.panoramas import ALBEDO, NOTHING, clear, plain


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


def test_an_llvm_that_ends_the_process_is_not_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """LLVM 15 cannot compile Mitsuba's kernels on processors with AVX-512, whoever names it."""
    folder = tmp_path / "x86_64-linux-gnu"
    folder.mkdir()
    (folder / "libLLVM-15.so.1").touch()
    monkeypatch.setenv(VARIABLE, "")
    with pytest.raises(DataError, match="needs LLVM 16 or newer: install libllvm19"):
        find_llvm(tmp_path)
    monkeypatch.setenv(VARIABLE, str(folder / "libLLVM-15.so.1"))
    with pytest.raises(DataError, match="needs LLVM 16 or newer"):
        find_llvm()


@pytest.mark.needs("mitsuba", "llvm")
def test_the_sky_is_seen_where_it_is() -> None:
    sky, height = clear(), 64
    traced = RenderedTown(plain(4.0), NOTHING, sky).panorama(height, 0)
    upper = sky.radiance[: TOWN_HEIGHT // 2].reshape(height // 2, 4, 2 * height, 4, 3).mean(axis=(1, 3))
    near = angle_between(latlong_directions(height)[: height // 2], sky.lighting.sun_direction) < 12
    ratio = (traced[: height // 2] / upper)[~near]
    assert np.percentile(np.abs(ratio - 1), 90) < 0.03
    peak = latlong_directions(height).reshape(-1, 3)[traced.sum(axis=2).argmax()]
    assert angle_between(peak, sky.lighting.sun_direction) < 3.0


@pytest.mark.needs("mitsuba", "llvm")
def test_level_ground_shines_by_lambert_s_law() -> None:
    """Under an even sky L: albedo x L. Under the sun alone: albedo / pi x E x sin(elevation)."""
    even = np.where(latlong_directions(TOWN_HEIGHT)[..., 1:2] > 0, 1.0, 0.0).repeat(3, axis=2).astype(np.float32)
    overcast = _Sky(even, clear().lighting, 0.0)
    below = RenderedTown(plain(), NOTHING, overcast).panorama(32, 1)[22:28]
    np.testing.assert_allclose(below.mean(axis=(0, 1)), ALBEDO, rtol=0.02)
    sunny = _Sky(np.zeros_like(even) + 1e-6, clear().lighting, 1.0)
    lit = RenderedTown(plain(), NOTHING, sunny).panorama(32, 1)[22:28].mean(axis=(0, 1))
    np.testing.assert_allclose(
        lit, np.array(ALBEDO) / np.pi * sunny.sun_irradiance * np.sin(np.radians(40.0)), rtol=0.02
    )


@pytest.mark.needs("mitsuba", "llvm")
def test_a_shadow_falls_away_from_the_sun() -> None:
    """Of a tower in the sun's direction: the ground on our side is dark, and so are we; behind us it is lit."""
    sky = clear(elevation=30.0)
    toward = direction(60.0, 0.0)[[0, 2]]
    tower = _box(15 * toward, np.array([6.0, 30.0, 6.0]), -60.0, np.array(ALBEDO))
    scene = RenderedTown(_join([plain(), tower]), NOTHING, sky)
    camera, sunlit = np.array([[0.0, EYE, 0.0]]), np.array([[*(20 * toward[::-1] * [1, -1])]])
    sunlit = np.array([[sunlit[0, 0], EYE, sunlit[0, 1]]])
    assert scene.sunlit_share(camera) == 0.0
    assert scene.sunlit_share(sunlit) == 1.0
    assert scene.sunlit_share(np.concatenate([camera, sunlit])) == 0.5
    assert scene.is_clear()


@pytest.mark.needs("mitsuba", "llvm")
def test_a_camera_in_a_corner_is_not_clear() -> None:
    wall = _box(np.array([0.0, 0.9]), np.array([8.0, 3.0, 0.4]), 0.0, np.array(ALBEDO))
    assert not RenderedTown(_join([plain(), wall]), NOTHING, clear()).is_clear()


def test_single_bright_and_dark_pixels_go_and_edges_stay() -> None:
    image = np.ones((20, 30, 3), np.float32)
    image[:, 15:] = 5.0
    speckled = image.copy()
    speckled[4, 4], speckled[9, 22] = 80.0, 0.0
    np.testing.assert_array_equal(_despeckle(speckled), image)


def test_skies_are_of_every_kind_and_black_below() -> None:
    skies = [random_sky(np.random.default_rng(seed)) for seed in range(40)]
    sunlight = np.array([sky.sunlight for sky in skies])
    assert (sunlight == 0).any()
    assert (sunlight == 1).any()
    assert ((sunlight > 0.03) & (sunlight < 1)).any()
    for sky in skies:
        assert sky.radiance.shape == (TOWN_HEIGHT, 2 * TOWN_HEIGHT, 3)
        assert np.isfinite(sky.radiance).all()
        assert (sky.radiance >= 0).all()
        assert (sky.radiance[TOWN_HEIGHT // 2 :] == 0).all()
        assert sky.radiance[: TOWN_HEIGHT // 2].min() > 0
        assert sky.is_overcast == (sky.sunlight < 0.03)
        assert 2 <= sky.lighting.sun_elevation <= 80


def test_the_disc_holds_the_sun_s_irradiance() -> None:
    sky, height = clear(sunlight=0.5), 512
    weight = np.pi / height * np.cos(np.radians(90 - (np.arange(height) + 0.5) * 180 / height)) * np.pi / height
    flux = (sky.disc(height) * weight[:, None, None]).sum(axis=(0, 1))
    np.testing.assert_allclose(flux, sky.sun_irradiance, rtol=0.02)


@pytest.mark.needs("mitsuba", "llvm")
def test_a_folder_is_filled_gone_on_with_and_read(tmp_path: Path) -> None:
    run = CliRunner().invoke
    folder = tmp_path / "towns"
    command = ["synthesize", "--out", str(folder), "--height", "32", "--count"]
    assert run(export_cli, [*command, "2"]).exit_code == 0
    before = (folder / "panoramas" / "town_00000.exr").stat().st_mtime_ns
    assert run(export_cli, [*command, "4"]).exit_code == 0
    assert (folder / "panoramas" / "town_00000.exr").stat().st_mtime_ns == before
    panoramas, labels = read_index(folder, "train"), read_labels(folder / rendered_towns.LABELS)
    assert [p.name for p in panoramas] == [label.name for label in labels] == [f"town_{i:05d}" for i in range(4)]
    write_labels(labels[:2], folder / rendered_towns.LABELS)  # as if killed between the index and the labels
    assert run(export_cli, [*command, "4"]).exit_code == 0
    assert len(read_index(folder, "train")) == len(read_labels(folder / rendered_towns.LABELS)) == 4
    again = rendered_towns._render_town(1, 32)
    assert again.label.sun_elevation == pytest.approx(labels[1].sun_elevation, rel=1e-5)
    crop = crop_panorama(
        load_source(panoramas[1], labels[1]), Camera(20, 0, 0, 60, 4 / 3), network_specs("0")["outdoor"]
    )
    assert np.isfinite(crop.linear).all()


@pytest.mark.parametrize(
    ("share", "numbers"), [(0.2, [4, 9]), (0.5, [1, 3, 5, 7, 9]), (0.0, []), (1.0, list(range(10)))]
)
def test_a_share_of_the_towns_is_held_out_evenly(share: float, numbers: list[int]) -> None:
    assert [number for number in range(10) if rendered_towns._split_of(number, share) == "val"] == numbers


@pytest.mark.needs("mitsuba", "llvm")
def test_visible_suns_are_found_where_the_labels_have_them() -> None:
    errors = []
    for number in range(7):
        rendered = rendered_towns._render_town(number, 64)
        label, found = rendered.label, find_sun(rendered.radiance)
        if rendered.sun_visible:
            assert found is not None
            errors.append(angle_between(found.direction, direction(label.sun_azimuth, label.sun_elevation)))
    assert len(errors) >= 4
    assert np.median(errors) < 1.5
