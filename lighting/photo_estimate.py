"""Estimate: the light of one photo together with the photo, so that it makes its own map, preview and scene."""

import dataclasses
import os
import reprlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from lighting.errors import ErrorCode, ParameterError
from lighting.fields import RANGES, check_range, describe_fields, format_azimuth, format_sun_elevation, format_tilt
from lighting.photo.reader import Photo, reread_photo
from lighting.records import EstimatedLight, Lighting, check_lighting
from lighting.runtime import ONE_BLAS_THREAD

if TYPE_CHECKING:
    from PIL import Image

    from lighting.envmap.surroundings import PhotoContext
    from lighting.light_probe import LightProbe
    from lighting.scene.records import Scene

_MAP_HEIGHT = 512  # rows


@dataclass(frozen=True, eq=False, repr=False)
class Estimate(EstimatedLight):
    """The answer about one photo, with the photo: what `estimate` and an Estimator return.

    Its maps, previews and scenes are those of the command line: the place around the photo is in them.
    """

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
            camera_height: m above the ground, 0.1 to 20,000; None: as it is.
            lighting: a stored record of this photo, before the other changes; None: the estimate's own.

        Raises:
            ParameterError: a value is out of range.
        """
        from lighting.envmap.relighting import Adjustments, adjust_lighting, edit_lighting

        if lighting is not None:
            check_lighting(lighting)
        light = adjust_lighting(lighting or self.lighting, Adjustments(sun, exposure, haze, overcast))
        if camera_height is not None:
            check_range("camera_height", camera_height, *RANGES["camera_height"])
            light = edit_lighting(light, {"camera_height": float(camera_height)})
        return dataclasses.replace(self, lighting=light)

    def envmap(
        self,
        height: int = _MAP_HEIGHT,
        *,
        sun: bool | None = None,
        yaw: float = 0.0,
        sky: str | None = None,
        surroundings: bool | None = None,
        detail: bool = True,
        disc: bool = True,
    ) -> NDArray[np.float32]:
        """Render the environment map (height, 2 height, 3) in linear Rec.709, in the photo's linear values.

        Args:
            height: rows of the map, even, 16 to 4096.
            sun: whether the sun is in it; None: where its power is known, or where it likely shines.
            yaw: deg by which the map is turned to the right.
            sky: one of `lighting.sky.SKY_MODELS`, which paints the sky; None: the record's.
            surroundings: whether the place around is in it; None: where the network predicts it.
            detail: whether a map that shows the place has detail all around the photo.
            disc: False leaves the sun's disc for a light of its own; the sun still lights the ground.

        Raises:
            ParameterError: a value is out of range.
            PhotoError: the photo's file has changed since it was read.
        """
        from lighting.envmap.surroundings import render_view

        _check_flags(sun=sun, surroundings=surroundings, detail=detail, disc=disc)
        context = self._map_context(height, surroundings, detail)
        with ONE_BLAS_THREAD:
            return render_view(self.lighting, height, sun=sun, yaw=yaw, sky=sky, context=context, disc=disc)[0]

    def save(
        self,
        path: str | os.PathLike[str],
        height: int = _MAP_HEIGHT,
        *,
        sun: bool | None = None,
        yaw: float = 0.0,
        sky: str | None = None,
        surroundings: bool | None = None,
        detail: bool = True,
        compression: str = "zip",
        colours: str = "rec709",
    ) -> None:
        """Write the environment map; an EXR holds the record, too. It replaces a file, and appears when it is whole.

        Args:
            path: ends in .exr, .hdr or .png.
            height: as in `envmap`.
            sun: as in `envmap`.
            yaw: as in `envmap`; the record in the file is turned with the map.
            sky: as in `envmap`.
            surroundings: as in `envmap`.
            detail: as in `envmap`.
            compression: of an EXR: zip, pxr24 or none.
            colours: primaries of an EXR: rec709, acescg or linear-p3.

        Raises:
            EnvironmentMapError: the path ends otherwise, or cannot be written.
            ParameterError: a value is out of range.
            PhotoError: the photo's file has changed since it was read.
        """
        from lighting.envmap.surroundings import render_view
        from lighting.files import MAP_FORMATS, check_map_name, write_envmap
        from lighting.light_probe import compute_light_probe

        has_header = MAP_FORMATS[check_map_name(path)].has_header
        _check_flags(sun=sun, surroundings=surroundings, detail=detail)
        view: Any = {"sun": sun, "yaw": yaw, "sky": sky, "context": self._map_context(height, surroundings, detail)}
        with ONE_BLAS_THREAD:
            image, lighting = render_view(self.lighting, height, **view)
            probe = compute_light_probe(self.lighting, **view) if has_header else None
        write_envmap(path, image, lighting, compression=compression, probe=probe, colours=colours, overwrite=True)

    def light_probe(
        self,
        *,
        sun: bool | None = None,
        yaw: float = 0.0,
        sky: str | None = None,
        surroundings: bool | None = None,
    ) -> "LightProbe":
        """Compute the light for engines and phones: nine coefficients of all but the sun, and the sun as main light.

        Args:
            sun: as in `envmap`; without it the main light is none.
            yaw: as in `envmap`.
            sky: as in `envmap`.
            surroundings: as in `envmap`.

        Raises:
            ParameterError: a value is out of range.
        """
        from lighting.light_probe import compute_light_probe

        _check_flags(sun=sun, surroundings=surroundings)
        context = self._context(self.photo.pixels, surroundings, detail=False)
        with ONE_BLAS_THREAD:
            return compute_light_probe(self.lighting, context, sun=sun, yaw=yaw, sky=sky)

    def preview(
        self, *, sun: bool | None = None, surroundings: bool | None = None, detail: bool = True
    ) -> "Image.Image":
        """Draw the photo, the sun's probability, the map and three spheres in the light, 1600 pixels wide.

        Args:
            sun: as in `envmap`.
            surroundings: as in `envmap`.
            detail: as in `envmap`.

        Raises:
            PhotoError: the photo's file has changed since it was read.
        """
        from PIL import Image

        from lighting.preview.picture import PHOTO_SIDE, draw_preview_pixels

        _check_flags(sun=sun, surroundings=surroundings, detail=detail)
        options: Any = {"lighting": self.lighting, "sun": sun, "surroundings": surroundings, "detail": detail}
        pixels = reread_photo(self.photo, PHOTO_SIDE).pixels
        with ONE_BLAS_THREAD:
            return Image.fromarray(draw_preview_pixels(pixels, self._unchanged(), **options))

    def scene(
        self,
        tool: str,
        folder: str | os.PathLike[str],
        *,
        overwrite: bool = False,
        height: int = _MAP_HEIGHT,
        sun: bool | None = None,
        surroundings: bool | None = None,
        detail: bool = True,
        **options: str,
    ) -> "Scene":
        """Write a scene for another tool, and return it; its `warnings` say what to know about it.

        Args:
            tool: one of `lighting.scene.EXPORTERS`: "blender", "usd", "gltf", and so on.
            folder: new or empty unless `overwrite`.
            overwrite: whether files in the folder may be replaced.
            height: as in `envmap`.
            sun: as in `envmap`.
            surroundings: as in `envmap`.
            detail: as in `envmap`.
            options: of the tool, such as `up_axis="Z"` for USD.

        Raises:
            SceneError: the tool is unknown, or the folder cannot be written.
            TypeError: the tool has no such option.
            ParameterError: a value is out of range.
            PhotoError: the photo's file has changed since it was read.
        """
        from lighting.scene import EXPORTERS
        from lighting.scene.records import PLATE_SIDE, make_scene
        from lighting.scene.writer import check_scene_target, write_scene

        _check_flags(overwrite=overwrite, sun=sun, surroundings=surroundings, detail=detail)
        check_scene_target(tool, folder, overwrite=overwrite)
        for name in options.keys() - EXPORTERS[tool].options.keys():
            raise TypeError(f"A scene for {tool} has no option {name!r}.")
        plate = reread_photo(self.photo, PLATE_SIDE)
        context = self._context(plate.pixels, surroundings, detail)
        with ONE_BLAS_THREAD:
            scene = make_scene(
                plate, self.lighting, map_height=height, sun=sun, context=context, segments=self.segments
            )
        write_scene(scene, tool, folder, overwrite=overwrite, **options)
        return scene

    def __repr__(self) -> str:
        """One line: where the sun is, how sure that is, and how the camera stands."""
        light = self.lighting
        name = self.photo.source.name if self.photo.source else None
        radii = f" (50 % within {light.radius_50:.1f}°, 90 % within {light.radius_90:.1f}°)" if light.radius_90 else ""
        suitable = "" if light.suitable is None else f", suitable {light.suitable:.2f}"
        return (
            f"<Estimate of {name or f'{self.photo.width} x {self.photo.height} pixels'}: "
            f"sun {format_azimuth(light.sun_azimuth, 1)}, {format_sun_elevation(light.sun_elevation, 1)}{radii}, "
            f"direct sunlight {100 * light.sun_visibility:.0f} %, turbidity {light.turbidity:.1f}; "
            f"camera looks {format_tilt(light.camera_elevation, 1)}, field of view {light.vertical_fov:.1f}°{suitable}>"
        )

    def _repr_png_(self) -> bytes:
        """The preview, which notebooks show."""
        from lighting.preview.picture import encode_preview_png

        return encode_preview_png(np.asarray(self.preview()))

    def _map_context(self, height: int, surroundings: bool | None, detail: bool) -> "PhotoContext | None":
        """The photo, read finer for a high map, and its surroundings."""
        from lighting.envmap.surroundings import photo_context_for_height

        def read_finer(side: int) -> NDArray[np.uint8]:
            return reread_photo(self.photo, side).pixels

        return photo_context_for_height(
            self._unchanged(), self.photo.pixels, height, read_finer, surroundings=surroundings, detail=detail
        )

    def _context(self, pixels: NDArray[np.uint8], surroundings: bool | None, detail: bool) -> "PhotoContext | None":
        from lighting.envmap.surroundings import photo_context

        return photo_context(self._unchanged(), pixels, surroundings=surroundings, detail=detail)

    def _unchanged(self) -> Self:
        """The estimate of the light that the photo shows."""
        return dataclasses.replace(self, lighting=self.photo_lighting)


describe_fields(Estimate)


def _check_flags(**flags: object) -> None:
    """Raise ParameterError for a flag that is neither True, False nor None, such as a direction of the sun."""
    for name, value in flags.items():
        if not isinstance(value, bool | np.bool_ | None):
            hint = "; `replace(sun=(40, 25))` moves it" if name == "sun" else ""
            predicate = f"must be True or False, not {reprlib.repr(value)}{hint}."
            raise ParameterError.about(name, predicate, ErrorCode.WRONG_TYPE)
