"""A sun that half floats would not hold is spread, and lights as before."""

import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import lighting.envmap.latlong as latlong
import lighting.envmap.render as render_module
import lighting.envmap.sun_disc as sun_disc
from lighting.cli import cli
from lighting.envmap.render import render, with_irradiance
from lighting.envmap.surroundings import PhotoContext, render_view
from lighting.errors import ParameterError
from lighting.files import MAP_FORMATS
from lighting.geometry import Floats, angle_between, latlong_directions, latlong_solid_angle
from lighting.records import Lighting
from lighting.sky import SKY_MODELS
from tests.conftest import scene

HALF = 65504.0
TOLERANCE = 0.02  # stops


def light_of(elevation: float, exposure: float, **fields: Any) -> Lighting:
    return Lighting(
        sun_azimuth=37.3, sun_elevation=elevation, turbidity=3.0, exposure=exposure, camera_elevation=0.0,
        camera_roll=0.0, vertical_fov=60.0, sun_visibility=1.0, **fields,
    )  # fmt: skip


def irradiances(image: Floats, light: Lighting) -> Floats:
    """(2, 3) of a surface that faces the sun, and of level ground from above."""
    directions, weight = latlong_directions(len(image)), latlong_solid_angle(len(image))[:, None]
    cosines = np.maximum(np.stack([directions @ light.sun_direction, directions[..., 1]]), 0.0) * weight
    return np.tensordot(cosines, image.astype(np.float64), 2)


def unlimited(light: Lighting, height: int, monkeypatch: pytest.MonkeyPatch) -> Floats:
    """The map as it was before values ended."""
    with monkeypatch.context() as patch:
        for module in (latlong, render_module, sun_disc):
            patch.setattr(module, "MAX_RADIANCE", float("inf"))
        return render(light, height)


CASES = list(itertools.product((64, 256, 512), (0.1, 2.0, 12.0, 45.0, 89.8), (4.0, 300.0, 4000.0)))


@pytest.mark.parametrize(("height", "elevation", "exposure"), CASES)
def test_no_value_is_over_a_half_float_and_irradiances_stay(
    height: int, elevation: float, exposure: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    light = light_of(elevation, exposure)
    image, before = render(light, height), unlimited(light, height, monkeypatch)
    assert image.max() <= HALF
    assert np.isfinite(image.astype(np.float16)).all()
    assert image.min() >= 0
    change = np.log2(irradiances(image, light) / irradiances(before, light))
    assert np.abs(change).max() < TOLERANCE
    if before.max() <= HALF:
        assert np.array_equal(image, before)


def test_large_maps_hold_a_wider_sun(monkeypatch: pytest.MonkeyPatch) -> None:
    light = with_irradiance(light_of(40.0, 20.0))
    image, before = render(light, 2048), unlimited(light, 2048, monkeypatch)
    assert before.max() > HALF >= image.max() > 0.8 * HALF
    assert np.abs(np.log2(irradiances(image, light) / irradiances(before, light))).max() < 0.002
    wide = latlong_directions(2048)[(image - render(light, 2048, disc=False)).max(axis=-1) > 1.0]
    assert 0.3 < angle_between(wide, light.sun_direction).max() < 1.0


@pytest.mark.parametrize("sky", ["lalonde-matthews", "prague", "cie-12"])
def test_other_skies_end_there_too(sky: str) -> None:
    assert sky in SKY_MODELS
    light = with_irradiance(light_of(35.0, 900.0))
    image, _ = render_view(light, 256, sky=sky)
    assert image.max() <= HALF
    level = irradiances(image, light)[1]
    expected = np.array(light.sky_irradiance) + np.array(light.sun_irradiance) * light.sun_direction[1]
    assert np.abs(np.log2(level / expected)).max() < (0.3 if sky == "lalonde-matthews" else 0.05)  # a glow is wide


def test_surroundings_and_turned_maps_end_there_too() -> None:
    light = with_irradiance(light_of(35.0, 40.0))
    context = PhotoContext(scene(96, 64))
    image, _ = render_view(light, 512, context=context, yaw=33.3)
    assert 0.5 * HALF < image.max() <= HALF


@pytest.mark.parametrize("stated", [False, True])
def test_a_light_that_no_map_holds_is_refused(stated: bool) -> None:
    light = light_of(35.0, 9e5)
    if stated:
        light = light_of(35.0, 4.0, sun_irradiance=(1e6,) * 3, sky_irradiance=(1e6,) * 3)
    with pytest.raises(ParameterError, match=r"too bright for a map, whose values end at 65280") as caught:
        render(light, 64)
    assert caught.value.field == "exposure"


def test_a_bright_sky_keeps_its_irradiance() -> None:
    levels = latlong.row_irradiance(64)[:32]
    rows = np.full((32, 128, 3), 20_000.0, np.float32)
    rows[10:14, 40:50] = (2e5, 1e5, 3e4)
    before = latlong.irradiance_from_rows(levels, rows)
    latlong.cap_radiance(levels, rows)
    assert rows.max() <= HALF
    assert latlong.irradiance_from_rows(levels, rows) == pytest.approx(before, rel=2e-3)
    with pytest.raises(ParameterError, match="too bright"):
        latlong.cap_radiance(levels, rows * np.float32(5))


@pytest.mark.parametrize("name", ["sky.exr", "sky.hdr"])
def test_the_command_writes_such_a_map(tmp_path: Path, name: str) -> None:
    record = tmp_path / "light.json"
    record.write_text(json.dumps(with_irradiance(light_of(40.0, 20.0)).to_dict()))
    arguments = ["render", str(record), "--height", "512", "-o", str(tmp_path / name)]
    assert CliRunner().invoke(cli, arguments).exit_code == 0
    read = MAP_FORMATS[name[-3:]].read
    assert read is not None
    assert 0.5 * HALF < read((tmp_path / name).read_bytes()).max() <= HALF
