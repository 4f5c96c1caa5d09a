import numpy as np
import pytest

from lighting.envmap.latlong import envmap_irradiance
from lighting.envmap.relighting import rotate_envmap
from lighting.geometry import latlong_directions, latlong_solid_angle
from lighting.light_probe import (
    harmonics_basis,
    irradiance_from_harmonics,
    project_latlong,
    rotate_harmonics,
)
from tests.helpers.lights import UNIT_NORMALS

RNG = np.random.default_rng(1)
MAP = RNG.random((32, 64, 3)).astype(np.float32)


def test_the_functions_are_orthonormal() -> None:
    basis = harmonics_basis(latlong_directions(256))
    products = np.einsum("rci,rcj,r->ij", basis, basis, latlong_solid_angle(256))
    assert products == pytest.approx(np.eye(9), abs=1e-3)


def test_their_order_and_signs_are_those_of_webxr() -> None:
    x, y, z = direction = np.array([0.48, 0.6, -0.64])
    expected = [
        0.282095, 0.488603 * y, 0.488603 * z, 0.488603 * x, 1.092548 * x * y, 1.092548 * y * z,
        0.315392 * (3 * z * z - 1), 1.092548 * x * z, 0.546274 * (x * x - y * y),
    ]  # fmt: skip
    assert harmonics_basis(direction) == pytest.approx(expected, rel=1e-5)


def test_coefficients_are_the_integrals_of_a_map() -> None:
    basis, weight = harmonics_basis(latlong_directions(32)), latlong_solid_angle(32)
    expected = np.einsum("rcf,rck,r->fk", basis, MAP, weight, optimize=True)
    assert project_latlong(MAP) == pytest.approx(expected, abs=1e-5)


def test_irradiance_is_that_of_a_map_of_few_frequencies() -> None:
    coefficients = np.concatenate([[[4.0, 5.0, 6.0]], RNG.uniform(-1, 1, (8, 3))])
    image = (harmonics_basis(latlong_directions(128)) @ coefficients).astype(np.float32)
    assert len(UNIT_NORMALS) == 14
    expected = envmap_irradiance(image, UNIT_NORMALS)
    assert irradiance_from_harmonics(coefficients, UNIT_NORMALS) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("yaw", [90.0, -45.0, 180.0, 5.625])
def test_a_rotated_map_has_rotated_coefficients(yaw: float) -> None:
    expected = project_latlong(rotate_envmap(MAP, yaw))
    assert rotate_harmonics(project_latlong(MAP), yaw) == pytest.approx(expected, abs=1e-5)
