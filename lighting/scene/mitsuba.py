"""A scene for Mitsuba 3, in parts, and a script that puts the object over the plate.

Mitsuba's frame is ours, its maps have +Z at the centre and its cameras look along their own +Z with +X to the left. The
sun is a disc of the right angle far away, since a `directional` emitter casts shadows without penumbra.
"""

from importlib.resources import files

import numpy as np

from lighting.scene.common import (
    ENVIRONMENT,
    GROUND_RADIUS,
    PLACEHOLDER_ALBEDO,
    SUN_ANGLE,
    Floats,
    Folder,
    Scene,
    write_shared_files,
)

SCENE, CAMERA, LIGHT, OBJECT, COMPOSITE = "scene.xml", "camera.xml", "light.xml", "object.xml", "composite.py"

SUN_DISTANCE = 10_000.0  # m; ten metres from the spot the sun's direction differs by 0.06 deg

_HALF_ANGLE = np.radians(SUN_ANGLE / 2)


def write(scene: Scene, folder: Folder) -> None:
    """Write SCENE, which includes CAMERA, LIGHT (with the ground) and OBJECT, then COMPOSITE, plate and map."""
    write_shared_files(scene, folder)
    for name, content in (
        (SCENE, "\n".join(f'    <include filename="{part}"/>' for part in (CAMERA, LIGHT, OBJECT))),
        (CAMERA, _camera(scene)),
        (LIGHT, _light(scene)),
        (OBJECT, _object(scene)),
    ):
        (folder / name).write_text(f'<scene version="3.0.0">\n{content}\n</scene>\n', encoding="utf-8")
    script = files("lighting") / "scene" / "data" / "mitsuba_composite.py"
    (folder / COMPOSITE).write_text(script.read_text(encoding="utf-8"), encoding="utf-8")


def _camera(scene: Scene) -> str:
    right, up, forward = scene.camera_axes
    matrix = np.eye(4)
    matrix[:3] = np.stack([-right, up, forward, scene.camera_position], axis=1)
    return f"""\
    <default name="samples" value="64"/>
    <default name="width" value="{scene.width}"/>
    <default name="height" value="{scene.height}"/>
    <integrator type="path">
        <integer name="max_depth" value="6"/>
        <boolean name="hide_emitters" value="false"/>
    </integrator>
    <sensor type="perspective">
        <string name="fov_axis" value="y"/>
        <float name="fov" value="{scene.vertical_fov!r}"/>
        <transform name="to_world">
            <matrix value="{_numbers(matrix.ravel())}"/>
        </transform>
        <film type="hdrfilm">
            <integer name="width" value="$width"/>
            <integer name="height" value="$height"/>
            <string name="pixel_format" value="rgba"/>
            <rfilter type="gaussian"/>
        </film>
        <sampler type="independent">
            <integer name="sample_count" value="$samples"/>
        </sampler>
    </sensor>"""


def _light(scene: Scene) -> str:
    sun = scene.spot + SUN_DISTANCE * scene.sun_direction
    radiance = scene.sun_irradiance / (np.pi * np.sin(_HALF_ANGLE) ** 2)
    return f"""\
    <!-- The sky and the ground it lights, without the sun's disc -->
    <emitter type="envmap">
        <string name="filename" value="{ENVIRONMENT}"/>
        <transform name="to_world">
            <rotate y="1" angle="180"/>
        </transform>
    </emitter>
    <!-- The sun, {SUN_ANGLE} degrees wide; its irradiance is {_numbers(scene.sun_irradiance)} -->
    <shape type="disk">
        <transform name="to_world">
            <scale value="{SUN_DISTANCE * np.tan(_HALF_ANGLE):.9g}"/>
            <lookat origin="{_numbers(sun)}" target="{_numbers(scene.spot)}" up="{_numbers(_aside(scene))}"/>
        </transform>
        <bsdf type="diffuse">
            <rgb name="reflectance" value="0"/>
        </bsdf>
        <emitter type="area">
            <rgb name="radiance" value="{_numbers(radiance)}"/>
        </emitter>
    </shape>
    <!-- The ground -->
    <shape type="disk">
        <transform name="to_world">
            <scale value="{GROUND_RADIUS:.9g}"/>
            <rotate x="1" angle="-90"/>
        </transform>
        <bsdf type="diffuse">
            <rgb name="reflectance" value="{scene.lighting.ground_albedo!r}"/>
        </bsdf>
    </shape>"""


def _aside(scene: Scene) -> Floats:
    """A horizontal unit vector across the sun's direction, which no sun can be parallel to."""
    azimuth = np.radians(scene.lighting.sun_azimuth)
    return np.array([np.cos(azimuth), 0.0, np.sin(azimuth)])


def _object(scene: Scene) -> str:
    foot, radius = scene.stick_foot, scene.stick_radius
    top = foot + np.array([0.0, scene.stick_height, 0.0])
    return f"""\
    <!-- Your object here, standing on {_numbers(scene.spot)}:
    <shape type="obj">
        <string name="filename" value="object.obj"/>
        <transform name="to_world">
            <translate value="{_numbers(scene.spot)}"/>
        </transform>
    </shape>
    -->
    <bsdf type="diffuse" id="placeholder">
        <rgb name="reflectance" value="{PLACEHOLDER_ALBEDO}"/>
    </bsdf>
    <shape type="sphere" id="ball">
        <point name="center" value="{_numbers(scene.ball_centre)}"/>
        <float name="radius" value="{scene.ball_radius:.9g}"/>
        <ref id="placeholder"/>
    </shape>
    <shape type="cylinder" id="stick">
        <point name="p0" value="{_numbers(foot)}"/>
        <point name="p1" value="{_numbers(top)}"/>
        <float name="radius" value="{radius:.9g}"/>
        <ref id="placeholder"/>
    </shape>
    <shape type="disk" id="stick_end">
        <transform name="to_world">
            <scale value="{radius:.9g}"/>
            <rotate x="1" angle="-90"/>
            <translate value="{_numbers(top)}"/>
        </transform>
        <ref id="placeholder"/>
    </shape>"""


def _numbers(values: Floats) -> str:
    return " ".join(f"{value:.9g}" for value in values)
