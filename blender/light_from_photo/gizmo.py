"""The sun as a ball to drag on a dome over the spot, in the 3D view."""

import math
from typing import Any

import bpy
from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d
from mathutils import Matrix, Vector

from .dome import RADIUS, meet_dome, sun_angles, sun_direction
from .sliders import turn_sun

_BALL = 0.06  # radius of the ball, in radii of the dome
_STEPS = 48  # of a circle
_SNAP = 5.0  # deg, with Ctrl
_COLOR, _BRIGHT = (1.0, 0.72, 0.1), (1.0, 0.9, 0.5)


def dome_of(settings: Any) -> tuple[Any, float]:
    """Center and radius of the dome: over the spot, or over the scene's origin where that is deleted."""
    eye = settings.camera.matrix_world.translation if settings.camera else Vector((0.0, 0.0, 1.6))
    center = settings.spot.matrix_world.translation if settings.spot else Vector((0.0, 5.0, 0.0))
    return center, RADIUS * max((center - eye).length, 0.1)


class LIGHTFROMPHOTO_GT_sun(bpy.types.Gizmo):
    """The ball, its line to the spot, and the horizon's circle."""

    bl_idname = "LIGHTFROMPHOTO_GT_sun"
    __slots__ = ("_ball", "_circle", "_line", "_misses", "_near", "_start")

    def setup(self) -> None:
        """Called by Blender once there is a window."""
        self._ball = self.new_custom_shape("TRIS", _ball_corners())
        turns = [2 * math.pi * step / _STEPS for step in range(_STEPS)]
        ends = [turn + part for turn in turns for part in (0.0, 2 * math.pi / _STEPS)]
        self._circle = self.new_custom_shape("LINES", [(math.cos(end), math.sin(end), 0.0) for end in ends])
        self._line = self.new_custom_shape("LINES", [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0)])

    def draw(self, context: Any) -> None:
        """Called by Blender for each picture."""
        settings = context.scene.light_from_photo
        center, radius = dome_of(settings)
        sun = Vector(sun_direction(settings.sun_azimuth, settings.sun_elevation))
        dome = Matrix.Translation(center) @ Matrix.Scale(radius, 4)
        self.draw_custom_shape(self._circle, matrix=dome)
        self.draw_custom_shape(self._line, matrix=dome @ sun.to_track_quat("Z", "Y").to_matrix().to_4x4())
        self.draw_custom_shape(self._ball, matrix=dome @ _ball_matrix(sun))

    def draw_select(self, context: Any, select_id: int) -> None:
        """Called by Blender to find what is under the mouse: the ball alone can be dragged."""
        settings = context.scene.light_from_photo
        center, radius = dome_of(settings)
        sun = Vector(sun_direction(settings.sun_azimuth, settings.sun_elevation))
        matrix = Matrix.Translation(center) @ Matrix.Scale(radius, 4) @ _ball_matrix(sun)
        self.draw_custom_shape(self._ball, matrix=matrix, select_id=select_id)

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Begin to drag, on the side of the dome where the ball is."""
        settings = context.scene.light_from_photo
        self._start = settings.sun_azimuth, settings.sun_elevation
        _, sight = _line_of_sight(context, event)
        self._near = sight.dot(Vector(sun_direction(*self._start))) < 0
        self._misses = False
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any, tweak: set[str]) -> set[str]:
        """Take the sun to where the mouse is; over the rim it comes to the other side of the dome."""
        settings = context.scene.light_from_photo
        center, radius = dome_of(settings)
        hit = meet_dome(*_line_of_sight(context, event), center, radius, near=self._near)
        if hit.misses and not self._misses:
            self._near = not self._near
        self._misses = hit.misses
        azimuth, elevation = sun_angles(hit.direction)
        if "SNAP" in tweak:
            azimuth, elevation = (_SNAP * round(angle / _SNAP) for angle in (azimuth, elevation))
        turn_sun(settings, azimuth, elevation)
        context.area.header_text_set(f"Sun {settings.sun_azimuth:.1f}°, {settings.sun_elevation:.1f}° high")
        return {"RUNNING_MODAL"}

    def exit(self, context: Any, cancel: bool) -> None:
        """End: back to where it was, or one step of undo."""
        context.area.header_text_set(None)
        if cancel:
            turn_sun(context.scene.light_from_photo, *self._start)
        else:
            bpy.ops.ed.undo_push(message="Turn the Sun")


class LIGHTFROMPHOTO_GGT_sun(bpy.types.GizmoGroup):
    """Where a photo's light is set up and its sun is seen."""

    bl_idname = "LIGHTFROMPHOTO_GGT_sun"
    bl_label = "Sun of the Photo"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options = {"3D", "PERSISTENT"}  # noqa: RUF012  # as Blender wants it

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Whether there is a sun to turn."""
        settings = context.scene.light_from_photo
        return bool(settings.world and settings.sun and settings.sun.visible_get())

    def setup(self, _context: Any) -> None:
        """Make the ball."""
        ball = self.gizmos.new(LIGHTFROMPHOTO_GT_sun.bl_idname)
        ball.use_draw_modal = True
        ball.color, ball.alpha = _COLOR, 0.9
        ball.color_highlight, ball.alpha_highlight = _BRIGHT, 1.0


def _line_of_sight(context: Any, event: Any) -> tuple[Any, Any]:
    """Origin and direction, both (3,), of the line behind the mouse."""
    region, view, place = context.region, context.region_data, (event.mouse_region_x, event.mouse_region_y)
    return region_2d_to_origin_3d(region, view, place), region_2d_to_vector_3d(region, view, place)


def _ball_matrix(sun: Any) -> Any:
    return Matrix.Translation(sun) @ Matrix.Scale(_BALL, 4)


def _ball_corners() -> list[tuple[float, float, float]]:
    """The corners of an octahedron's triangles, split twice and blown up to a ball of radius 1."""
    axes = [Vector(axis) for axis in ((1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0))]
    faces = [(axes[i], axes[(i + 1) % 4], Vector((0, 0, pole))) for i in range(4) for pole in (1, -1)]
    for _ in range(2):
        faces = [part for face in faces for part in _split(*face)]
    return [tuple(corner.normalized()) for face in faces for corner in face]


def _split(a: Any, b: Any, c: Any) -> list[tuple[Any, Any, Any]]:
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    return [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]


register, unregister = bpy.utils.register_classes_factory((LIGHTFROMPHOTO_GT_sun, LIGHTFROMPHOTO_GGT_sun))
