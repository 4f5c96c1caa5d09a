"""Path-traced sessions."""

from pathlib import Path

import numpy as np
import pytest

from export.stereo import traced
from export.stereo.evaluate import SEASONS
from lighting.stereo.grid_search import camera_to_world
from lighting.stereo.light_vectors import illumination_matrices
from lighting.stereo.schedule import gray_skies

ALBEDO = 0.5


def write_sphere(file: Path, rings: int = 24, sectors: int = 48) -> None:
    polar, around = np.meshgrid(
        np.linspace(0, np.pi, rings + 1), 2 * np.pi * np.arange(sectors) / sectors, indexing="ij"
    )
    points = np.stack([np.sin(polar) * np.cos(around), np.cos(polar), np.sin(polar) * np.sin(around)], axis=-1)
    lines = ["v " + " ".join(f"{value:.6f}" for value in point) for point in points.reshape(-1, 3)]
    for ring in range(rings):
        for sector in range(sectors):
            corners = ring * sectors + sector, ring * sectors + (sector + 1) % sectors
            lines.append("f " + " ".join(str(c + 1) for c in (*corners, corners[1] + sectors, corners[0] + sectors)))
    file.write_text("\n".join(lines))


def test_a_ball_under_a_sky_is_as_bright_as_its_light_vectors_say(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A ball reflects nothing onto itself, so the path tracer must agree with the integrals."""
    pytest.importorskip("mitsuba")
    monkeypatch.setattr(traced, "_SIDE", 20)
    monkeypatch.setattr(traced, "_SAMPLES", 128)
    write_sphere(tmp_path / "ball.obj")
    day = SEASONS["47° N, June"]
    skies = gray_skies(day.skies(32)).at(np.array([1, 5]))
    images, normals, mask = traced.trace_mesh(tmp_path / "ball.obj", np.eye(3), day, skies, ALBEDO)
    world = camera_to_world(normals[mask], day.pose)
    vectors = illumination_matrices(skies, world)[..., 0]
    expected = ALBEDO * np.einsum("ptj,pj->tp", vectors, world)
    found = images[:, mask, 0]
    assert mask.sum() > 200
    np.testing.assert_allclose(np.median(found / expected, axis=1), 1, atol=0.03)
    assert np.abs(found - expected).mean() < 0.03 * expected.max()
