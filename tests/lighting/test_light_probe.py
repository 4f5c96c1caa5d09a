"""Light probes: their coefficients, those of engines, and the main light beside them."""

import json
import re
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lighting.color import luminance
from lighting.envmap.latlong import envmap_irradiance
from lighting.envmap.relighting import rotate_envmap, rotate_lighting
from lighting.envmap.render import render
from lighting.envmap.surroundings import PhotoContext, render_with_surroundings
from lighting.errors import ParameterError
from lighting.geometry import Floats, direction, latlong_directions, latlong_solid_angle
from lighting.light_probe import (
    LIGHT_PROBE_FORMATS,
    compute_light_probe,
    encode_light_probe,
    irradiance_from_harmonics,
    main_light,
    project_latlong,
    rotate_harmonics,
    shader_harmonics,
)
from lighting.records import Lighting, LightProbe
from tests.conftest import scene as picture
from tests.helpers.predictions import SUN_IRRADIANCE, UNIT_NORMALS, model_light, stated_light
from tests.helpers.requirements import require
from tests.helpers.scenes import harmonics

LIGHT = stated_light()
CONTEXT = PhotoContext(picture(64, 48), np.random.default_rng(2).uniform(0.1, 2, (12, 24, 3)).astype(np.float32))


def written(name: str, light: Lighting = LIGHT) -> Any:
    return json.loads(encode_light_probe(compute_light_probe(light), name))


def polynomials(normals: Floats) -> Floats:
    x, y, z = normals.T
    return np.stack([np.ones_like(x), y, z, x, x * y, y * z, 3 * z**2 - 1, x * z, x**2 - y**2], axis=-1)


@pytest.mark.parametrize("light", [LIGHT, model_light(elevation=60.0), stated_light(sky_cover=1.0)])
@pytest.mark.parametrize("context", [None, CONTEXT])
def test_level_ground_is_lit_as_by_the_map_without_the_sun(light: Lighting, context: PhotoContext | None) -> None:
    probe = compute_light_probe(light, context)
    if context is None:
        image = render(light, 128, disc=False)
    else:
        image = render_with_surroundings(light, context, 128, disc=False)
    exact = envmap_irradiance(image, UNIT_NORMALS)
    assert irradiance_from_harmonics(probe.coefficients, UNIT_NORMALS) == pytest.approx(
        exact, abs=0.06 * exact.max()
    )  # what order 2 leaves out


def test_the_main_light_is_the_sun() -> None:
    light = compute_light_probe(LIGHT).main_light
    assert light.direction == pytest.approx(direction(-41.2, 33.0))
    assert light.irradiance == pytest.approx(SUN_IRRADIANCE)
    assert light.kelvin is not None
    assert 3000 < light.kelvin < 5500  # red over blue is 2


@pytest.mark.parametrize("light", [replace(LIGHT, sun_elevation=-2.0), stated_light(sun_irradiance=(0.0, 0.0, 0.0))])
def test_without_a_sun_there_is_no_main_light(light: Lighting) -> None:
    dark = compute_light_probe(light).main_light
    assert (dark.irradiance.max(), dark.lux, dark.kelvin) == (0.0, 0.0, None)
    assert written("webxr", light)["primaryLightDirection"] == {"x": 0.0, "y": 1.0, "z": 0.0, "w": 0.0}
    assert written("webxr", light)["primaryLightIntensity"] == {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    assert main_light(LIGHT, sun=False).irradiance.max() == 0.0


@pytest.mark.parametrize(("elevation", "low", "high"), [(60.0, 85e3, 100e3), (20.0, 60e3, 80e3), (5.0, 15e3, 35e3)])
def test_a_clear_sun_has_the_lux_of_clear_suns(elevation: float, low: float, high: float) -> None:
    assert low < main_light(model_light(elevation=elevation)).lux < high
    assert main_light(replace(stated_light(elevation), exposure=1e-3)).lux < high  # as of no sun


def test_exposure_scales_the_probe_and_leaves_lux() -> None:
    dim, bright = (compute_light_probe(model_light(exposure=exposure)) for exposure in (0.5, 1000.0))
    assert bright.coefficients == pytest.approx(2000 * dim.coefficients, rel=2e-3)
    assert bright.main_light.lux == pytest.approx(dim.main_light.lux)


def test_lights_too_bright_for_a_map_have_a_probe() -> None:
    bright, plain = (compute_light_probe(model_light(exposure=exposure)) for exposure in (1e6, 1.0))
    assert bright.coefficients == pytest.approx(1e6 * plain.coefficients, rel=2e-3)


def test_a_turned_probe_is_that_of_the_turned_light() -> None:
    turned, expected = compute_light_probe(LIGHT, yaw=70.0), compute_light_probe(rotate_lighting(LIGHT, 70.0))
    assert turned.coefficients == pytest.approx(expected.coefficients, abs=2e-3)
    assert turned.main_light.direction == pytest.approx(expected.main_light.direction, abs=1e-5)


def test_another_sky_has_another_probe() -> None:
    overcast = compute_light_probe(replace(LIGHT, sky_painted="cie-overcast"))
    assert overcast.coefficients[[2, 3, 4, 5, 7]] == pytest.approx(0, abs=1e-4)  # it has no azimuth


def test_unknown_formats_are_refused() -> None:
    with pytest.raises(ParameterError, match="must be one of record, webxr"):
        encode_light_probe(compute_light_probe(LIGHT), "nuke")


# What each engine makes of its numbers, by the formulas in its documentation or source.


def filament_irradiance(normals: Floats) -> Floats:
    harmonics = np.reshape(written("filament")["indirectLight"]["irradiance"], (9, 3))
    return np.asarray(np.pi * polynomials(normals) @ harmonics)


def unity_irradiance(normals: Floats) -> Floats:
    left_handed = normals * [1, 1, -1]
    return np.asarray(np.pi * polynomials(left_handed) @ np.transpose(written("unity")["sphericalHarmonicsL2"]))


def planar_irradiance(normals: Floats) -> Floats:
    return irradiance_from_harmonics(np.reshape(written("arkit")["sphericalHarmonicsCoefficients"], (3, 9)).T, normals)


def godot_irradiance(normals: Floats) -> Floats:
    factors = np.array([0.886227, *[1.023327] * 3, 0.858086, 0.858086, 0.247708, 0.858086, 0.429043])
    return np.asarray(np.pi * (factors * polynomials(normals)) @ np.array(written("godot")["probe_sh"]))


def babylon_irradiance(normals: Floats) -> Floats:
    radiance = np.array(written("babylon")["sphericalHarmonics"])
    signs = np.array([1, -1, 1, -1, 1, -1, 1, -1, 1])[:, None]
    return irradiance_from_harmonics(signs * radiance, normals)


def interleaved_irradiance(name: str, *path: str) -> Any:
    def irradiance(normals: Floats) -> Floats:
        values = written(name)
        for key in path:
            values = values[key]
        return irradiance_from_harmonics(np.reshape(values, (9, 3)), normals)

    return irradiance


@pytest.mark.parametrize(
    "irradiance",
    [
        filament_irradiance,
        unity_irradiance,
        planar_irradiance,
        godot_irradiance,
        babylon_irradiance,
        interleaved_irradiance("webxr", "sphericalHarmonicsCoefficients"),
        interleaved_irradiance("threejs", "lightProbe", "sh"),
        interleaved_irradiance("arcore", "environmentalHdrAmbientSphericalHarmonics"),
    ],
)
def test_every_engine_sees_the_same_irradiance(irradiance: Any) -> None:
    assert irradiance(UNIT_NORMALS) == pytest.approx(
        irradiance_from_harmonics(compute_light_probe(LIGHT).coefficients, UNIT_NORMALS), rel=1e-3
    )


def test_threejs_and_babylon_have_that_irradiance() -> None:
    program, script = require("node"), Path(require("tests/node")).with_name("light_probe.cjs")
    data = {name: written(name) for name in ("threejs", "babylon")} | {"normals": UNIT_NORMALS.tolist()}
    command = [program, str(script)]
    result = subprocess.run(command, input=json.dumps(data), capture_output=True, text=True, check=True)
    by_engine = json.loads(result.stdout.splitlines()[-1])
    for name in ("threejs", "babylon"):
        expected = irradiance_from_harmonics(compute_light_probe(LIGHT).coefficients, UNIT_NORMALS)
        assert np.array(by_engine[name]) == pytest.approx(expected, rel=1e-3), name


def test_cmgen_of_filament_has_that_irradiance() -> None:
    """What `cmgen --sh=3 --sh-window=no --sh-shader --sh-irradiance` of Debian 12 (1.9.25) printed of this light's map.

    The map had 1,024 rows and was turned by 180 deg, since cmgen has +Z in the middle.
    """
    lines = (Path(__file__).parents[1] / "data" / "cmgen_sh.txt").read_text(encoding="utf-8").splitlines()
    printed = [re.findall(r"-?\d+\.\d+", line.split("//")[0]) for line in lines]
    by_cmgen = np.pi * polynomials(UNIT_NORMALS) @ np.array(printed, dtype=np.float64)
    assert filament_irradiance(UNIT_NORMALS) == pytest.approx(by_cmgen, rel=0.01)


def test_every_engine_sees_the_same_sun() -> None:
    towards, power = direction(-41.2, 33.0), np.array(SUN_IRRADIANCE)
    webxr, arcore, arkit = written("webxr"), written("arcore"), written("arkit")
    assert [webxr["primaryLightDirection"][axis] for axis in "xyzw"] == pytest.approx([*towards, 0.0], abs=1e-5)
    assert [webxr["primaryLightIntensity"][axis] for axis in "xyzw"] == pytest.approx([*power, 1.0])
    assert arcore["environmentalHdrMainLightDirection"] == pytest.approx(towards, abs=1e-5)
    assert arcore["environmentalHdrMainLightIntensity"] == pytest.approx(power)
    assert arkit["primaryLightDirection"] == pytest.approx(-towards, abs=1e-5)
    assert arkit["primaryLightIntensity"] == pytest.approx(1000 * luminance(power) / np.pi, rel=1e-4)
    three, filament, babylon = (written(n) for n in ("threejs", "filament", "babylon"))
    assert three["directionalLight"]["position"] == pytest.approx(towards, abs=1e-5)
    suns = (three["directionalLight"], "color"), (filament["sun"], "color"), (babylon["directionalLight"], "diffuse")
    for light, color in suns:
        assert np.array(light[color]) * light["intensity"] == pytest.approx(power, rel=1e-4)
    for light in (filament["sun"], babylon["directionalLight"], written("godot")["directional_light"]):
        assert light["direction"] == pytest.approx(-towards, abs=1e-5)
    unity = written("unity")["light"]
    assert unity["forward"] == pytest.approx(-towards * [1, 1, -1], abs=1e-5)
    assert np.array(unity["color"]) * unity["intensity"] == pytest.approx(power / np.pi, rel=1e-4)


def test_shader_harmonics_of_even_light_are_its_radiance() -> None:
    even = np.zeros((9, 3))
    even[0] = 2.0 * np.sqrt(4 * np.pi)
    assert shader_harmonics(even)[0] == pytest.approx(2.0)


def test_all_formats_are_json_of_finite_numbers() -> None:
    for name in LIGHT_PROBE_FORMATS:
        text = encode_light_probe(compute_light_probe(LIGHT), name)
        assert "NaN" not in text
        assert "Infinity" not in text
    assert isinstance(compute_light_probe(LIGHT), LightProbe)


RNG = np.random.default_rng(1)
MAP = RNG.random((32, 64, 3)).astype(np.float32)


def test_the_functions_are_orthonormal() -> None:
    basis = harmonics(latlong_directions(256))
    products = np.einsum("rci,rcj,r->ij", basis, basis, latlong_solid_angle(256))
    assert products == pytest.approx(np.eye(9), abs=1e-3)


def test_their_order_and_signs_are_those_of_webxr() -> None:
    """Each function alone gives its own value times that of the cosine's lobe."""
    lobe = np.pi * np.array([1, *[2 / 3] * 3, *[1 / 4] * 5])
    assert irradiance_from_harmonics(np.eye(9), UNIT_NORMALS) == pytest.approx(harmonics(UNIT_NORMALS) * lobe, abs=1e-5)


def test_coefficients_are_the_integrals_of_a_map() -> None:
    basis, weight = harmonics(latlong_directions(32)), latlong_solid_angle(32)
    expected = np.einsum("rcf,rck,r->fk", basis, MAP, weight, optimize=True)
    assert project_latlong(MAP) == pytest.approx(expected, abs=1e-5)


def test_irradiance_is_that_of_a_map_of_few_frequencies() -> None:
    coefficients = np.concatenate([[[4.0, 5.0, 6.0]], RNG.uniform(-1, 1, (8, 3))])
    image = (harmonics(latlong_directions(128)) @ coefficients).astype(np.float32)
    assert len(UNIT_NORMALS) == 14
    expected = envmap_irradiance(image, UNIT_NORMALS)
    assert irradiance_from_harmonics(coefficients, UNIT_NORMALS) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("yaw", [90.0, -45.0, 180.0, 5.625])
def test_a_rotated_map_has_rotated_coefficients(yaw: float) -> None:
    expected = project_latlong(rotate_envmap(MAP, yaw))
    assert rotate_harmonics(project_latlong(MAP), yaw) == pytest.approx(expected, abs=1e-5)
