"""A node for ComfyUI: a photo in; its HDR map, sun, and the mask of where the sun reaches the ground out.

Install outdoor-lighting into ComfyUI's Python, and copy this folder into ComfyUI's `custom_nodes`.
"""

import json

import numpy as np
import torch
from comfy_api.latest import ComfyExtension, io

from lighting.estimator import estimate
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


class OutdoorLighting(ComfyExtension):
    """What ComfyUI loads."""

    async def get_node_list(self) -> list[type[io.ComfyNode]]:
        return [PhotoLight]


async def comfy_entrypoint() -> OutdoorLighting:
    """Return the extension; ComfyUI calls it."""
    return OutdoorLighting()
