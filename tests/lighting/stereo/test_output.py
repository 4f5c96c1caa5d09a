"""From a folder of photos to pictures, mesh and record."""

import json
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from click.testing import CliRunner, Result
from numpy.typing import NDArray
from PIL import Image

from lighting.cli import cli
from lighting.errors import PhotoError
from lighting.files.exr import read_exr, write_exr
from lighting.geometry import latlong_directions, latlong_solid_angle
from lighting.photo.linear import read_linear
from lighting.stereo.light_vectors import clear_skies
from lighting.stereo.normal_search import Pose, camera_to_world
from lighting.stereo.output import (
    NormalsOptions,
    NormalsResult,
    depth_error,
    estimate_normals,
    integrate_normals,
    write_normals,
)
from lighting.stereo.solver import NormalMap
from tests.helpers.photos import write_png16
from tests.helpers.skies import JUNE, angles, ball, june_suns, photos


def test_a_ball_comes_back_round() -> None:
    normals, mask, height = ball(96)
    found = integrate_normals(normals, mask)
    assert np.isnan(found[~mask]).all()
    assert depth_error(found, height, mask) < 0.25  # pixels; its radius is 46


def test_pieces_that_do_not_touch_are_solved_apart() -> None:
    normals, mask, height = ball(40)
    both = np.concatenate([normals, normals], axis=1), np.concatenate([mask, mask], axis=1)
    found = integrate_normals(*both)
    assert depth_error(found[:, :40], height, mask) < 0.4
    assert depth_error(found[:, 40:], height, mask) < 0.4


def test_a_slanted_plane_seen_in_perspective() -> None:
    normal = np.array([0.3, -0.2, 0.933])
    normal /= np.linalg.norm(normal)
    focal, side = 60.0, 41
    right, down = np.meshgrid(np.arange(side) - 20.0, np.arange(side) - 20.0)
    rays = np.stack([right, -down, np.full_like(right, -focal)], axis=-1) / focal
    distance = -5.0 / (rays @ normal)  # of the plane <n, p> = -5
    found = integrate_normals(
        np.broadcast_to(normal, (side, side, 3)).astype(np.float32), np.ones((side, side), bool), focal
    )
    np.testing.assert_allclose(found / found.mean(), distance / distance.mean(), rtol=2e-3)


def result_of(mask: NDArray[np.bool_], albedo: NDArray[np.float32]) -> NormalsResult:
    """A flat thing that faces the camera."""
    up = np.zeros((*mask.shape, 3), np.float32)
    up[mask, 2] = 1
    zero = np.zeros(mask.shape, np.float32)
    return NormalsResult(NormalMap(mask, up, albedo, zero, zero, np.zeros_like(mask), 0.01), Pose(), None, {})


@pytest.mark.parametrize("channels", [1, 3])
def test_pictures_hold_every_digit_or_16_bits(channels: int, tmp_path: Path) -> None:
    albedo = np.random.default_rng(0).uniform(0.1, 0.9, (5, 7, channels)).astype(np.float32)
    albedo[0, 0], albedo[0, 1] = 1.3, -0.2  # what is beyond the bits is cut
    write_normals(tmp_path, result_of(np.ones((5, 7), bool), albedo))
    file = OpenEXR.File(str(tmp_path / "albedo.exr"))
    pixels = file.channels()["RGB" if channels == 3 else "Y"].pixels
    np.testing.assert_array_equal(pixels.reshape(albedo.shape), albedo)
    coded = read_linear(tmp_path / "albedo.png", "linear").pixels[..., :channels]
    np.testing.assert_allclose(coded, np.clip(albedo, 0, 1), atol=0.51 / 65535)
    with Image.open(tmp_path / "albedo.png") as picture:
        picture.verify()


def test_a_mesh_has_two_triangles_for_each_four_neighbours(tmp_path: Path) -> None:
    mask = np.ones((3, 4), dtype=bool)
    mask[0, 0] = False
    write_normals(tmp_path, result_of(mask, np.ones((3, 4, 3), np.float32)))
    header = (tmp_path / "mesh.ply").read_bytes().split(b"end_header")[0]
    assert b"element vertex 11\n" in header
    assert b"element face 10\n" in header  # of six squares one touches the missing corner


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(cli, ["stereo", "normals", *map(str, arguments)], prog_name="lighting")


@pytest.fixture(scope="module")
def day(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("day")
    normals, mask, _ = ball()
    images = photos(normals, mask, clear_skies(june_suns()), Pose(heading=20.0))
    for index, image in enumerate(images):
        write_png16(folder / f"{index}.png", np.rint(65535 * np.clip(image, 0, 1)).astype(np.uint16))
    rows = "".join(f"{index}.png,{time}+00:00\n" for index, time in enumerate(JUNE))
    (folder / "times.csv").write_text("file,time\n" + rows)
    Image.fromarray((255 * mask).astype(np.uint8)).save(folder / "mask.png")
    return folder


def test_a_folder_is_named_by_a_text_too(tmp_path: Path) -> None:
    with pytest.raises(PhotoError, match="There is no folder"):
        estimate_normals(str(tmp_path / "none"), NormalsOptions())


@pytest.mark.needs("scipy")
def test_a_day_becomes_normals_albedo_uncertainty_and_a_mesh(day: Path, tmp_path: Path) -> None:
    result = run(day, "--lat", "47", "--lon", "0", "--heading", "20", "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert "normals from 8 photos" in result.stdout
    pictures = ("normals_camera", "normals_world", "albedo", "uncertainty")
    both = [f"{name}.{suffix}" for name in pictures for suffix in ("png", "exr")]
    names = sorted([*both, "mesh.ply", "normals.json"])
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == names
    record = json.loads((tmp_path / "out" / "normals.json").read_text())
    assert [record[name] for name in ("heading", "camera_elevation", "camera_roll")] == [20.0, 0.0, 0.0]
    assert abs(record["turbidity"] - 3) < 0.5  # nobody said it; the photos are of 3
    truth, mask, _ = ball()
    found = read_exr(tmp_path / "out" / "normals_camera.exr")[0]
    error = angles(found[mask], truth[mask])
    assert np.median(error) < 4  # of three channels in June; the pilot's one channel had 3.5
    coded = read_linear(tmp_path / "out" / "normals_camera.png", "linear").pixels
    np.testing.assert_allclose(coded[mask] * 2 - 1, found[mask], atol=1e-4)
    world = read_exr(tmp_path / "out" / "normals_world.exr")[0]
    np.testing.assert_allclose(world[mask], camera_to_world(found[mask], Pose(20.0)), atol=1e-5)
    assert not found[~mask].any()


def test_a_heading_that_is_opposite_is_noticed_and_doubted(day: Path) -> None:
    right, wrong = (
        estimate_normals(day, NormalsOptions(latitude=47, longitude=0, heading=heading, turbidity=3))
        for heading in (20.0, 200.0)
    )
    assert not any("misses the photos" in warning for warning in right.warnings)
    assert right.record["misfit"] < 0.002
    assert wrong.record["misfit"] > 0.005
    warning = next(w for w in wrong.warnings if "explains the photos better" in w)
    assert "A heading of 20°" in warning
    assert "better than 200°" in warning
    truth, mask, _ = ball()
    off = float(np.mean(angles(wrong.map.normal[mask], truth[mask])))
    assert off > 60
    assert wrong.map.error[mask].mean() > 0.7 * off


@pytest.mark.needs("scipy")
def test_the_mesh_holds_every_pixel_and_its_triangles_face_the_camera(day: Path, tmp_path: Path) -> None:
    run(day, "--lat", "47", "--lon", "0", "--heading", "20", "--no-network", "--turbidity", "3", "-o", tmp_path)
    header, _, body = (tmp_path / "mesh.ply").read_bytes().partition(b"end_header\n")
    points = int(header.split(b"element vertex ")[1].split()[0])
    faces = int(header.split(b"element face ")[1].split()[0])
    assert points == ball()[1].sum() == json.loads((tmp_path / "normals.json").read_text())["pixels"]
    kinds = [("point", "<f4", 3), ("normal", "<f4", 3), ("colour", "u1", 3)]
    vertex = np.frombuffer(body, kinds, points)["point"]
    corners = np.frombuffer(body[27 * points :], [("count", "u1"), ("corners", "<i4", 3)], faces)["corners"]
    a, b, c = (vertex[corners[:, corner]] for corner in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


@pytest.mark.needs("scipy")
def test_results_are_replaced_where_told_and_other_files_stay(day: Path, tmp_path: Path) -> None:
    for name in ("notes.txt", "normals.json"):
        (tmp_path / name).write_text("old")
    options = ("--lat", "47", "--lon", "0", "--heading", "20", "--no-network", "--turbidity", "3", "-o", tmp_path)
    result = run(day, *options, "--overwrite")
    assert result.exit_code == 0, result.output
    assert (tmp_path / "notes.txt").read_text() == "old"
    assert json.loads((tmp_path / "normals.json").read_text())["turbidity"] == 3


@pytest.mark.needs("scipy")
def test_probes_of_the_same_skies_give_the_same_normals(day: Path, tmp_path: Path) -> None:
    skies = clear_skies(june_suns(), height=128)
    for time, radiance, sun, power in zip(JUNE, skies.radiance, skies.sun_direction, skies.sun_irradiance, strict=True):
        text = str(time).replace("-", "").replace(":", "")
        folder = tmp_path / "probes" / text[:8] / text[9:15]
        folder.mkdir(parents=True)
        row, column = np.unravel_index(int((latlong_directions(128) @ sun).argmax()), (128, 256))
        image = radiance.copy()
        image[row, column] += power / latlong_solid_angle(128)[row]
        write_exr(folder / "envmap.exr", image)
    result = run(day, "--probes", tmp_path / "probes", "--heading", "20", "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    truth, mask, _ = ball()
    error = angles(read_exr(tmp_path / "out" / "normals_camera.exr")[0][mask], truth[mask])
    assert np.median(error) < 4


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--lat", "47", "--lon", "180", "--heading", "0"], "below the horizon"),
        (["--lat", "47", "--lon", "0"], "--heading"),
        (["--heading", "0"], "--lat"),
        (["--probes", ".", "--heading", "0"], "holds no probe"),
    ],
)
def test_what_is_missing_ends_in_a_sentence(day: Path, tmp_path: Path, options: list[str], sentence: str) -> None:
    result = run(day, *options, "-o", tmp_path / "out")
    assert result.exit_code == 1
    assert sentence in result.stderr
    assert result.stderr.startswith("Error: ")
    assert not (tmp_path / "out").exists()


def test_a_latitude_needs_a_longitude(day: Path, tmp_path: Path) -> None:
    result = run(day, "--heading", "0", "--lat", "47", "-o", tmp_path / "out")
    assert result.exit_code == 2
    assert "Error: --lat needs --lon too, such as --lat 48.14 --lon 11.58." in result.stderr
    assert not (tmp_path / "out").exists()


def test_probes_and_a_modelled_sky_exclude_each_other(day: Path, tmp_path: Path) -> None:
    result = run(day, "--probes", tmp_path, "--turbidity", "3", "-o", tmp_path / "out")
    assert result.exit_code == 2
