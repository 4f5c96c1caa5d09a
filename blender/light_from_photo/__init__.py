"""Light from Photo: the camera, the sun and the sky of an outdoor photo, set up for one's own object.

The light is estimated by this project's command `lighting` or by its service; both are chosen in the preferences.
Afterwards the sliders need neither: this folder holds the project's sky model.
"""

from . import drawing, gizmo, operators, panel, preferences, sliders

_PARTS = (preferences, sliders, operators, drawing, gizmo, panel)


def register() -> None:
    """Called by Blender when the extension is switched on."""
    for part in _PARTS:
        part.register()


def unregister() -> None:
    """Called by Blender when the extension is switched off."""
    for part in reversed(_PARTS):
        part.unregister()
