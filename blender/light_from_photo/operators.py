"""What the buttons do; each is one step of undo."""

import tempfile
from pathlib import Path
from typing import Any

import bpy
from bpy_extras.io_utils import ImportHelper

from .answers import (
    PHOTOS,
    AnswerError,
    NoCommandError,
    Stated,
    find_command,
    find_service,
    from_command,
    from_service,
    is_here,
    version_of,
)
from .furnish import furnish, other_lights, spot_is_in_shade, spot_is_in_view
from .marks import is_guess, turn_guess
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
        return relight(self, context, bpy.path.abspath(self.filepath))


def relight(operator: Any, context: Any, photo: str, marks: tuple[str, ...] = (), pick: int = 0) -> set[str]:
    """Estimate a photo's light with what the user knows, and set up the scene; what an operator returns.

    Without an answer the scene stays as it is.
    """
    if not Path(photo).is_file():
        operator.report({"ERROR"}, f"There is no photo {photo}.")
        return {"CANCELLED"}
    with tempfile.TemporaryDirectory() as folder:
        try:
            _ask(Path(photo), Path(folder), Stated(marks, pick))
        except AnswerError as error:
            operator.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        record = furnish(context.scene, Path(folder))
    settings = context.scene.light_from_photo
    settings.photo, settings.marks, settings.pick = photo, ";".join(marks), pick
    if not pick:  # a light whose sun was picked lists no others
        settings.answer = settings.record
    _report(operator, context.scene, record)
    return {"FINISHED"}


def _report(operator: Any, scene: Any, record: dict[str, Any]) -> None:
    """Say where the sun is, and what the user should know."""
    sun = record["sun"]
    side = "right" if sun["azimuth"] >= 0 else "left"
    operator.report({"INFO"}, f"Sun {abs(sun['azimuth']):.0f}° {side}, {sun['elevation']:.0f}° high")
    for warning in record.get("warnings", []):
        operator.report({"WARNING"}, str(warning))
    if not spot_is_in_view(scene):
        operator.report({"WARNING"}, "Your object would stand below the picture's edge.")
    if spot_is_in_shade(scene):
        operator.report({"WARNING"}, "Your object is in the photo's shade: the sun lights only the ground.")
    if others := other_lights(scene):
        operator.report({"WARNING"}, f"The scene has light that the photo has not; delete it: {', '.join(others)}.")


def _ask(photo: Path, folder: Path, stated: Stated) -> None:
    """Fill the folder by what the preferences choose; where no command works, by a service of this computer."""
    chosen = preferences()
    if chosen.source == "COMMAND":
        try:
            from_command(chosen.command, photo, folder, stated)
        except NoCommandError:
            address = find_service(chosen.address, chosen.key)
            if address is None:
                raise
            from_service(address, chosen.key, photo, folder, stated)
    elif not (bpy.app.online_access or is_here(chosen.address)):
        raise AnswerError("A service needs online access: Preferences, System, Network, Allow Online Access.")
    else:
        from_service(chosen.address, chosen.key, photo, folder, stated)


class LIGHTFROMPHOTO_OT_find(bpy.types.Operator):
    """Say which command or which service on this computer estimates the light"""

    bl_idname = "light_from_photo.find"
    bl_label = "What Is Found?"

    def execute(self, _context: Any) -> set[str]:
        """Look, and try what is found."""
        chosen = preferences()
        if program := find_command(chosen.command):
            self.report({"INFO"}, f"Command: lighting {version_of(program)}, {program}")
        elif address := find_service(chosen.address, chosen.key):
            self.report({"INFO"}, f"Service: {address}")
        else:
            self.report({"ERROR"}, "Nothing. Install it (pip install outdoor-lighting) and give the command's path.")
            return {"CANCELLED"}
        return {"FINISHED"}


class LIGHTFROMPHOTO_OT_pick(bpy.types.Operator):
    """Let this sun shine"""

    bl_idname = "light_from_photo.pick"
    bl_label = "Pick a Sun"
    bl_options = {"UNDO"}  # noqa: RUF012

    number: bpy.props.IntProperty(name="Number", default=1, min=1)  # type: ignore[valid-type]

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Only where a photo was picked."""
        return context.scene.light_from_photo.world is not None

    def execute(self, context: Any) -> set[str]:
        """Estimate again with that sun; the first is the answer itself."""
        settings = context.scene.light_from_photo
        return relight(self, context, settings.photo, drawn_marks(settings), self.number if self.number > 1 else 0)


class LIGHTFROMPHOTO_OT_forget(bpy.types.Operator):
    """Estimate again without what was drawn"""

    bl_idname = "light_from_photo.forget"
    bl_label = "Forget the Shadows"
    bl_options = {"UNDO"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Only where something was drawn."""
        return bool(context.scene.light_from_photo.marks)

    def execute(self, context: Any) -> set[str]:
        """Estimate from the photo alone."""
        return relight(self, context, context.scene.light_from_photo.photo)


class LIGHTFROMPHOTO_OT_guess(bpy.types.Operator):
    """Say whether the last shadow's foot or tip is a guess, the thing leans, or the ground slopes; estimate again"""

    bl_idname = "light_from_photo.guess"
    bl_label = "Foot or Tip Is a Guess"
    bl_options = {"UNDO"}  # noqa: RUF012

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Only where a shadow with its foot was drawn last."""
        marks = drawn_marks(context.scene.light_from_photo)
        return bool(marks) and is_guess(marks[-1]) is not None

    def execute(self, context: Any) -> set[str]:
        """Estimate with the last mark turned."""
        settings = context.scene.light_from_photo
        *others, last = drawn_marks(settings)
        return relight(self, context, settings.photo, (*others, turn_guess(last)))


def drawn_marks(settings: Any) -> tuple[str, ...]:
    """What was drawn along the photo's shadows."""
    return tuple(filter(None, settings.marks.split(";")))


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


register, unregister = bpy.utils.register_classes_factory(
    (
        LIGHTFROMPHOTO_OT_estimate,
        LIGHTFROMPHOTO_OT_find,
        LIGHTFROMPHOTO_OT_pick,
        LIGHTFROMPHOTO_OT_forget,
        LIGHTFROMPHOTO_OT_guess,
        LIGHTFROMPHOTO_OT_reset,
    )
)
