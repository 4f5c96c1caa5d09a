"""RenderedMap: an environment map, the light that it shows, and that light's probe."""

import os
from dataclasses import dataclass

from lighting.envmap.latlong import Image, column_blocks
from lighting.envmap.relighting import light_of_map
from lighting.envmap.surroundings import PhotoContext, render_view
from lighting.fields import describe_fields
from lighting.files import DEFAULT_FILE, FileOptions, encode_envmap, write_envmap
from lighting.light_probe import compute_light_probe
from lighting.map_options import DEFAULT_MAP, MapOptions
from lighting.records import Lighting, LightProbe
from lighting.runtime import ONE_BLAS_THREAD, return_memory
from lighting.tracing import trace_step


@dataclass(frozen=True, eq=False)
class RenderedMap:
    """An environment map, the light that it shows, and that light's probe."""

    image: Image
    """(H, 2H, 3) float32, linear Rec.709, in the photo's linear values."""
    lighting: Lighting
    """The light as it was adjusted, turned with the map."""
    probe: LightProbe
    """Of the light and the place."""

    def encode(self, options: FileOptions = DEFAULT_FILE) -> bytes:
        """Return the bytes of a file that holds the map; an EXR holds light and probe, too.

        Args:
            options: how the file is written.

        Raises:
            EnvironmentMapError: the map does not fit the format.
        """
        with trace_step("encode"):
            return encode_envmap(self.image, self.lighting, options, probe=self.probe)

    def write(self, path: str | os.PathLike[str], options: FileOptions = DEFAULT_FILE) -> None:
        """Write the map to a file, which it replaces when it is whole.

        Args:
            path: ends in .exr, .hdr or .png, which says the format.
            options: how the file is written.

        Raises:
            EnvironmentMapError: the path ends otherwise, or cannot be written.
            ParameterError: the format does not take the options.
        """
        with trace_step("encode"):
            write_envmap(path, self.image, self.lighting, options, probe=self.probe)


def render_map(
    lighting: Lighting, options: MapOptions = DEFAULT_MAP, context: PhotoContext | None = None
) -> RenderedMap:
    """Adjust a light, and render its environment map.

    Args:
        lighting: any.
        options: of the map.
        context: what the map shows of a photo and its place; None: sky and ground alone.

    Raises:
        ParameterError: the light does not fit a map.
    """
    light = light_of_map(lighting, options)
    with trace_step("map"), ONE_BLAS_THREAD:
        probe = compute_light_probe(light, context, sun=options.sun, yaw=options.yaw)
        if len(column_blocks(options.height)) > 1:  # which takes hundreds of megabytes
            return_memory()
        view = render_view(light, options.height, sun=options.sun, yaw=options.yaw, context=context, disc=options.disc)
    return RenderedMap(*view, probe)


describe_fields(RenderedMap)
