"""Where the light is estimated: by a command on this computer, or by a service."""

from typing import Any

import bpy

from .answers import is_here


class LightFromPhotoPreferences(bpy.types.AddonPreferences):
    """What the user sets once."""

    bl_idname = __package__

    source: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Estimate with",
        items=[
            ("COMMAND", "This Computer", "The command `lighting`, or a service that runs here"),
            ("SERVICE", "Service", "A service, by its address; needs Blender's online access"),
        ],
        default="COMMAND",
    )
    command: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Command",
        description="`lighting`, or the whole path of it where it is not on the PATH",
        default="lighting",
        subtype="FILE_PATH",
    )
    address: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Address", description="Where `lighting-server` listens", default="http://127.0.0.1:8000"
    )
    key: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="API key", description="If the service asks for one", subtype="PASSWORD"
    )

    def draw(self, _context: Any) -> None:
        """The settings of the chosen source."""
        self.layout.prop(self, "source", expand=True)
        if self.source == "COMMAND":
            self.layout.prop(self, "command")
            self.layout.operator("light_from_photo.find", icon="VIEWZOOM")
            return
        self.layout.prop(self, "address")
        self.layout.prop(self, "key")
        if not (bpy.app.online_access or is_here(self.address)):
            self.layout.label(text="Allow Online Access in the System preferences first", icon="ERROR")


def preferences() -> Any:
    """The user's settings."""
    return bpy.context.preferences.addons[__package__].preferences


def register() -> None:
    bpy.utils.register_class(LightFromPhotoPreferences)


def unregister() -> None:
    bpy.utils.unregister_class(LightFromPhotoPreferences)
