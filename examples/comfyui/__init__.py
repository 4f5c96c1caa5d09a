"""Nodes for ComfyUI: a photo in; its HDR map, sun, camera, and the mask of where the sun reaches the ground out.

Install outdoor-lighting into ComfyUI's Python, and copy this folder into ComfyUI's `custom_nodes`. Then open
`example_workflows/photo_light.json`, which ComfyUI lists among its templates.
"""

import json

import numpy as np
import torch
from comfy_api.latest import ComfyExtension, io

from lighting.estimator import estimate
from lighting.geometry import Pinhole
from lighting.records import Lighting
from lighting.scene.records import make_scene


class PhotoLight(io.ComfyNode):
    """The light of the first picture of a batch."""

    @classmethod
    def define_schema(cls) -> io.Schema:
        return io.Schema(
            node_id="OutdoorLightingPhotoLight",
            display_name="Light of an outdoor photo",
            category="image/lighting",
            description="Where the sun is, and an HDR environment map, from one outdoor daylight photo.",
            inputs=[
                io.Image.Input("photo"),
                io.Int.Input("map_height", default=512, min=16, max=2048, step=2),
                io.Boolean.Input("sun", default=True, tooltip="Leave the sun in the map, where it shines."),
            ],
            outputs=[
                io.Image.Output("map", display_name="HDR map", tooltip="Linear, values over 1; +Z of OpenEXR ahead."),
                io.Float.Output("sun_azimuth", display_name="sun azimuth", tooltip="Degrees to the right of the view."),
                io.Float.Output("sun_elevation", display_name="sun elevation", tooltip="Degrees over the horizon."),
                io.Mask.Output("lit_ground", display_name="lit ground", tooltip="1 where the sun's shadows may fall."),
                io.String.Output("record", display_name="JSON record"),
            ],
        )

    @classmethod
    def execute(cls, photo: torch.Tensor, map_height: int, sun: bool) -> io.NodeOutput:
        pixels = np.round(255 * photo[0, ..., :3].cpu().numpy().clip(0, 1)).astype(np.uint8)
        answer = estimate(pixels)
        envmap = answer.envmap(map_height, sun=None if sun else False)
        lit = make_scene(answer.photo, answer.lighting, map_height=16, segments=answer.segments).shadow_receivers
        light = answer.lighting
        return io.NodeOutput(
            torch.from_numpy(np.ascontiguousarray(envmap))[None],
            light.sun_azimuth,
            light.sun_elevation,
            torch.from_numpy(np.ascontiguousarray(lit, dtype=np.float32))[None],
            json.dumps(light.to_dict()),
        )


class PhotoCamera(io.ComfyNode):
    """The pinhole of a record, its axis through the picture's middle, for users of MoGe and GeoCalib.

    MoGe takes `fov x`. GeoCalib's nodes call `elevation` pitch and `fov y` vfov. Its Python takes `up` as its gravity.
    """

    @classmethod
    def define_schema(cls) -> io.Schema:
        return io.Schema(
            node_id="OutdoorLightingPhotoCamera",
            display_name="Camera of an outdoor photo",
            category="image/lighting",
            description="Lens and tilt of the camera, from the record of the photo's light.",
            inputs=[
                io.Image.Input("photo", tooltip="The same as the record's; its size counts."),
                io.String.Input("record", force_input=True, tooltip="Of `Light of an outdoor photo`."),
            ],
            outputs=[
                io.Float.Output("fov_x", display_name="fov x", tooltip="Degrees, from the left edge to the right."),
                io.Float.Output("fov_y", display_name="fov y", tooltip="Degrees, from the upper edge to the lower."),
                io.Float.Output("elevation", tooltip="Degrees, positive where the camera looks up."),
                io.Float.Output("roll", tooltip="Degrees, positive where the camera is turned clockwise."),
                io.String.Output("camera", display_name="JSON camera", tooltip="Intrinsics and up, in OpenCV's axes."),
            ],
        )

    @classmethod
    def execute(cls, photo: torch.Tensor, record: str) -> io.NodeOutput:
        light = Lighting.from_dict(json.loads(record))
        height, width = photo.shape[1:3]
        camera = Pinhole(width, height, light.vertical_fov, 0.0, light.camera_elevation, light.camera_roll)
        right, up, forward = camera.axes[:, 1].tolist()  # of the camera's axes, how far they point up
        focal = camera.focal_length
        values = {
            "intrinsics": [[focal / width, 0.0, 0.5], [0.0, focal / height, 0.5], [0.0, 0.0, 1.0]],  # of a unit picture
            "focal_length_pixels": focal,
            "up": [right, -up, forward],  # x to the right, y down, z ahead
        }
        fov_x = float(np.degrees(2 * np.arctan(width / 2 / focal)))
        return io.NodeOutput(fov_x, light.vertical_fov, light.camera_elevation, light.camera_roll, json.dumps(values))


class OutdoorLighting(ComfyExtension):
    """What ComfyUI loads."""

    async def get_node_list(self) -> list[type[io.ComfyNode]]:
        return [PhotoLight, PhotoCamera]


async def comfy_entrypoint() -> OutdoorLighting:
    """Return the extension; ComfyUI calls it."""
    return OutdoorLighting()
