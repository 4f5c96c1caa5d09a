"""Path-traced sessions: meshes under the skies of a day, with light between their parts and the sky that they hide.

Mitsuba renders them (`pip install 'outdoor-lighting[test]'`). The camera is orthographic and level.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from export.stereo.renders import CaptureDay
from export.stereo.surfaces import TriangleMesh, read_mesh
from lighting.errors import require_extra
from lighting.geometry import Floats
from lighting.stereo.light_vectors import Skies
from lighting.stereo.solver import world_to_camera

_SIDE = 96  # pixels each way
_SAMPLES = 256  # paths for each pixel
_MAX_DEPTH = 5  # edges of a path
_MARGIN = 1.08  # of the picture, over the mesh's radius
_VARIANT = "scalar_rgb"


def trace_mesh(
    file: Path, rotation: Floats, day: CaptureDay, skies: Skies, albedo: float
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
    """Path-trace a mesh under each sky of a day.

    Args:
        file: an OBJ file.
        rotation: (3, 3) from the mesh's axes to the camera's.
        day: its pose is the camera's.
        skies: T skies of one channel.
        albedo: of the mesh, 0 to 1.

    Returns:
        Images (T, H, W, 1), true normals (H, W, 3) in the camera frame, and the mask (H, W).
    """
    mi = require_extra("mitsuba", "Path tracing needs Mitsuba", "test")
    mi.set_variant(_VARIANT)
    shape = _make_shape(mi, read_mesh(file), rotation, albedo)
    normals, mask = _trace_normals(mi, shape)
    images = [_trace_moment(mi, shape, skies, moment, day) for moment in range(len(skies))]
    return np.stack(images) * mask[None, :, :, None], normals, mask


def _make_shape(mi: Any, mesh: TriangleMesh, rotation: Floats, albedo: float) -> Any:
    points, triangles = mesh
    points = (points - (points.max(axis=0) + points.min(axis=0)) / 2) @ np.asarray(rotation, dtype=np.float32).T
    points = points / np.linalg.norm(points, axis=1).max()
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(
        {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": albedo}}}
    )
    shape = mi.Mesh("mesh", len(points), len(triangles), has_vertex_normals=True, props=properties)
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = np.ascontiguousarray(points, dtype=np.float32).ravel()
    parameters["faces"] = np.ascontiguousarray(triangles, dtype=np.uint32).ravel()
    parameters.update()
    shape.recompute_vertex_normals()
    return shape


def _sensor(mi: Any) -> dict[str, Any]:
    to_world = mi.ScalarTransform4f().look_at([0, 0, 4], [0, 0, 0], [0, 1, 0])
    return {
        "type": "orthographic",
        "to_world": to_world @ mi.ScalarTransform4f().scale([_MARGIN, _MARGIN, 1]),
        "film": {
            "type": "hdrfilm",
            "width": _SIDE,
            "height": _SIDE,
            "pixel_format": "rgb",
            "rfilter": {"type": "box"},
        },
    }


def _trace_normals(mi: Any, shape: Any) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    scene = mi.load_dict(
        {
            "type": "scene",
            "mesh": shape,
            "sensor": _sensor(mi),
            "integrator": {"type": "aov", "aovs": "normal:sh_normal,depth:depth"},
        }
    )
    planes = np.array(mi.render(scene, spp=64, seed=1))[..., -4:]
    normals = planes[..., :3]
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    mask = (length[..., 0] > 0.8) & (normals[..., 2] > 0.02)
    return np.asarray(normals / np.maximum(length, 1e-9) * mask[..., None], dtype=np.float32), mask


def _trace_moment(mi: Any, shape: Any, skies: Skies, moment: int, day: CaptureDay) -> NDArray[np.float32]:
    sun = world_to_camera(skies.sun_direction[moment], day.pose)
    sky = np.repeat(skies.radiance[moment], 3, axis=-1)
    scene = mi.load_dict(
        {
            "type": "scene",
            "mesh": shape,
            "sensor": _sensor(mi),
            "integrator": {"type": "path", "max_depth": _MAX_DEPTH, "hide_emitters": True},
            "sky": {
                "type": "envmap",
                "bitmap": mi.Bitmap(np.ascontiguousarray(sky)),
                "to_world": _sky_to_camera(mi, day),
            },
            "sun": {
                "type": "directional",
                "direction": (-sun).tolist(),
                "irradiance": {"type": "rgb", "value": float(skies.sun_irradiance[moment, 0])},
            },
        }
    )
    return np.array(mi.render(scene, spp=_SAMPLES, seed=2 + moment))[..., :1].astype(np.float32)


def _sky_to_camera(mi: Any, day: CaptureDay) -> Any:
    """Mitsuba's maps have +Z in the centre column; ours have north, -Z."""
    matrix = np.eye(4)
    matrix[:3, :3] = world_to_camera(np.diag([-1.0, 1.0, -1.0]), day.pose).T
    return mi.ScalarTransform4f(matrix)
