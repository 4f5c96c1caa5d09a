"""The maps of a shot: its light, and the place as one of its frames shows it.

All maps of a shot show the same frame and the same detail, so that nothing changes from one to the next. That frame is
decoded again, by a second reader that follows the first: no pixels are kept in memory.
"""

from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from lighting.envmap.latlong import Image
from lighting.envmap.relighting import Adjustments, radiance_gain, rotate_envmap, rotate_lighting, scale_exposure
from lighting.envmap.render import add_sun, cap_map
from lighting.envmap.surroundings import PhotoContext, render_view
from lighting.light_probe import LightProbe, compute_light_probe
from lighting.records import Lighting
from lighting.segmentation import packaged_segmenter
from lighting.tracing import trace_step
from lighting.video.decode import Clip
from lighting.video.shot import FrameLight, Shot, lighting_in_frame, shot_lighting

_VIEW_SIDE = 1000  # pixels of the longer side of a frame that maps show


class ViewReader:
    """Reads the frames that maps show; a context manager. The clip is opened at the first of them."""

    def __init__(self, path: Path) -> None:
        """Begin.

        Args:
            path: of the clip.
        """
        self._path, self._wanted = path, set[int]()
        self._clip: Clip | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._clip is not None:
            self._clip.__exit__(kind, error, traceback)

    def read(self, shot: Shot) -> PhotoContext | None:
        """Return what the maps of a shot show of the place; None where they show sky and ground alone.

        Args:
            shot: one that comes after those of the calls before.

        Raises:
            VideoError: the clip cannot be read any more.
            OSError: the same.
        """
        if shot.view is None:
            return None
        if self._clip is None:
            self._clip = Clip(self._path, _VIEW_SIDE)
            self._frames = self._clip.frames(self._wanted)
        self._wanted.add(int(shot.frames[shot.view.index]))
        frame = next(self._frames, None)
        return None if frame is None else _view_context(shot, frame.pixels)


def _view_context(shot: Shot, pixels: NDArray[np.uint8]) -> PhotoContext | None:
    """The surroundings by the pixels (h, w, 3) sRGB of the frame that a shot's maps show."""
    if shot.view is None:
        return None
    index = shot.view.index
    light = lighting_in_frame(shot, index, scale_exposure(shot_lighting(shot), shot.gains[index]))
    with trace_step("network"):
        segments = packaged_segmenter()(pixels)
    return PhotoContext(pixels, shot.view.coarse_panorama, light.exposure, light, segments, detail=True)


@dataclass(frozen=True, eq=False)
class ShotMap:
    """The light of a shot, and what its maps show."""

    shot: Shot
    """A solved one."""
    context: PhotoContext | None = None
    """Of `ViewReader`; None: sky and ground alone."""
    adjustments: Adjustments | None = None
    """Of the light by hand, as the shot's first camera sees it; None: none."""
    sun: bool | None = None
    """Whether the sun is in the maps; None where it likely shines."""

    @property
    def heading(self) -> float:
        """Of the camera that the place is seen by, deg from azimuth 0; of sky and ground alone it is 0."""
        return 0.0 if self.context is None or self._index is None else float(self.shot.path.heading[self._index])

    @property
    def _index(self) -> int | None:
        return None if self.shot.view is None else self.shot.view.index

    def render_world(self, height: int) -> tuple[Image, Lighting, LightProbe]:
        """Render the map with true north at its center, or else the first frame's heading.

        Args:
            height: H, rows of the map.

        Returns:
            The map (H, 2H, 3), linear Rec.709, the light that it shows, and that light's probe.
        """
        light = shot_lighting(self.shot, self.adjustments)
        north, seen = light.camera_heading or 0.0, self._light_seen()
        yaw = north + self.heading
        image, _ = render_view(seen, height, sun=self.sun, yaw=yaw, context=self.context)
        probe = compute_light_probe(seen, self.context, sun=self.sun, yaw=yaw)
        return image, rotate_lighting(light, north) if north else light, probe

    def render_sky(self, height: int) -> Image:
        """Render the map (H, 2H, 3) as the camera at `heading` sees it, without the sun's disc.

        Args:
            height: H, rows of the map.
        """
        return render_view(self._light_seen(), height, sun=self.sun, context=self.context, disc=False)[0]

    def turn_to_frame(self, sky: Image, frame: FrameLight) -> Image:
        """Return the map (H, 2H, 3) of one frame.

        Args:
            sky: (H, 2H, 3), of `render_sky`.
            frame: its light.
        """
        light = frame.lighting
        gain = np.asarray(radiance_gain(light, np.array(frame.gain)), dtype=np.float32)
        image = rotate_envmap(sky, self.heading - (light.relative_heading or 0.0)) * gain
        cap_map(image, light)
        if light.sun_painted if self.sun is None else self.sun:
            add_sun(image, light)
        return image

    def _light_seen(self) -> Lighting:
        """The light as the camera at `heading` sees it."""
        light = shot_lighting(self.shot, self.adjustments)
        if self.context is None or self._index is None:
            return light
        return lighting_in_frame(self.shot, self._index, light)
