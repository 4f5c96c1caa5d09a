"""A scene as USD: `scene.usda` with the plate, the map and the record beside it.

Lights follow UsdLux: radiance 1 of the map is 1 nit, and a DistantLight with `normalize` gives an irradiance of
intensity x colour on a surface that faces it, whatever its angle. USD has neither background plates nor shadow catchers
of its own: the plate hangs before the camera as a guide, which renderers leave out, and the ground carries the primvars
by which Omniverse RTX and Karma know one; to others it is a diffuse plane of the ground's albedo.
"""

from collections.abc import Iterable
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.errors import SceneError
from lighting.scene.common import (
    ENVIRONMENT,
    FAR,
    GROUND_RADIUS,
    NEAR,
    PLACEHOLDER_ALBEDO,
    PLATE,
    SUN_ANGLE,
    Folder,
    Scene,
    colour_and_strength,
    to_z_up,
    write_shared_files,
)

STAGE = "scene.usda"
UP_AXES = ("Y", "Z")

_APERTURE_UNIT = 100.0  # mm: apertures and focal lengths are in tenths of the stage's unit, which is the metre


def write(scene: Scene, folder: Folder, *, up_axis: str = "Y") -> None:
    """Write STAGE and what it refers to; `up_axis` is Y or Z, SceneError for another.

    Where Z is up the camera looks along +Y at azimuth 0.
    """
    if up_axis not in UP_AXES:
        raise SceneError(f"The up axis {up_axis!r} is not known; it must be Y or Z.")
    write_shared_files(scene, folder)
    layout = Template((files("lighting") / "scene" / "data" / "scene.usda").read_text(encoding="utf-8"))
    (folder / STAGE).write_text(layout.substitute(_values(scene, up_axis)), encoding="utf-8")


def _values(scene: Scene, up_axis: str) -> dict[str, Any]:
    """What the layout's placeholders stand for; lengths in metres."""
    colour, intensity = colour_and_strength(scene.sun_irradiance)
    spot, up = scene.spot, np.array([0.0, 1.0, 0.0])
    edge = GROUND_RADIUS * np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]])
    picture = _picture_corners(scene)

    def placed(vectors: ArrayLike) -> NDArray[np.float64]:
        turned = to_z_up(np.asarray(vectors)) if up_axis == "Z" else vectors
        return np.asarray(turned, dtype=np.float64)

    return {
        "up_axis": up_axis,
        "resolution": f"({scene.width}, {scene.height})",
        "camera_matrix": _matrix(placed(scene.camera_matrix[:3].T)),
        "focal_length": _number(scene.focal_length / _APERTURE_UNIT),
        "horizontal_aperture": _number(scene.sensor_width / _APERTURE_UNIT),
        "vertical_aperture": _number(scene.sensor_width * scene.height / scene.width / _APERTURE_UNIT),
        "clipping": _vector([NEAR, FAR]),
        "plate": PLATE,
        "plate_points": _vectors(picture),
        "plate_extent": _extent(picture),
        "environment": ENVIRONMENT,
        "sky_matrix": _matrix(placed([[-1, 0, 0], [0, 1, 0], [0, 0, -1], [0, 0, 0]])),
        "sun_matrix": _matrix(placed(scene.sun_matrix[:3].T)),
        "sun_angle": _number(SUN_ANGLE),
        "sun_colour": _vector(colour),
        "sun_intensity": _number(intensity),
        "ground_points": _vectors(placed(edge)),
        "ground_extent": _extent(placed(edge)),
        "ground_normal": _vector(placed(up)),
        "ground_colour": _vector([scene.lighting.ground_albedo] * 3),
        "object_colour": _vector([PLACEHOLDER_ALBEDO] * 3),
        "spot": _vector(placed(spot)),
        "ball_centre": _vector(placed(scene.ball_centre - spot)),
        "ball_radius": _number(scene.ball_radius),
        "ball_extent": _extent(np.array([[-1.0] * 3, [1.0] * 3]) * scene.ball_radius),
        "stick_centre": _vector(placed(scene.stick_foot - spot + up * scene.stick_height / 2)),
        "stick_height": _number(scene.stick_height),
        "stick_radius": _number(scene.stick_radius),
        "stick_extent": _extent(placed(_stick_corners(scene))),
    }


def _picture_corners(scene: Scene) -> NDArray[np.float64]:
    """The plate's corners (4, 3) before the camera, in its own axes, from the lower left counter-clockwise."""
    half_height = GROUND_RADIUS * np.tan(np.radians(scene.vertical_fov) / 2)
    half_width = half_height * scene.width / scene.height
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return np.column_stack([signs * [half_width, half_height], np.full(4, -GROUND_RADIUS)])


def _stick_corners(scene: Scene) -> NDArray[np.float64]:
    corner = np.array([scene.stick_radius, scene.stick_height / 2, scene.stick_radius])
    return np.stack([-corner, corner])


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
