"""The USD stage, as OpenUSD itself reads it."""

import struct
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pxr import Gf, Usd, UsdGeom, UsdLux, UsdRender, UsdValidation

from lighting.errors import SceneError
from lighting.files.exr import read_exr
from lighting.geometry import latlong_directions
from lighting.scene import EXPORTERS, usd
from tests.helpers.scenes import save_files, shaded_spot_scene, sunlit_scene

BOTH_AXES = pytest.mark.parametrize("up_axis", EXPORTERS["usd"].options["up_axis"].choices)


def opened(folder: Path, up_axis: str) -> Any:
    folder.mkdir(exist_ok=True)
    save_files(folder, usd.encode_usd(sunlit_scene(), up_axis=up_axis))
    return Usd.Stage.Open(str(folder / usd.STAGE))


def complaints(stage: Any) -> list[str]:
    """What every validator that comes with OpenUSD has against a stage."""
    context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    return [error.GetErrorAsString() for error in context.Validate(stage)]


def ours(vector: Any, up_axis: str) -> NDArray[np.float64]:
    """A stage's vector, or three arrays of its coordinates, in our frame."""
    x, y, z = vector
    return np.array([x, z, -y] if up_axis == "Z" else [x, y, z])


def to_world(stage: Any, path: str) -> Any:
    return UsdGeom.Xformable(stage.GetPrimAtPath(path)).ComputeLocalToWorldTransform(Usd.TimeCode.Default())


@BOTH_AXES
def test_openusds_own_checker_finds_nothing(tmp_path: Path, up_axis: str) -> None:
    stage = opened(tmp_path, up_axis)
    assert complaints(stage) == []
    assert UsdGeom.GetStageUpAxis(stage) == up_axis
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1


@BOTH_AXES
def test_the_package_for_ar_holds_all_but_the_lights(tmp_path: Path, up_axis: str) -> None:
    scene = opened(tmp_path, up_axis)
    package = Usd.Stage.Open(str(tmp_path / usd.PACKAGE))
    assert complaints(package) == []
    assert UsdGeom.GetStageUpAxis(package) == "Y"
    of_lights = {"/World/Sky", "/World/Sun", "/Render", "/Render/Settings"}
    assert paths(scene) - paths(package) == of_lights
    assert paths(package) <= paths(scene)
    data = (tmp_path / usd.PACKAGE).read_bytes()
    with zipfile.ZipFile(tmp_path / usd.PACKAGE) as archive:
        assert archive.namelist() == ["scene.usda", "plate.png", "lit_ground.png"]
        for info in archive.infolist():
            name, extra = struct.unpack_from("<HH", data, info.header_offset + 26)
            assert (info.header_offset + 30 + name + extra) % 64 == 0
            assert info.compress_type == zipfile.ZIP_STORED


def paths(stage: Any) -> set[str]:
    return {str(prim.GetPath()) for prim in stage.Traverse()}


def test_the_checker_does_find_faults(tmp_path: Path) -> None:
    stage = opened(tmp_path, "Y")
    stage.ClearDefaultPrim()
    stage.GetPrimAtPath("/World/Ground").RemoveAPI("MaterialBindingAPI")
    (tmp_path / "environment.exr").unlink()
    assert len(complaints(stage)) >= 2


@BOTH_AXES
def test_the_camera_stands_and_sees_as_the_scene_says(tmp_path: Path, up_axis: str) -> None:
    scene = sunlit_scene()
    stage = opened(tmp_path, up_axis)
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/World/Camera")).GetCamera(Usd.TimeCode.Default())
    frustum = camera.frustum
    _, up, forward = scene.camera_axes
    assert ours(frustum.GetPosition(), up_axis) == pytest.approx(scene.camera_position, abs=1e-6)
    assert ours(frustum.ComputeViewDirection(), up_axis) == pytest.approx(forward, abs=1e-6)
    assert ours(frustum.ComputeUpVector(), up_axis) == pytest.approx(up, abs=1e-6)
    assert camera.GetFieldOfView(Gf.Camera.FOVVertical) == pytest.approx(scene.vertical_fov, abs=1e-4)
    assert camera.aspectRatio == pytest.approx(scene.width / scene.height, abs=1e-5)


@BOTH_AXES
def test_the_sun_shines_from_its_direction_with_its_irradiance(tmp_path: Path, up_axis: str) -> None:
    scene = sunlit_scene()
    stage = opened(tmp_path, up_axis)
    sun = UsdLux.DistantLight(stage.GetPrimAtPath("/World/Sun"))
    backwards = to_world(stage, "/World/Sun").TransformDir(Gf.Vec3d(0, 0, 1))  # it shines along -Z
    assert ours(backwards, up_axis) == pytest.approx(scene.sun_direction, abs=1e-6)
    assert sun.GetNormalizeAttr().Get() is True  # so that intensity is irradiance, whatever the angle
    irradiance = sun.GetIntensityAttr().Get() * 2 ** sun.GetExposureAttr().Get() * np.array(sun.GetColorAttr().Get())
    assert irradiance == pytest.approx(scene.sun_irradiance, rel=1e-5)
    assert sun.GetAngleAttr().Get() == pytest.approx(0.5358)


@BOTH_AXES
def test_where_the_spot_is_in_shade_the_sun_lights_the_ground_alone(tmp_path: Path, up_axis: str) -> None:
    (tmp_path / "shade").mkdir()
    save_files(tmp_path / "shade", usd.encode_usd(shaded_spot_scene(), up_axis=up_axis))
    shaded, lit = Usd.Stage.Open(str(tmp_path / "shade" / usd.STAGE)), opened(tmp_path / "sun", up_axis)
    assert complaints(shaded) == []
    parts = ("Ground", "YourObject", "YourObject/Ball", "YourObject/Stick", "YourObject/Mine")
    assert [is_lit(shaded, part) for part in parts] == [True, False, False, False, False]
    assert [is_lit(lit, part) for part in parts] == [True] * 5


def is_lit(stage: Any, part: str) -> bool:
    """By the sun."""
    link = UsdLux.LightAPI(stage.GetPrimAtPath("/World/Sun")).GetLightLinkCollectionAPI()
    return bool(link.ComputeMembershipQuery().IsPathIncluded(f"/World/{part}"))


@BOTH_AXES
def test_the_dome_shows_each_direction_where_it_is(tmp_path: Path, up_axis: str) -> None:
    """A map with one bright pixel, by OpenEXR's definition: +Z at the center, longitude falls to the right."""
    environment = np.zeros_like(sunlit_scene().environment)
    environment[30, 400] = 1.0
    save_files(tmp_path, usd.encode_usd(replace(sunlit_scene(), environment=environment), up_axis=up_axis))
    stage = Usd.Stage.Open(str(tmp_path / usd.STAGE))
    dome = UsdLux.DomeLight(stage.GetPrimAtPath("/World/Sky"))
    assert dome.GetTextureFormatAttr().Get() == "latlong"
    image, _ = read_exr(dome.GetTextureFileAttr().Get().resolvedPath)
    row, column = np.argwhere(image[..., 0])[0]
    latitude = np.pi * (0.5 - (row + 0.5) / image.shape[0])
    longitude = 2 * np.pi * (0.5 - (column + 0.5) / image.shape[1])
    local = [np.sin(longitude) * np.cos(latitude), np.sin(latitude), np.cos(longitude) * np.cos(latitude)]
    world = ours(to_world(stage, "/World/Sky").TransformDir(Gf.Vec3d(*local)), up_axis)
    assert world == pytest.approx(latlong_directions(len(environment))[30, 400], abs=1e-6)


@BOTH_AXES
def test_ground_and_placeholder_lie_where_the_scene_has_them(tmp_path: Path, up_axis: str) -> None:
    scene = sunlit_scene()
    placeholder = scene.placeholder
    stage = opened(tmp_path, up_axis)
    ball = to_world(stage, "/World/YourObject/Ball").ExtractTranslation()
    assert ours(ball, up_axis) == pytest.approx(scene.spot + placeholder.ball_center, abs=1e-6)
    contact = stage.GetPrimAtPath("/World/Ground").GetCustomDataByKey("contact")
    assert np.array(contact["center"]) == pytest.approx(np.array(ball), abs=1e-6)
    assert contact["radius"] == pytest.approx(placeholder.ball_radius)
    ground = np.array(UsdGeom.Mesh(stage.GetPrimAtPath("/World/Ground")).GetPointsAttr().Get())
    assert ours(ground.T, up_axis)[1] == pytest.approx(0, abs=1e-9)
    a, b, c = (ours(point, up_axis) for point in ground[:3])
    assert np.cross(b - a, c - a)[1] > 0  # faces up
    stick = UsdGeom.Imageable(stage.GetPrimAtPath("/World/YourObject/Stick"))
    box = stick.ComputeWorldBound(Usd.TimeCode.Default(), "default").ComputeAlignedRange()
    ends = sorted(ours(corner, up_axis)[1] for corner in (box.GetMin(), box.GetMax()))
    assert ends == pytest.approx([0, placeholder.stick_height], abs=1e-6)


def test_the_plate_is_a_guide_that_fills_the_view(tmp_path: Path) -> None:
    scene = sunlit_scene()
    stage = opened(tmp_path, "Y")
    plate = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Camera/Plate"))
    assert plate.GetPurposeAttr().Get() == "guide"
    x, y, z = np.array(plate.GetPointsAttr().Get()).T
    assert np.degrees(2 * np.arctan(y.max() / -z[0])) == pytest.approx(scene.vertical_fov, abs=1e-4)
    assert x.max() / y.max() == pytest.approx(scene.width / scene.height)
    settings = UsdRender.Settings(stage.GetPrimAtPath("/Render/Settings"))
    assert tuple(settings.GetResolutionAttr().Get()) == (scene.width, scene.height)


def test_without_direct_sun_the_light_stays_and_is_dark(tmp_path: Path) -> None:
    save_files(tmp_path, usd.encode_usd(replace(sunlit_scene(), sun_irradiance=np.zeros(3))))
    stage = Usd.Stage.Open(str(tmp_path / usd.STAGE))
    sun = UsdLux.DistantLight(stage.GetPrimAtPath("/World/Sun"))
    assert sun.GetIntensityAttr().Get() == 0
    assert tuple(sun.GetColorAttr().Get()) == (1, 1, 1)


def test_another_up_axis_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="must be Y or Z"):
        save_files(tmp_path, usd.encode_usd(sunlit_scene(), up_axis="X"))
    assert list(tmp_path.iterdir()) == []
