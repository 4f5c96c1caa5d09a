"""The panel "Light from Photo" in the sidebars of the 3D view and of the image editor."""

from typing import Any

import bpy

from .drawing import LIGHTFROMPHOTO_OT_shadow as Draw
from .marks import is_guess
from .operators import LIGHTFROMPHOTO_OT_estimate as Estimate
from .operators import LIGHTFROMPHOTO_OT_forget as Forget
from .operators import LIGHTFROMPHOTO_OT_guess as Guess
from .operators import LIGHTFROMPHOTO_OT_pick as Pick
from .operators import LIGHTFROMPHOTO_OT_reset as Reset
from .operators import drawn_marks
from .skies import SLIDERS
from .trust import sun_labels, trust_line


class _Panel:
    bl_label = "Light from Photo"
    bl_region_type = "UI"
    bl_category = "Light"

    def draw(self, context: Any) -> None:
        """The buttons; once there is a light, how sure it is, what helps, and the sliders."""
        layout = self.layout  # type: ignore[attr-defined]
        layout.use_property_split = True
        layout.operator(Estimate.bl_idname, text="Pick a Photo…", icon="FILE_IMAGE")
        image = getattr(context.space_data, "image", None)
        if image is not None and image.source == "FILE" and image.filepath and not image.packed_file:
            operator = layout.operator(Estimate.bl_idname, text=f"Use {image.name}", icon="IMAGE_DATA")
            operator.filepath = image.filepath
        settings = context.scene.light_from_photo
        if settings.world is not None and settings.answer:
            _draw_answer(layout, settings, can_draw=context.space_data.type == "VIEW_3D")
        column = layout.column(align=True)
        column.active = settings.world is not None
        for name in SLIDERS:
            column.prop(settings, name, slider=True)
        column.prop(settings, "overcast")
        layout.operator(Reset.bl_idname, icon="LOOP_BACK")


def _draw_answer(layout: Any, settings: Any, *, can_draw: bool) -> None:
    """The line of trust, the suns to pick from, and what was drawn."""
    layout.label(text=trust_line(settings.answer), icon="LIGHT_SUN")
    column = layout.column(align=True)
    for number, label in enumerate(sun_labels(settings.answer), 1):
        column.operator(Pick.bl_idname, text=label, depress=number == max(settings.pick, 1)).number = number
    column = layout.column(align=True)
    if can_draw:
        column.operator_menu_enum(Draw.bl_idname, "kind", icon="GREASEPENCIL")
    if marks := drawn_marks(settings):
        if (guess := is_guess(marks[-1])) is not None:
            column.operator(Guess.bl_idname, depress=guess)
        column.operator(Forget.bl_idname, text=f"{len(marks)} drawn", icon="X")


class LIGHTFROMPHOTO_PT_view(_Panel, bpy.types.Panel):
    """In the 3D view."""

    bl_space_type = "VIEW_3D"


class LIGHTFROMPHOTO_PT_image(_Panel, bpy.types.Panel):
    """In the image editor."""

    bl_space_type = "IMAGE_EDITOR"


register, unregister = bpy.utils.register_classes_factory((LIGHTFROMPHOTO_PT_view, LIGHTFROMPHOTO_PT_image))
