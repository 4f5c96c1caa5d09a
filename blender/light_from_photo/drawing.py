"""Clicks on the photo behind the camera, which become a mark along a shadow."""

from typing import Any

import bpy
import gpu
from bpy_extras.view3d_utils import location_3d_to_region_2d
from gpu_extras.batch import batch_for_shader

from .marks import KINDS, Point, mark_text, photo_pixel
from .operators import drawn_marks, relight

_COLOR = (1.0, 0.72, 0.1, 1.0)
_MOVES_THE_VIEW = ("MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE", "TRACKPADPAN", "TRACKPADZOOM")


class LIGHTFROMPHOTO_OT_shadow(bpy.types.Operator):
    """Mark a shadow on the photo and estimate the light again; each mark adds to those before"""

    bl_idname = "light_from_photo.shadow"
    bl_label = "Draw a Shadow"
    bl_options = {"UNDO"}  # noqa: RUF012  # as Blender wants it

    kind: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Kind", items=[(name, kind.label, f"Click {', then '.join(kind.clicks)}") for name, kind in KINDS.items()]
    )
    mark: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Mark", description="In pixels of the upright photo, such as 310,820,455,790", options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Only where a photo was picked and its camera is left."""
        settings = context.scene.light_from_photo
        return settings.world is not None and bool(settings.camera and settings.camera.data.background_images)

    def invoke(self, context: Any, _event: Any) -> set[str]:
        """Look through the camera and wait for clicks."""
        if context.area is None or context.area.type != "VIEW_3D":
            self.report({"ERROR"}, "Shadows are drawn in the 3D view.")
            return {"CANCELLED"}
        space = context.space_data
        context.scene.camera = context.scene.light_from_photo.camera
        space.region_3d.view_perspective = "CAMERA"
        self._plate = context.scene.camera.data.background_images[0]
        self._shown = self._plate.display_depth, self._plate.alpha
        self._plate.display_depth, self._plate.alpha = "FRONT", 1.0  # else the ground hides the photo's shadows
        self._clicks: list[Point] = []
        self._region = next(region for region in context.area.regions if region.type == "WINDOW")
        self._view, self._mouse = space.region_3d, None
        self._drawing = bpy.types.SpaceView3D.draw_handler_add(self._draw, (), "WINDOW", "POST_PIXEL")
        context.window_manager.modal_handler_add(self)
        self._ask(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Take a click, or end."""
        context.area.tag_redraw()
        if event.type in ("ESC", "RIGHTMOUSE"):
            return self._end(context, {"CANCELLED"})
        if event.type in _MOVES_THE_VIEW:
            return {"PASS_THROUGH"}
        self._mouse = event.mouse_x - self._region.x, event.mouse_y - self._region.y
        if event.type == "LEFTMOUSE" and event.value == "PRESS":
            return self._click(context)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        """Estimate with the mark and all before."""
        settings = context.scene.light_from_photo
        return relight(self, context, settings.photo, (*drawn_marks(settings), self.mark))

    def _click(self, context: Any) -> set[str]:
        through_camera = self._view.view_perspective == "CAMERA"
        window = _photo_in_window(context, self._region, self._view) if through_camera else None
        pixel = photo_pixel(self._mouse, *window) if window else None
        if pixel is None:
            self.report({"WARNING"}, "Look through the camera, and click on the photo.")
            return {"RUNNING_MODAL"}
        self._clicks.append(pixel)
        if len(self._clicks) < len(KINDS[self.kind].clicks):
            self._ask(context)
            return {"RUNNING_MODAL"}
        self.mark = mark_text(self.kind, self._clicks)
        self._end(context, set())
        return self.execute(context)

    def _ask(self, context: Any) -> None:
        context.workspace.status_text_set(f"Click {KINDS[self.kind].clicks[len(self._clicks)]}.   Esc: leave it")

    def _end(self, context: Any, answer: set[str]) -> set[str]:
        bpy.types.SpaceView3D.draw_handler_remove(self._drawing, "WINDOW")
        context.workspace.status_text_set(None)
        self._plate.display_depth, self._plate.alpha = self._shown
        return answer

    def _draw(self) -> None:
        """The clicks, and a line from each to the next and to the mouse."""
        context = bpy.context
        if context.region != self._region or self._view.view_perspective != "CAMERA":
            return
        upper_left, lower_right, size = _photo_in_window(context, self._region, self._view)
        width, height = lower_right[0] - upper_left[0], upper_left[1] - lower_right[1]
        places = [(upper_left[0] + x / size[0] * width, upper_left[1] - y / size[1] * height) for x, y in self._clicks]
        shader = gpu.shader.from_builtin("UNIFORM_COLOR")
        shader.uniform_float("color", _COLOR)
        gpu.state.line_width_set(2.0)
        gpu.state.point_size_set(8.0)
        if places:
            batch_for_shader(shader, "POINTS", {"pos": places}).draw(shader)
        line = [*places, *([self._mouse] if self._mouse else [])]
        if len(line) > 1:
            batch_for_shader(shader, "LINE_STRIP", {"pos": line}).draw(shader)


def _photo_in_window(context: Any, region: Any, view: Any) -> tuple[Point, Point, tuple[int, int]]:
    """Upper left and lower right corner of the photo in a region, pixels; and columns and rows of the photo."""
    settings = context.scene.light_from_photo
    camera = settings.camera
    corners = [
        location_3d_to_region_2d(region, view, camera.matrix_world @ corner)
        for corner in camera.data.view_frame(scene=context.scene)
    ]
    left, right = (choose(corner.x for corner in corners) for choose in (min, max))
    lower, upper = (choose(corner.y for corner in corners) for choose in (min, max))
    return (left, upper), (right, lower), tuple(settings.photo_size)


register, unregister = bpy.utils.register_classes_factory((LIGHTFROMPHOTO_OT_shadow,))
