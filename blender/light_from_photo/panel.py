"""The panel "Light from Photo" in the sidebars of the 3D view and of the image editor."""

from typing import Any

import bpy

from .operators import LIGHTFROMPHOTO_OT_estimate as Estimate
from .operators import LIGHTFROMPHOTO_OT_reset as Reset
from .skies import SLIDERS


class _Panel:
    bl_label = "Light from Photo"
    bl_region_type = "UI"
    bl_category = "Light"

    def draw(self, context: Any) -> None:
        """The buttons, and the sliders once there is a light."""
        layout = self.layout  # type: ignore[attr-defined]
        layout.use_property_split = True
        layout.operator(Estimate.bl_idname, text="Pick a Photo…", icon="FILE_IMAGE")
        image = getattr(context.space_data, "image", None)
        if image is not None and image.source == "FILE" and image.filepath and not image.packed_file:
            operator = layout.operator(Estimate.bl_idname, text=f"Use {image.name}", icon="IMAGE_DATA")
            operator.filepath = image.filepath
        settings = context.scene.light_from_photo
        column = layout.column(align=True)
        column.active = settings.world is not None
        for name in SLIDERS:
            column.prop(settings, name, slider=True)
        column.prop(settings, "overcast")
        layout.operator(Reset.bl_idname, icon="LOOP_BACK")


class LIGHTFROMPHOTO_PT_view(_Panel, bpy.types.Panel):
    """In the 3D view."""

    bl_space_type = "VIEW_3D"


class LIGHTFROMPHOTO_PT_image(_Panel, bpy.types.Panel):
    """In the image editor."""

    bl_space_type = "IMAGE_EDITOR"


register, unregister = bpy.utils.register_classes_factory((LIGHTFROMPHOTO_PT_view, LIGHTFROMPHOTO_PT_image))
