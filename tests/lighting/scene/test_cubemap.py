"""Cube maps and harmonics, decoded as Babylon.js decodes them."""

from io import BytesIO
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from lighting.geometry import latlong_directions, latlong_solid_angle
from lighting.scene import cubemap


def decoded(png: bytes) -> NDArray[Any]:
    """Radiance of a file in RGBD, upper row first."""
    pixels = np.asarray(Image.open(BytesIO(png))) / 255.0
    return np.asarray(pixels[::-1, :, :3] ** 2.2 / pixels[..., 3:][::-1])


def spot(height: int, towards: NDArray[Any], width: float = 8.0) -> NDArray[np.float32]:
    """A map with a soft bright spot in a direction."""
    cosine = latlong_directions(height) @ towards
    return np.repeat(np.exp(width * (cosine - 1))[..., None], 3, axis=-1).astype(np.float32)


@pytest.mark.parametrize("towards", [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)])
def test_each_axis_is_the_centre_of_its_face(towards: tuple[int, int, int]) -> None:
    """+X and -X change places: Babylon.js' world is glTF's, mirrored."""
    face = {(-1, 0, 0): 0, (1, 0, 0): 1, (0, 1, 0): 2, (0, -1, 0): 3, (0, 0, 1): 4, (0, 0, -1): 5}[towards]
    sharp = next(iter(cubemap.levels(spot(128, np.array(towards, dtype=float)))))
    images = [decoded(png) for png in sharp]
    assert int(np.argmax([image.mean() for image in images])) == face
    row, column = np.unravel_index(int(images[face].sum(axis=-1).argmax()), images[face].shape[:2])
    assert abs(row - 63.5) < 6
    assert abs(column - 63.5) < 6


def test_faces_meet_without_a_seam() -> None:
    towards = np.array([0.6, 0.5, -0.62])
    faces = np.array([decoded(png) for png in next(iter(cubemap.levels(spot(256, towards / np.linalg.norm(towards)))))])
    right, left, up, _, front, back = faces[..., 0]
    assert front[:, -1] == pytest.approx(right[:, 0], abs=0.03)
    assert right[:, -1] == pytest.approx(back[:, 0], abs=0.03)
    assert back[:, -1] == pytest.approx(left[:, 0], abs=0.03)
    assert up[-1] == pytest.approx(front[0], abs=0.03)
    assert faces.max() > 0.9


@pytest.mark.slow
def test_rougher_levels_are_blurrier_and_as_bright_on_average() -> None:
    towards = np.array([0.0, 0.8, -0.6])
    levels = [np.array([decoded(png) for png in faces]) for faces in cubemap.levels(spot(128, towards, 30.0))]
    peaks = [float(level.max()) for level in levels]
    assert peaks == sorted(peaks, reverse=True)
    assert peaks[-1] < 0.5 * peaks[0]
    flat = [
        np.array([decoded(png) for png in faces]) for faces in cubemap.levels(np.full((64, 128, 3), 3.0, np.float32))
    ]
    for level in flat:
        np.testing.assert_allclose(level, 3.0, rtol=0.02)


def test_bright_light_survives_eight_bits() -> None:
    environment = np.full((64, 128, 3), 0.2, dtype=np.float32)
    environment[:32] = (40.0, 20.0, 10.0)
    up = decoded(next(iter(cubemap.levels(environment)))[2])
    assert up[64, 64] == pytest.approx([40.0, 20.0, 10.0], rel=0.05)


def test_harmonics_give_the_irradiance_in_mirrored_axes() -> None:
    """By the basis that Babylon.js evaluates, whose odd orders are negative."""
    towards = np.array([0.6, 0.48, -0.64])
    environment = spot(64, towards, 2.0)
    coefficients = np.array(cubemap.harmonics(environment))[:, 0]
    for normal in np.vstack([np.eye(3), -np.eye(3)]):
        x, y, z = normal * [-1, 1, 1]
        basis = [
            0.282095, -0.488603 * y, 0.488603 * z, -0.488603 * x,
            1.092548 * x * y, -1.092548 * y * z, 0.315392 * (3 * z * z - 1), -1.092548 * x * z,
            0.546274 * (x * x - y * y),
        ]  # fmt: skip
        cosine = np.maximum(latlong_directions(64) @ normal, 0) * latlong_solid_angle(64)[:, None]
        assert basis @ coefficients == pytest.approx((cosine * environment[..., 0]).sum(), rel=0.06)
