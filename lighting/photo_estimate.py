"""From an estimate to pictures: maps, previews, scenes and light probes of a photo's light, the same by every door.

The command line, batches, the service, clips and Python call the functions here. A light without its photo makes maps
by `render_map` alone.
"""

import dataclasses
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self, Unpack

import numpy as np
from numpy.typing import NDArray

from lighting.envmap.latlong import EPSILON_IRRADIANCE, Image, column_blocks
from lighting.envmap.projection import photo_camera, size_in_envmap
from lighting.envmap.relighting import adjust_lighting, edit_lighting, edit_photo_light, light_of_map, rotate_lighting
from lighting.errors import warn_of_old_name
from lighting.fields import RANGES, check_range, describe_fields
from lighting.files import DEFAULT_FILE, FileOptions, encode_envmap, join_strips, write_envmap
from lighting.formatting import format_tilt
from lighting.map_options import DEFAULT_MAP, MAX_WHOLE_HEIGHT, Adjustments, Around, MapKeywords, MapOptions
from lighting.photo.reader import Photo
from lighting.prediction import EstimatedLight
from lighting.records import Color, Lighting, LightProbe, check_lighting, describe_sun
from lighting.runtime import ONE_BLAS_THREAD, return_memory
from lighting.tracing import trace_step

if TYPE_CHECKING:
    from PIL import Image as Pictures

    from lighting.envmap.surroundings import PhotoContext
    from lighting.scene.records import Scene


@dataclass(frozen=True, eq=False)
class RenderedMap:
    """An environment map, the light that it shows, and that light's probe."""

    strips: Callable[[], Iterator[Image]]
    """Its rows (R, 2H, 3) from the zenith down: all of a map of up to 4096 rows, else a few at a time."""
    lighting: Lighting
    """The light as it was adjusted, turned with the map."""
    probe: LightProbe
    """Of the light and the place."""

    @cached_property
    def image(self) -> Image:
        """(H, 2H, 3) float32, linear Rec.709, in the photo's linear values; 1.6 GB of 8192 rows."""
        return join_strips(self.strips)

    def encode(self, options: FileOptions = DEFAULT_FILE) -> bytes:
        """Return the bytes of a file that holds the map; an EXR holds light and probe, too.

        Args:
            options: how the file is written.

        Raises:
            EnvironmentMapError: the map does not fit the format.
        """
        with trace_step("encode"):
            return encode_envmap(self.strips, self.lighting, options, probe=self.probe)

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
            write_envmap(path, self.strips, self.lighting, options, probe=self.probe)


def render_map(
    lighting: Lighting, options: MapOptions = DEFAULT_MAP, context: "PhotoContext | None" = None
) -> RenderedMap:
    """Adjust a light, and render its environment map.

    Args:
        lighting: any.
        options: of the map.
        context: what the map shows of a photo and its place; None: sky and ground alone.

    Raises:
        ParameterError: the light does not fit a map.
    """
    from lighting.envmap.surroundings import render_strips, render_view

    light = light_of_map(lighting, options)
    with trace_step("map"), ONE_BLAS_THREAD:
        probe = _probe_of_map(light, options, context)
        if len(column_blocks(options.height)) > 1:  # which takes hundreds of megabytes
            return_memory()
        values: Any = {"sun": options.sun, "yaw": options.yaw, "context": context, "disc": options.disc}
        if options.height > MAX_WHOLE_HEIGHT:

            def strips() -> Iterator[Image]:
                with ONE_BLAS_THREAD:
                    yield from render_strips(light, options.height, **values)

            return RenderedMap(strips, rotate_lighting(light, options.yaw) if options.yaw else light, probe)
        image, shown = render_view(light, options.height, **values)
    return RenderedMap(lambda: iter((image,)), shown, probe)


def compute_map_probe(
    lighting: Lighting, options: MapOptions = DEFAULT_MAP, context: "PhotoContext | None" = None
) -> LightProbe:
    """Compute the light probe of the map that `render_map` makes of the same, but for the map's detail.

    Args:
        lighting: any.
        options: of the map.
        context: as in `render_map`.

    Raises:
        ParameterError: the light does not fit a map.
    """
    light = light_of_map(lighting, options)
    with trace_step("map"), ONE_BLAS_THREAD:
        return _probe_of_map(light, options, context)


def _probe_of_map(light: Lighting, options: MapOptions, context: "PhotoContext | None") -> LightProbe:
    from lighting.light_probe import compute_light_probe

    return compute_light_probe(light, context, sun=options.sun, yaw=options.yaw)


describe_fields(RenderedMap)


@dataclass(frozen=True, eq=False, repr=False)
class Estimate(EstimatedLight):
    """The answer about one photo, with the photo: what `estimate` and an Estimator return."""

    photo: Photo = field(kw_only=True)
    """The photo, as `read_photo` or `photo_from_array` returned it."""
    photo_lighting: Lighting = field(kw_only=True)
    """The light that the photo shows, from which `replace` may have changed `lighting`."""

    @classmethod
    def of_photo(cls, photo: Photo, light: EstimatedLight) -> Self:
        """Join a photo and its light.

        Args:
            photo: any.
            light: of this photo.
        """
        values = (light.lighting, light.distribution, light.surroundings, light.segments)
        return cls(*values, photo=photo, photo_lighting=light.lighting)

    def replace(
        self,
        *,
        sun: tuple[float, float] | None = None,
        exposure: float = 0.0,
        haze: float | None = None,
        overcast: bool = False,
        pick: int | None = None,
        camera_height: float | None = None,
        lighting: Lighting | None = None,
    ) -> Self:
        """Return an estimate with another light, as options of the same names change it on the command line.

        Changes add up: `replace(exposure=1).replace(exposure=1)` is four times as bright.

        Args:
            sun: azimuth, -360 to 360, and elevation, -4.2 to 90, deg; None: where it is.
            exposure: EV, -20 to 20, of map and photo: +1 is twice as bright.
            haze: turbidity, 1 to 10: 2 is very clear, 10 hazy; None: as it is.
            overcast: True covers the sky, and no sun shines.
            pick: number, 1 to 3, of the sun in `lighting.sun_candidates` that shines; None: the answer's.
            camera_height: m above the ground, 0.1 to 20,000; None: as it is.
            lighting: a stored record of this photo, before the other changes; None: the estimate's own.

        Raises:
            ParameterError: a value is out of range.
        """
        if lighting is not None:
            check_lighting(lighting)
        light = adjust_lighting(lighting or self.lighting, Adjustments(sun, exposure, haze, overcast, pick))
        if camera_height is not None:
            check_range("camera_height", camera_height, *RANGES["camera_height"])
            light = edit_lighting(light, {"camera_height": float(camera_height)})
        return dataclasses.replace(self, lighting=light)

    def edit(self, changes: Mapping[str, float | Color], photo_exposure: float | None = None) -> Self:
        """Return an estimate with fields of its light replaced; irradiances that are not among them follow the sky.

        Args:
            changes: values by the fields of `lighting.Lighting`.
            photo_exposure: the `exposure` at which the photo is as it is; None: the estimate's.

        Raises:
            ParameterError: a value is out of range.
        """
        shown = self.photo_lighting
        if photo_exposure is not None and photo_exposure != shown.exposure:
            shown = edit_lighting(shown, {"exposure": photo_exposure})
        return dataclasses.replace(self, lighting=edit_photo_light(self.lighting, changes), photo_lighting=shown)

    def render(self, options: MapOptions = DEFAULT_MAP) -> RenderedMap:
        """Render the environment map; of a high one the photo is read again with more of its pixels.

        Args:
            options: of the map.

        Raises:
            ParameterError: the light does not fit a map.
            PhotoError: the photo's file has changed since it was read.
        """
        from lighting.envmap.surroundings import FINE_SIDE

        context, pixels = self.context(options), self.photo.pixels
        camera = photo_camera(self.photo_lighting, pixels.shape[1], pixels.shape[0])
        if context is not None and max(size_in_envmap(camera, options.height)) > max(pixels.shape[:2]):
            context = self.context(options, self.photo.reread(FINE_SIDE).pixels)
        return render_map(self.lighting, options, context)

    def envmap(self, height: int = DEFAULT_MAP.height, **options: Unpack[MapKeywords]) -> NDArray[np.float32]:
        """Render the environment map (height, 2 height, 3) in linear Rec.709, in the photo's linear values.

        Args:
            height: rows of the map, even, 16 to 8192.
            options: the other fields of `lighting.MapOptions`: sun, yaw, sky, around, backdrop, disc, adjustments.

        Raises:
            ParameterError: a value is out of range.
            PhotoError: the photo's file has changed since it was read.
        """
        return self.render(MapOptions.of_keywords(height, options)).image

    def save(
        self,
        path: str | os.PathLike[str],
        height: int = DEFAULT_MAP.height,
        *,
        compression: str = DEFAULT_FILE.compression,
        colors: str = DEFAULT_FILE.colors,
        colours: str | None = None,
        **options: Unpack[MapKeywords],
    ) -> None:
        """Write the environment map; an EXR holds the record, too. It replaces a file, and appears when it is whole.

        Args:
            path: ends in .exr, .hdr or .png.
            height: as in `envmap`.
            compression: of an EXR: zip, pxr24 or none.
            colors: primaries of an EXR: rec709, acescg or linear-p3.
            colours: the old name of `colors`; warns of it.
            options: as in `envmap`; the record in the file is turned with the map.

        Raises:
            EnvironmentMapError: the path ends otherwise, or cannot be written.
            ParameterError: a value is out of range.
            PhotoError: the photo's file has changed since it was read.
        """
        if colours is not None:
            warn_of_old_name("lighting.Estimate.save.colours")
            colors = colours
        file = FileOptions(compression=compression, colors=colors).for_path(path)
        self.render(MapOptions.of_keywords(height, options)).write(path, file)

    def light_probe(self, **options: Unpack[MapKeywords]) -> LightProbe:
        """Compute the light for engines and phones: nine coefficients of all but the sun, and the sun as main light.

        Args:
            options: as in `envmap`; without the sun the main light is none.

        Raises:
            ParameterError: a value is out of range.
        """
        return self.probe(MapOptions.of_keywords(DEFAULT_MAP.height, options))

    def probe(self, options: MapOptions = DEFAULT_MAP) -> LightProbe:
        """Compute the light probe of the map that `render` makes, but for the map's detail.

        Args:
            options: of the map.
        """
        return compute_map_probe(self.lighting, options, self.context(options))

    def preview(self, options: MapOptions = DEFAULT_MAP, **keywords: Unpack[MapKeywords]) -> "Pictures.Image":
        """Draw the photo, the sun's probability, the map and three spheres in the light, 1600 pixels wide.

        Args:
            options: of the map, which is not turned.
            keywords: as in `envmap`, in place of `options`.

        Raises:
            ParameterError: a value is out of range.
            PhotoError: the photo's file has changed since it was read.
        """
        from PIL import Image

        from lighting.envmap.surroundings import render_view
        from lighting.preview.picture import PHOTO_SIDE, draw_preview_pixels, expose_photo

        options = MapOptions.of_keywords(options.height, keywords) if keywords else options
        options.refuse("a preview", "yaw")
        light, pixels = light_of_map(self.lighting, options), self.photo.reread(PHOTO_SIDE).pixels
        gain = light.exposure / max(self.photo_lighting.exposure, EPSILON_IRRADIANCE)
        context = self.context(options, pixels)
        with trace_step("map"), ONE_BLAS_THREAD:
            image, _ = render_view(light, options.height, sun=options.sun, context=context, disc=options.disc)
            shown = dataclasses.replace(self, lighting=light)
            exposed, photo_sun = expose_photo(pixels, gain), self.photo_lighting.sun_painted
            return Image.fromarray(draw_preview_pixels(exposed, shown, image, photo_sun=photo_sun))

    def preview_candidates(self, options: MapOptions = DEFAULT_MAP) -> "Pictures.Image":
        """Draw the photo and its balls in the light of each of `lighting.sun_candidates`, side by side.

        Args:
            options: of the map, which is not turned, and whose sun is none by hand.

        Raises:
            ParameterError: a value is out of range, or the light lists no suns.
            PhotoError: the photo's file has changed since it was read.
        """
        from PIL import Image

        from lighting.envmap.surroundings import render_view
        from lighting.preview.picture import PHOTO_SIDE, draw_candidates_pixels

        options.refuse("a preview", "yaw")
        pixels = self.photo.reread(PHOTO_SIDE).pixels
        context, views = self.context(options, pixels), []
        with trace_step("map"), ONE_BLAS_THREAD:
            for number in range(1, max(len(self.lighting.sun_candidates), 1) + 1):
                adjustments = dataclasses.replace(options.adjustments, pick=number)
                light = light_of_map(self.lighting, dataclasses.replace(options, adjustments=adjustments))
                image, _ = render_view(light, options.height, sun=options.sun, context=context, disc=options.disc)
                views.append((light, image))
            suns = self.lighting.sun_candidates
            photo_sun = self.photo_lighting.sun_painted
            return Image.fromarray(draw_candidates_pixels(pixels, suns, views, self.segments, photo_sun=photo_sun))

    def make_scene(self, options: MapOptions = DEFAULT_MAP) -> "Scene":
        """Make the photo's scene, which `lighting.scene.writer` writes for any tool.

        Args:
            options: of its map, which is not turned; the sun's disc is a light of its own.

        Raises:
            ParameterError: the light does not fit a map.
            PhotoError: the photo's file has changed since it was read.
        """
        from lighting.scene.records import PLATE_SIDE, make_scene

        options.refuse("a scene", "yaw", "disc")
        light, plate = light_of_map(self.lighting, options), self.photo.reread(PLATE_SIDE)
        context = self.context(options, plate.pixels)
        with trace_step("map"), ONE_BLAS_THREAD:
            return make_scene(
                plate, light, map_height=options.height, sun=options.sun, context=context, segments=self.segments
            )

    def scene(
        self,
        tool: str,
        folder: str | os.PathLike[str],
        options: MapOptions = DEFAULT_MAP,
        *,
        overwrite: bool = False,
        **keywords: object,
    ) -> "Scene":
        """Write a scene for another tool, and return it; its `warnings` say what to know about it.

        Args:
            tool: one of `lighting.scene.EXPORTERS`: "blender", "usd", "gltf", and so on.
            folder: new or empty unless `overwrite`.
            options: as in `make_scene`.
            overwrite: whether files in the folder may be replaced.
            keywords: options of the tool, such as `up_axis="Z"` for USD; height and others as in `envmap`.

        Raises:
            SceneError: the tool is unknown, or the folder cannot be written.
            TypeError: there is no such option.
            ParameterError: a value is out of range.
            PhotoError: the photo's file has changed since it was read.
        """
        from lighting.scene import EXPORTERS
        from lighting.scene.writer import check_scene_target, write_scene

        check_scene_target(tool, folder, overwrite=overwrite)
        of_tool = {name: keywords.pop(name) for name in keywords.keys() & EXPORTERS[tool].options.keys()}
        if keywords:
            options = MapOptions.of_keywords(keywords.pop("height", options.height), keywords)
        scene = self.make_scene(options)
        write_scene(scene, tool, folder, overwrite=overwrite, **of_tool)
        return scene

    @cached_property
    def _place(self) -> "PhotoContext":
        """The photo as it was read, and its place: by their likeness the detail of all maps is chosen, once."""
        from lighting.envmap.surroundings import PhotoContext

        light = self.photo_lighting
        return PhotoContext(self.photo.pixels, self.surroundings, light.exposure, light, self.segments, detail=True)

    def context(
        self, options: MapOptions = DEFAULT_MAP, pixels: NDArray[np.uint8] | None = None
    ) -> "PhotoContext | None":
        """Return what a map shows of the photo and its place; None: sky and ground alone.

        Args:
            options: of the map; what is around the photo counts.
            pixels: (h, w, 3) sRGB of the photo, more of them; None: as it was read.
        """
        around = options.around
        if around is None:
            around = Around.PLAIN if self.surroundings is None else Around.PLACE
        if around == Around.PLAIN:
            return None
        place = self._place if options.backdrop is None else dataclasses.replace(self._place, backdrop=options.backdrop)
        if around == Around.PLACE and pixels is None:
            return place
        photo = place.photo if pixels is None else pixels
        return dataclasses.replace(place, photo=photo, detail=around == Around.PLACE, first=place)

    def __repr__(self) -> str:
        """One line: where the sun is, how sure that is, and how the camera stands."""
        light = self.lighting
        name = self.photo.source.name if self.photo.source else None
        trust = f", {light.trust}" if light.radius_90 else ""
        suitable = "" if light.suitable is None else f", suitable {light.suitable:.2f}"
        return (
            f"<Estimate of {name or f'{self.photo.width} x {self.photo.height} pixels'}: "
            f"{describe_sun(light)}{trust}, "
            f"direct sunlight {100 * light.sun_visibility:.0f} %, turbidity {light.turbidity:.1f}; "
            f"camera looks {format_tilt(light.camera_elevation, 1)}, field of view {light.vertical_fov:.1f}°{suitable}>"
        )

    def _repr_png_(self) -> bytes:
        """The preview, which notebooks show."""
        from lighting.files.deflate import encode_png

        return encode_png(np.asarray(self.preview()))


describe_fields(Estimate)
