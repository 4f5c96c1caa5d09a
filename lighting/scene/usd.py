"""A scene as USD: `scene.usda` with the plate, the map and the record beside it.

Lights follow UsdLux: radiance 1 of the map is 1 nit. A DistantLight with `normalize` gives an irradiance of intensity x
color on a surface that faces it, whatever its angle. Focal length and apertures are in tenths of the stage's unit, the
meter, as UsdGeomCamera has them: 22.8 mm is 0.228. The USDZ is for AR, which takes no lights: of both files, the rules
of ARKit in OpenUSD's ComplianceChecker pass this one alone.

USD has no background plates: the plate hangs before the camera as a guide, which renderers leave out. It has no shadow
catchers: the ground carries the primvars by which Omniverse RTX and Karma know one. To other renderers the ground is a
diffuse plane of its albedo. `customData` of the plate names `lit_ground.png`, where on it the sun's shadows
may fall, and that of `YourObject` says whether it stands in the photo's shade.
"""

import io
import re
import struct
import zipfile
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from lighting.color import color_and_intensity
from lighting.errors import ErrorCode, SceneError
from lighting.geometry import Floats, to_z_up
from lighting.scene import ENVIRONMENT, LIT_GROUND, PLATE, records
from lighting.scene.writer import Files, encode_shared_files, fill_template

STAGE, SHOT_STAGE, DAY_STAGE, PACKAGE = "scene.usda", "shot.usda", "day.usda", "scene.usdz"

_APERTURE_UNIT = 100.0  # mm: apertures and focal lengths are in tenths of the stage's unit, which is the meter
_UP = np.array([0.0, 1.0, 0.0])
_RENDER_SETTINGS = '    renderSettingsPrimPath = "/Render/Settings"\n'
_ZIP_HEADER = 30 + 4  # bytes of a file's header in a ZIP archive, and of its extra field's header
_ZIP_PADDING = 0x1986  # the extra field that OpenUSD pads with


def encode_usd(scene: records.Scene, *, up_axis: str = "Y") -> Files:
    """Return STAGE and the files it refers to, and PACKAGE, which holds its camera, plate and geometry.

    Args:
        scene: made by `make_scene`.
        up_axis: of STAGE: "Y", or "Z", where the camera looks along +Y at azimuth 0.

    Raises:
        SceneError: `up_axis` is neither Y nor Z.
    """
    if up_axis not in ("Y", "Z"):
        raise SceneError(f"The up axis {up_axis!r} is not known; it must be Y or Z.", "up_axis", ErrorCode.UNKNOWN)
    shared = encode_shared_files(scene)
    stage = fill_template("scene.usda", _values(scene, up_axis))
    geometry = _without_lights(fill_template("scene.usda", _values(scene, "Y")).decode())
    package = {STAGE: geometry.encode(), **{name: shared[name] for name in (PLATE, LIT_GROUND)}}
    return {**shared, STAGE: stage, PACKAGE: _pack_usdz(package)}


def _without_lights(stage: str) -> str:
    """The text of a stage without its lights and settings of a renderer, which AR does not take."""
    prims = r'^( *)def (?:DomeLight|DistantLight|Scope) "(?:Sky|Sun|Render)".*?^\1}\n'
    return re.sub(prims, "", stage, flags=re.MULTILINE | re.DOTALL).replace(_RENDER_SETTINGS, "")


def _pack_usdz(members: dict[str, bytes]) -> bytes:
    """A ZIP archive without compression, whose files begin at multiples of 64 bytes; the stage is the first.

    References:
        Usdz File Format Specification, OpenUSD.
    """
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
        for name, data in members.items():
            info = zipfile.ZipInfo(name)  # of 1980, so that the same scene makes the same bytes
            padding = -(stream.tell() + _ZIP_HEADER + len(name)) % 64
            info.extra = struct.pack("<HH", _ZIP_PADDING, padding) + bytes(padding)
            archive.writestr(info, data)
    return stream.getvalue()


def animate_usd(motion: records.CameraMotion) -> dict[str, str]:
    """SHOT_STAGE, which lays time samples over STAGE.

    Args:
        motion: of the camera.
    """
    samples = _samples(motion.frames, map(_rows, motion.matrices))
    lens = _samples(motion.frames, (f"{length:.6g}" for length in motion.focal_lengths / _APERTURE_UNIT))
    camera = f"""
    over "Camera"
    {{
        float focalLength.timeSamples = {{
{lens}
        }}
        matrix4d xformOp:transform.timeSamples = {{
{samples}
        }}
    }}
"""
    return {SHOT_STAGE: _overlay(camera, (0.0, motion.frames[-1]), motion.frame_rate)}


def animate_usd_sun(path: records.SunPath) -> dict[str, str]:
    """DAY_STAGE, which lays a day over STAGE: time codes are hours since midnight, and one takes a second.

    Whether the photo's spot lies in shade counts no more: the sun lights all.

    Args:
        path: of the sun.
    """
    colors, intensities = zip(*map(color_and_intensity, path.irradiances), strict=True)
    maps = _samples(np.array(list(path.maps)), (f"@./{name}@" for name in path.maps.values()))
    lights = f"""
    over "Sky"
    {{
        asset inputs:texture:file.timeSamples = {{
{maps}
        }}
    }}

    over "Sun"
    {{
        color3f inputs:color.timeSamples = {{
{_samples(path.hours, map(_vector, colors))}
        }}
        float inputs:intensity.timeSamples = {{
{_samples(path.hours, map(_number, intensities))}
        }}
        uniform bool collection:lightLink:includeRoot = 1
        rel collection:lightLink:includes = []
        uniform bool collection:shadowLink:includeRoot = 1
        matrix4d xformOp:transform.timeSamples = {{
{_samples(path.hours, map(_rows, path.matrices))}
        }}
    }}
"""
    return {DAY_STAGE: _overlay(lights, (path.hours[0], path.hours[-1]), 1.0)}


def _overlay(world: str, codes: tuple[float, float], rate: float) -> str:
    """The text of a stage that lays opinions about the World over STAGE.

    Args:
        world: of them.
        codes: first and last time code.
        rate: of time codes, Hz.
    """
    return f"""#usda 1.0
(
    defaultPrim = "World"
    endTimeCode = {codes[-1]:.6g}
    framesPerSecond = {rate:.6g}
    metersPerUnit = 1
    renderSettingsPrimPath = "/Render/Settings"
    startTimeCode = {codes[0]:.6g}
    subLayers = [@./scene.usda@]
    timeCodesPerSecond = {rate:.6g}
    upAxis = "Y"
)

over "World"
{{{world}}}
"""


def _samples(codes: Floats, values: Iterable[str]) -> str:
    return "\n".join(f"            {code:.6g}: {value}," for code, value in zip(codes, values, strict=True))


def _rows(matrix: Floats) -> str:
    """A matrix (4, 4) for column vectors as USD writes it: rows of row vectors."""
    rows = (", ".join(f"{float(v) + 0.0:.9g}" for v in row) for row in matrix.T)
    return f"( {', '.join(f'({row})' for row in rows)} )"


def _values(scene: records.Scene, up_axis: str) -> dict[str, object]:
    """The values of the placeholders in data/scene.usda; lengths in meters."""
    to_stage = to_z_up(np.eye(3)) if up_axis == "Z" else np.eye(3)  # from our frame, for row vectors
    return {
        "up_axis": up_axis,
        "environment": ENVIRONMENT,
        "plate": PLATE,
        "lit_ground": LIT_GROUND,
        **_camera_values(scene, to_stage),
        **_light_values(scene, to_stage),
        **_ground_values(scene, to_stage),
        **_object_values(scene, to_stage),
    }


def _camera_values(scene: records.Scene, to_stage: Floats) -> dict[str, str]:
    picture = _picture_corners(scene)
    return {
        "resolution": f"({scene.width}, {scene.height})",
        "camera_matrix": _matrix(scene.camera_matrix[:3].T @ to_stage),
        "focal_length": _number(scene.focal_length / _APERTURE_UNIT),
        "horizontal_aperture": _number(scene.sensor_width / _APERTURE_UNIT),
        "vertical_aperture": _number(scene.sensor_width * scene.height / scene.width / _APERTURE_UNIT),
        "clipping": _vector([records.NEAR, records.FAR]),
        "plate_points": _vectors(picture),
        "plate_extent": _extent(picture),
    }


def _light_values(scene: records.Scene, to_stage: Floats) -> dict[str, object]:
    color, intensity = color_and_intensity(scene.sun_irradiance)
    return {
        "sky_matrix": _matrix(np.array([[-1, 0, 0], [0, 1, 0], [0, 0, -1], [0, 0, 0]]) @ to_stage),
        "sun_matrix": _matrix(scene.sun_matrix[:3].T @ to_stage),
        "sun_angle": _number(records.SUN_ANGLE),
        "sun_colour": _vector(color),
        "sun_intensity": _number(intensity),
        "sun_on_all": int(not scene.spot_in_shade),
        "sun_on": "</World/Ground>" if scene.spot_in_shade else "[]",
    }


def _ground_values(scene: records.Scene, to_stage: Floats) -> dict[str, str]:
    corners = records.GROUND_RADIUS * np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]]) @ to_stage
    return {
        "ground_points": _vectors(corners),
        "ground_extent": _extent(corners),
        "ground_normal": _vector(_UP @ to_stage),
        "ground_colour": _vector(scene.ground),
    }


def _object_values(scene: records.Scene, to_stage: Floats) -> dict[str, str]:
    placeholder = scene.placeholder
    corner = np.array([placeholder.stick_radius, placeholder.stick_height / 2, placeholder.stick_radius])
    return {
        "object_colour": _vector([records.PLACEHOLDER_ALBEDO] * 3),
        "spot": _vector(scene.spot @ to_stage),
        "spot_in_shade": str(int(scene.spot_in_shade)),
        "ball_centre": _vector(placeholder.ball_center @ to_stage),
        "contact_center": _vector((scene.spot + placeholder.ball_center) @ to_stage),
        "ball_radius": _number(placeholder.ball_radius),
        "ball_extent": _extent(np.array([[-1.0] * 3, [1.0] * 3]) * placeholder.ball_radius),
        "stick_centre": _vector(placeholder.stick_center @ to_stage),
        "stick_height": _number(placeholder.stick_height),
        "stick_radius": _number(placeholder.stick_radius),
        "stick_extent": _extent(np.stack([-corner, corner]) @ to_stage),
    }


def _picture_corners(scene: records.Scene) -> NDArray[np.float64]:
    """The plate's corners (4, 3) before the camera, in its own axes, from the lower left counter-clockwise."""
    half_height = records.GROUND_RADIUS * np.tan(np.radians(scene.vertical_fov) / 2)
    half_width = half_height * scene.width / scene.height
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return np.column_stack([signs * [half_width, half_height], np.full(4, -records.GROUND_RADIUS)])


def _matrix(rows: NDArray[np.float64]) -> str:
    """Axes and origin (4, 3) as USD writes them: row vectors."""
    return f"({', '.join(_vector([*row, last]) for row, last in zip(rows, (0, 0, 0, 1), strict=True))})"


def _extent(points: NDArray[np.float64]) -> str:
    return _vectors(np.stack([points.min(axis=0), points.max(axis=0)]))


def _vectors(points: Iterable[Iterable[float]]) -> str:
    return f"[{', '.join(map(_vector, points))}]"


def _vector(values: Iterable[float]) -> str:
    return f"({', '.join(map(_number, values))})"


def _number(value: float) -> str:
    return f"{float(value) + 0.0:.9g}"  # + 0.0 turns -0 into 0
