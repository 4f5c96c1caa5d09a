"""What the buttons do; each is one step of undo."""

import tempfile
from pathlib import Path
from typing import Any

import bpy
from bpy_extras.io_utils import ImportHelper

from .answers import PHOTOS, AnswerError, NoCommandError, from_command, from_service, is_serving_here
from .furnish import furnish, other_lights, spot_is_in_shade, spot_is_in_view
from .preferences import preferences
from .sliders import reset


class LIGHTFROMPHOTO_OT_estimate(bpy.types.Operator, ImportHelper):
    """Set camera, background, world, sun and shadow catcher to those of a photo"""

    bl_idname = "light_from_photo.estimate"
    bl_label = "Light from Photo"
    bl_options = {"UNDO"}  # noqa: RUF012  # as Blender wants it

    filter_glob: bpy.props.StringProperty(  # type: ignore[valid-type]
        default=";".join(f"*{suffix}" for suffix in PHOTOS), options={"HIDDEN"}
    )

    def execute(self, context: Any) -> set[str]:
        """Ask the command or the service, then change the scene, if there is an answer."""
        photo = Path(bpy.path.abspath(self.filepath))
        if not photo.is_file():
            self.report({"ERROR"}, f"There is no photo {photo}.")
            return {"CANCELLED"}
        with tempfile.TemporaryDirectory() as folder:
            try:
                _ask(photo, Path(folder))
            except AnswerError as error:
                self.report({"ERROR"}, str(error))
                return {"CANCELLED"}
            record = furnish(context.scene, Path(folder))
        sun = record["sun"]
        side = "right" if sun["azimuth"] >= 0 else "left"
        self.report({"INFO"}, f"Sun {abs(sun['azimuth']):.0f}° {side}, {sun['elevation']:.0f}° high")
        for warning in record.get("warnings", []):
            self.report({"WARNING"}, str(warning))
        if not spot_is_in_view(context.scene):
            self.report({"WARNING"}, "Your object would stand below the picture's edge.")
        if spot_is_in_shade(context.scene):
            self.report({"WARNING"}, "Your object is in the photo's shade: the sun lights only the ground.")
        if others := other_lights(context.scene):
            self.report({"WARNING"}, f"The scene has light that the photo has not; delete it: {', '.join(others)}.")
        return {"FINISHED"}


def _ask(photo: Path, folder: Path) -> None:
    chosen = preferences()
    if chosen.source == "COMMAND":
        try:
            from_command(chosen.command, photo, folder)
        except NoCommandError:
            if not (bpy.app.online_access and is_serving_here(chosen.address)):
                raise
            from_service(chosen.address, chosen.key, photo, folder)
    elif not bpy.app.online_access:
        raise AnswerError("A service needs online access: Preferences, System, Network, Allow Online Access.")
    else:
        from_service(chosen.address, chosen.key, photo, folder)


class LIGHTFROMPHOTO_OT_reset(bpy.types.Operator):
    """Put all sliders back to what was estimated"""

    bl_idname = "light_from_photo.reset"
    bl_label = "As Estimated"
    bl_options = {"UNDO"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Only where a photo was picked."""
        return context.scene.light_from_photo.world is not None

    def execute(self, context: Any) -> set[str]:
        """Move the sliders."""
        reset(context.scene.light_from_photo)
        return {"FINISHED"}


register, unregister = bpy.utils.register_classes_factory((LIGHTFROMPHOTO_OT_estimate, LIGHTFROMPHOTO_OT_reset))
