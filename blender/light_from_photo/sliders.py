"""The sliders: sun, haze, exposure and clouds after the estimate, without the network.

Where all of them stand as estimated, the world shows the photo's own map; elsewhere one that is painted here.
"""

from typing import Any

import bpy

from . import scene as script
from . import skies
from .furnish import environment_node, sky_node
from .lighting.records import Lighting

IMAGE = "Sky of the sliders"


_moving: list[bool] = []  # not empty while several sliders move at once


def _changed(settings: Any, _context: Any) -> None:
    if not _moving:
        shine(settings)


def _slider(name: str, label: str, description: str, **more: Any) -> Any:
    low, high = skies.SLIDERS[name]
    return bpy.props.FloatProperty(
        name=label, description=description, min=low, max=high, update=_changed, options=set(), **more
    )


class LightFromPhotoSettings(bpy.types.PropertyGroup):
    """The light of a scene: what the sliders say, what was estimated, and where it shows."""

    sun_azimuth: _slider("sun_azimuth", "Sun Azimuth", "Degrees to the right of where the camera points")  # type: ignore
    sun_elevation: _slider("sun_elevation", "Sun Elevation", "Degrees above the horizon")  # type: ignore
    haze: _slider("haze", "Haze", "Turbidity: 2 is very clear, 10 is hazy", default=3.0)  # type: ignore
    exposure: _slider(  # type: ignore
        "exposure", "Exposure (EV)", "EV against the estimate: +1 is twice as bright", soft_min=-5.0, soft_max=5.0
    )
    overcast: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Overcast",
        description="Cover the sky with clouds: no sun, soft gray light",
        update=_changed,
        options=set(),
    )
    estimate: bpy.props.FloatVectorProperty(size=4)  # type: ignore[valid-type]
    record: bpy.props.StringProperty()  # type: ignore[valid-type]
    answer: bpy.props.StringProperty()  # type: ignore[valid-type]  # the record before a sun was picked
    photo: bpy.props.StringProperty()  # type: ignore[valid-type]  # its file
    photo_size: bpy.props.IntVectorProperty(size=2)  # type: ignore[valid-type]  # columns and rows
    marks: bpy.props.StringProperty()  # type: ignore[valid-type]  # what was drawn, separated by `;`
    pick: bpy.props.IntProperty()  # type: ignore[valid-type]  # number of the sun, from 1; 0: the answer's
    shines: bpy.props.BoolProperty()  # type: ignore[valid-type]
    environment: bpy.props.PointerProperty(type=bpy.types.Image)  # type: ignore[valid-type]
    camera: bpy.props.PointerProperty(type=bpy.types.Object)  # type: ignore[valid-type]
    sun: bpy.props.PointerProperty(type=bpy.types.Object)  # type: ignore[valid-type]
    ground: bpy.props.PointerProperty(type=bpy.types.Object)  # type: ignore[valid-type]
    spot: bpy.props.PointerProperty(type=bpy.types.Object)  # type: ignore[valid-type]
    world: bpy.props.PointerProperty(type=bpy.types.World)  # type: ignore[valid-type]
    collection: bpy.props.PointerProperty(type=bpy.types.Collection)  # type: ignore[valid-type]


def shine(settings: Any) -> None:
    """Let sun and world show what the sliders say; nothing where no photo was picked or its sun was deleted."""
    if settings.world is None or settings.sun is None:
        return
    values = {name: getattr(settings, name) for name in skies.SLIDERS}
    light = skies.light_of_sliders(settings.record, values, settings.overcast)
    script.aim_sun(settings.sun, skies.sun(light, settings.shines))
    node = environment_node(settings.world)
    is_estimate = list(values.values()) == list(settings.estimate) and not settings.overcast
    node.image = settings.environment if is_estimate else _painted(settings, light)
    script.aim_native_sky(sky_node(settings.world), skies.native_sky(light))


def _painted(settings: Any, light: Lighting) -> Any:
    """The picture of the sliders of this scene, painted anew."""
    name = f"{IMAGE} {settings.id_data.name}"
    image = bpy.data.images.get(name) or bpy.data.images.new(
        name, 2 * skies.HEIGHT, skies.HEIGHT, float_buffer=True, is_data=False
    )
    image.colorspace_settings.name = "Linear Rec.709"
    image.pixels.foreach_set(skies.pixels(light, settings.shines))
    image.update()
    return image


def turn_sun(settings: Any, azimuth: float, elevation: float) -> None:
    """Move both sliders of the sun [deg], and paint once."""
    _move(settings, {"sun_azimuth": azimuth, "sun_elevation": elevation})


def reset(settings: Any) -> None:
    """All sliders back to the estimate."""
    _move(settings, {"overcast": False, **dict(zip(skies.SLIDERS, settings.estimate, strict=True))})


def _move(settings: Any, values: dict[str, float]) -> None:
    _moving.append(True)
    try:
        for name, value in values.items():
            setattr(settings, name, value)
    finally:
        _moving.pop()
    shine(settings)


@bpy.app.handlers.persistent
def _again(*_: Any) -> None:
    """After undo and redo, which turn back the sliders and not the picture."""
    for scene in bpy.data.scenes:
        shine(scene.light_from_photo)


@bpy.app.handlers.persistent
def _pack(*_: Any) -> None:
    """Before saving: painted pictures go into the file."""
    for image in bpy.data.images:
        if image.name.startswith(IMAGE) and image.is_dirty:
            image.pack()


def register() -> None:
    bpy.utils.register_class(LightFromPhotoSettings)
    bpy.types.Scene.light_from_photo = bpy.props.PointerProperty(type=LightFromPhotoSettings)
    bpy.types.Scene.light_from_photo_compositor = bpy.props.BoolProperty()
    bpy.app.handlers.undo_post.append(_again)
    bpy.app.handlers.redo_post.append(_again)
    bpy.app.handlers.save_pre.append(_pack)


def unregister() -> None:
    bpy.app.handlers.save_pre.remove(_pack)
    bpy.app.handlers.redo_post.remove(_again)
    bpy.app.handlers.undo_post.remove(_again)
    del bpy.types.Scene.light_from_photo_compositor
    del bpy.types.Scene.light_from_photo
    bpy.utils.unregister_class(LightFromPhotoSettings)
