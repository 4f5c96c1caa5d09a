"""What the network of normals is trained and scored on: surfaces, days, shading, samples, a run of two steps."""

from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import torch

from export.stereo.days import HELD_OUT_LATITUDES, Day, believed, hours_of, random_day
from export.stereo.network import NormalsNetwork
from export.stereo.objects import Subject
from export.stereo.relief import relief
from export.stereo.samples import CROP, samples
from export.stereo.shading import Material, cast_shadows, shade
from export.stereo.surfaces import of_height, random_turn, read_mesh, turned, view
from export.stereo.train import Config, average, batch, train
from export.stereo.trials import Trial, session
from lighting.stereo.mean_light import Skies
from lighting.stereo.normals.frame import Pose

OCTAHEDRON = """v 1 0 0
v -1 0 0
v 0 1 0
v 0 -1 0
v 0 0 1
v 0 0 -1
f 1 3 5
f 3 2 5
f 2 4 5
f 4 1 5
f 3/1 1/1 6/1
f 2 3 6
f 4 2 6
f 1 4 6
"""


def test_a_mesh_is_seen_from_in_front(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(OCTAHEDRON)
    mesh = read_mesh(tmp_path / "a.obj")
    assert mesh[0].shape == (6, 3)
    assert mesh[1].shape == (8, 3)
    seen = view(mesh, np.eye(3), 64, np.random.default_rng(0))
    assert abs(seen.mask.mean() - 0.94**2 / 2) < 0.03  # a square on its corner
    assert (seen.normals[seen.mask][:, 2] > 0).all()
    row, column = np.unravel_index(int(np.nanargmax(seen.height)), seen.height.shape)
    assert abs(row - 32) <= 2
    assert abs(column - 32) <= 2


def test_turns_are_rotations_and_turned_surfaces_keep_normals_and_slopes_together() -> None:
    turn = random_turn(np.random.default_rng(0))
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) > 0
    y, x = np.mgrid[:24, :24].astype(np.float32)
    surface = of_height(0.3 * x + 0.02 * y * y, np.ones((24, 24), bool))
    for quarters in range(4):
        for mirrored in (False, True):
            found = turned(surface, quarters, mirrored=mirrored)
            again = of_height(found.height, found.mask)
            np.testing.assert_allclose(found.normals[2:-2, 2:-2], again.normals[2:-2, 2:-2], atol=1e-5)


def test_reliefs_have_unit_normals_where_their_mask_is() -> None:
    rng = np.random.default_rng(0)
    for _ in range(12):
        surface = relief(64, rng)
        length = np.linalg.norm(surface.normals, axis=-1)
        np.testing.assert_allclose(length[surface.mask], 1, rtol=1e-5)
        assert not length[~surface.mask].any()
        assert surface.mask.any()


def test_training_days_keep_off_the_latitudes_that_are_held_out() -> None:
    rng = np.random.default_rng(0)
    for day in (random_day(rng) for _ in range(60)):
        assert not any(low <= abs(day.latitude) <= high for low, high in HELD_OUT_LATITUDES)
        assert 3 <= len(day.times) <= 8
        assert np.degrees(np.arcsin(day.suns()[:, 1])).min() > 5
    day = Day(hours_of("2024-03-21", np.array([9.0, 12.0])), 47.0)
    assert day.times[1] - day.times[0] == np.timedelta64(3, "h")
    assert believed(day, rng).latitude == 47.0


def test_a_wall_casts_a_shadow_as_long_as_the_sun_is_low() -> None:
    height = np.zeros((40, 80), dtype=np.float32)
    height[:, :10] = 12.0
    surface = of_height(height, np.ones_like(height, dtype=bool))
    sun = np.array([-1.0, 0.0, 0.5])  # from the left, falling one pixel in two
    pixels = np.array([[20, column] for column in range(12, 80)])
    lit = cast_shadows(surface, pixels, (sun / np.linalg.norm(sun))[None])[:, 0]
    edge = 12 + int(np.flatnonzero(lit)[0])
    assert abs(edge - (10 + 24)) <= 3
    assert lit[edge - 12 :].all()


def test_shading_is_lamberts_under_a_single_light() -> None:
    light = np.array([[0.6, 0.0, 0.8]])
    skies = Skies(np.zeros((1, 4, 8, 1), np.float32), light, np.full((1, 1), np.pi))
    normals = np.array([[0, 0, 1], [0.6, 0, 0.8], [-0.8, 0, 0.6]], dtype=np.float32)
    matt = Material(np.full(3, 0.5, np.float32))
    np.testing.assert_allclose(shade(normals, skies, Pose(), matt, None)[:, 0, 0], [0.4, 0.5, 0.0], atol=1e-3)
    shadow = shade(normals, skies, Pose(), matt, np.zeros((3, 1), dtype=bool))
    np.testing.assert_allclose(shadow, 0, atol=1e-6)
    glossy = shade(normals, skies, Pose(), Material(matt.albedo, 0.1), None)
    assert (glossy[:2] > shade(normals, skies, Pose(), matt, None)[:2]).all()


def test_samples_are_the_same_for_the_same_seed() -> None:
    first, second = (next(samples([], seed=5)) for _ in range(2))
    assert first.truth.shape == (3, CROP, CROP)
    np.testing.assert_array_equal(first.by_image, second.by_image)
    inside = first.shared[-1] > 0
    np.testing.assert_allclose(np.linalg.norm(first.truth[:, inside].astype(float), axis=0), 1, atol=2e-3)


def test_a_fresh_network_repeats_the_search_and_mirrors_with_its_input() -> None:
    chosen = list(islice(samples([], seed=3), 2))
    by_image, present, shared, _ = batch(chosen)
    network = NormalsNetwork().eval()
    with torch.inference_mode():
        normal, error = network(by_image, present, shared)
    inside = shared[:, -1] > 0
    cosine = (normal * shared[:, :3]).sum(dim=1)[inside]
    assert float(cosine.median()) > 0.98
    assert (error > 0).all()
    mirrored = batch(chosen, mirrored=True)
    np.testing.assert_allclose(mirrored[2][:, 0].flip(-1), -shared[:, 0])
    np.testing.assert_allclose(mirrored[3][:, 1].flip(-1), batch(chosen)[3][:, 1])


def test_a_run_resumes(tmp_path: Path) -> None:
    file = train(Config(out=str(tmp_path), meshes="", minutes=0.005, batch=2, first=2))
    before = torch.load(file, weights_only=True)
    assert before["step"] > 0
    longer = before["seconds"] / 60 + 0.005
    after = torch.load(train(Config(out=str(tmp_path), meshes="", minutes=longer, batch=2, first=2)), weights_only=True)
    assert after["step"] > before["step"]
    assert after["seconds"] > before["seconds"]
    assert isinstance(average(file), NormalsNetwork)


def test_a_session_of_two_shapes_in_june_meets_the_target_of_the_search() -> None:
    y, x = np.mgrid[:40, :40] - 19.5
    inside = x * x + y * y < 17**2
    ball = of_height(np.sqrt(np.maximum(19.0**2 - x * x - y * y, 1)).astype(np.float32), inside)
    day = Day(hours_of("2024-06-21", np.arange(9.0, 17.0)), 47.0)
    found: list[Any] = session([Subject("a", "b", ball), Subject("c", "b", turned(ball, 1))], Trial(day), None)
    assert [shape.subject.name for shape in found] == ["a", "c"]
    for shape in found:
        search, both = shape.errors()
        assert np.median(search) < 4  # issue: at most 4 in June
        np.testing.assert_array_equal(search, both)
