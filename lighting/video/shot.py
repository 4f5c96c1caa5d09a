"""From a clip to its shots: the lens, the camera's path, the one sun of each, and a record of each frame.

Errors of a chain of rotations add up. Where the camera comes back to what it saw, features of keyframes are matched and
the loop is closed. Orientations then are those with the least sum of squared differences to all rotations (rotation
averaging, Chatterjee and Govindu 2013), rotations far off counting little.

Orientations are rotations (3, 3) from the frame of the shot's first camera (x right, y up, it looks along -z) to that
of a later one.
"""

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import timedelta
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from lighting.color import luminance
from lighting.decoding import with_ground_color
from lighting.envmap.relighting import adjust_lighting, radiance_gain, scale_exposure
from lighting.errors import VideoError
from lighting.fusion.estimate import build_estimate
from lighting.fusion.metadata_prior import MetadataPrior
from lighting.fusion.single_view import Posterior
from lighting.fusion.user_input import NO_USER_INPUT, UserInput
from lighting.geometry import Floats, angle_between, wrap_azimuth, zoomed_fov
from lighting.light_probe import compute_light_probe, main_light, rotate_harmonics
from lighting.map_options import Adjustments
from lighting.model import Model
from lighting.record_json import record_with_coefficients
from lighting.records import Lighting, LightProbe
from lighting.registration.rotations import (
    camera_up,
    consensus_up,
    focal_from_fov,
    heading_elevation_roll,
    leveling_rotation,
    rotation_about,
    rotation_vector,
)
from lighting.sun_grid import circular_mean
from lighting.video.decode import Clip
from lighting.video.intrinsics import (
    MAX_FOV_STDS,
    MIN_ZOOMED_FRAMES,
    NETWORK_FOV_STD,
    UnzoomedShot,
    fit_fov,
    prior_fov,
    remove_zoom,
    smooth_parabolic,
)
from lighting.video.metadata import Gimbal
from lighting.video.observation import NETWORK_INTERVAL, FrameObservation, ShotLight, observe_shots
from lighting.video.tracking import (
    GAP_KEYFRAMES,
    ClipMetadata,
    FrameEstimate,
    FrameRotation,
    Keyframe,
    ShotObservations,
    chain_gains,
    choose_sharpest,
    estimate_frame_rotation,
    is_reliable,
    match_keyframes,
)

MIN_AGREEMENT = 0.45  # share of the points that must agree in the median frame, or the answer says that it is not sure
_NIGHT_FALLS = "By time and place it is night at {:.1f} s: such frames do not count."
_ZOOM_LOST = "The zoom is unknown in {:.0f} % of the frames: headings may be off."
_FEW_AGREE = "Only {:.0f} % of the points agree in most frames: headings may be off."
_ODD_LENS = "The points show a field of view of {:.0f}°, not {:.0f}°: headings may be off."

MIN_LOOP_KEYFRAMES = 5  # keyframes; those nearer in time need no loop
MAX_LOOP_ANGLE = 0.5  # of the vertical field of view, up to which two keyframes are compared
MAX_LOOPS = 60  # compared in a shot
MAX_AVERAGED_KEYFRAMES = 1200  # beyond which the chain is left as it is: the graph would take too much memory
_MAX_ROUNDS = 12  # of the averaging, at most
_OUTLIER_ANGLE = 0.5  # deg, beyond which a rotation counts for ever less


@dataclass(frozen=True, eq=False)
class _Link:
    """A rotation between two keyframes."""

    a: int
    b: int
    rotation: Floats  # (3, 3) directions in a's camera to b's
    weight: float = 1.0


def _chain_orientations(count: int, links: Sequence[_Link]) -> tuple[Floats, NDArray[np.intp]]:
    """Orientations (K, 3, 3) along the links, and which part (K,) each keyframe belongs to.

    Each part's first keyframe has the identity.
    """
    orientation, part = np.tile(np.eye(3), (count, 1, 1)), np.full(count, -1)
    neighbors: list[list[tuple[int, Floats]]] = [[] for _ in range(count)]
    for link in links:
        neighbors[link.a].append((link.b, link.rotation))
        neighbors[link.b].append((link.a, link.rotation.T))
    for start in range(count):
        queue = [start] if part[start] < 0 else []
        part[queue] = start
        while queue:
            current = queue.pop(0)
            for other, rotation in neighbors[current]:
                if part[other] < 0:
                    part[other], orientation[other] = start, rotation @ orientation[current]
                    queue.append(other)
    return orientation, part


def _average_rotations(orientation: Floats, links: Sequence[_Link], fixed: NDArray[np.bool_]) -> Floats:
    """Orientations (K, 3, 3) that fit the links best, from ones nearby; those `fixed` (K,) stay."""
    count = len(orientation)
    if len(links) < count or count > MAX_AVERAGED_KEYFRAMES:
        return orientation
    a, b = (np.array([getattr(link, end) for link in links]) for end in ("a", "b"))
    rotations, link_weight = np.stack([link.rotation for link in links]), np.array([link.weight for link in links])
    for _ in range(_MAX_ROUNDS):
        error = np.swapaxes(orientation[b], 1, 2) @ rotations @ orientation[a]
        residual = np.stack([rotation_vector(r) for r in error])
        weight = link_weight / (1.0 + np.sum(residual**2, axis=1) / np.radians(_OUTLIER_ANGLE) ** 2)
        step = _rotation_steps(a, b, residual, weight, fixed)
        orientation = orientation @ rotation_about(step)
        if np.abs(step).max() < 1e-7:
            break
    return orientation


def _rotation_steps(
    a: NDArray[np.intp], b: NDArray[np.intp], residual: Floats, weight: Floats, fixed: NDArray[np.bool_]
) -> Floats:
    """Small rotation vectors (K, 3) in the first camera's frame, by which orientations are to be turned."""
    count = len(fixed)
    laplacian, right = np.zeros((count, count)), np.zeros((count, 3))
    for row, column, entry in ((a, a, weight), (b, b, weight), (a, b, -weight), (b, a, -weight)):
        np.add.at(laplacian, (row, column), entry)
    np.add.at(right, b, weight[:, None] * residual)
    np.add.at(right, a, -weight[:, None] * residual)
    laplacian[fixed] = 0.0
    laplacian[fixed, fixed] = 1.0
    right[fixed] = 0.0
    return np.linalg.solve(laplacian + 1e-9 * np.eye(count), right)


def _close_loops(
    keys: Sequence[Keyframe], orientation: Floats, part: NDArray[np.intp], vertical_fov: float
) -> list[_Link]:
    """Rotations by features between keyframes that look nearly the same way and are not neighbors."""
    pairs = list(_near_pairs(orientation, part, MAX_LOOP_ANGLE * vertical_fov))
    step = max(1, math.ceil(len(pairs) / MAX_LOOPS))
    rotations = [(i, j, match_keyframes(keys[i], keys[j], vertical_fov)) for i, j in pairs[::step]]
    return [_Link(i, j, rotation.rotation, 0.5) for i, j, rotation in rotations if rotation is not None]


def _near_pairs(orientation: Floats, part: NDArray[np.intp], within: float) -> Iterator[tuple[int, int]]:
    """Pairs of keyframes that look the same way to an angle [deg], each with the nearest of those long before it."""
    for j in range(MIN_LOOP_KEYFRAMES, len(orientation)):
        older = np.flatnonzero(part[: j - MIN_LOOP_KEYFRAMES + 1] == part[j])
        angle = angle_between(orientation[older, 2], orientation[j, 2])
        if angle.min(initial=np.inf) < within:
            yield int(older[int(np.argmin(angle))]), j


# Orientations of all frames, and up.

GIMBAL_INTERVAL = 0.5  # s between the gimbal's angles that count


def _estimate_orientations(
    tracked: ShotObservations, rotations: Sequence[FrameRotation], fov: float
) -> tuple[Floats, NDArray[np.bool_]]:
    """Estimate the frames' orientations from all rotations between keyframes and frames.

    Args:
        tracked: a shot.
        rotations: those of `_estimate_frame_rotations`, one a frame.
        fov: deg, vertical field of view.

    Returns:
        Orientations (N, 3, 3) against the shot's first camera, and which of them are to be used (N,).

    References:
        [1] Chatterjee and Govindu, Efficient and robust large-scale rotation averaging, ICCV 2013.
    """
    lowest = tracked.steps[0].key
    numbers = [n for s in tracked.steps for n in (s.key, s.next_key) if n is not None]
    count = max(numbers) - lowest + 1
    steps = zip(tracked.steps, rotations, strict=True)
    ends = [(s.key - lowest, s.next_key - lowest, r.rotation) for s, r in steps if s.next_key is not None]
    chain = [*(_Link(*end, 2.0) for end in ends), *_bridge_gaps(tracked, lowest, fov)]
    orientation, part = _chain_orientations(count, chain)
    keys = sorted(tracked.keys.values(), key=lambda k: k.number)
    where = np.array([k.number - lowest for k in keys], dtype=np.intp)
    loops = _close_loops(keys, orientation[where], part[where], fov) if len(keys) > 3 else []
    closed = [replace(link, a=int(where[link.a]), b=int(where[link.b])) for link in loops]
    orientation = _average_rotations(orientation, [*chain, *closed], part == np.arange(count))
    key_index = np.array([step.key - lowest for step in tracked.steps])
    frames = np.stack([t.rotation for t in rotations]) @ orientation[key_index]
    main = np.bincount(part[key_index]).argmax()
    reliable = [is_reliable(t, is_start=s.is_start) for t, s in zip(rotations, tracked.steps, strict=True)]
    is_used = np.array(reliable) & (part[key_index] == main)
    return frames @ frames[int(np.argmax(is_used))].T, is_used


def _estimate_frame_rotations(tracked: ShotObservations, fov: float) -> list[FrameRotation]:
    """Estimate each frame's rotation against its keyframe.

    Args:
        tracked: a shot.
        fov: deg, vertical field of view.
    """
    focal = focal_from_fov(fov, *tracked.size)
    result: list[FrameRotation] = []
    last = -1
    for step in tracked.steps:
        if step.is_start or not len(step.matches):
            result.append(FrameRotation(np.eye(3), 1.0 if step.is_start else 0.0, len(step.matches)))
        else:
            guess = result[-1].rotation if step.key == last else np.eye(3)
            result.append(estimate_frame_rotation(step.matches, focal, guess))
        last = step.key
    return result


def _bridge_gaps(tracked: ShotObservations, lowest: int, fov: float) -> Iterator[_Link]:
    """Rotations over the gaps between stretches."""
    stretches = sorted({k.stretch for k in tracked.keys.values()})
    keys = {s: [k for k in tracked.keys.values() if k.stretch == s] for s in stretches}
    for before, after in pairwise(stretches):
        for a, b in product(keys[before][-GAP_KEYFRAMES:], keys[after][:GAP_KEYFRAMES]):
            if (rotation := match_keyframes(a, b, fov)) is not None:
                yield _Link(a.number - lowest, b.number - lowest, rotation.rotation)


def _estimate_up(tracked: ShotObservations, orientation: Floats, time: Floats, gimbal: Gimbal) -> Floats:
    """Estimate up (3,) in the shot's first camera: by the gimbal if there is one, else what most estimates agree upon.

    Args:
        tracked: a shot with one estimate or more.
        orientation: (N, 3, 3) of the frames against the first camera.
        time: (N,) s, of the frames, rising.
        gimbal: may be empty.
    """
    if samples := _sample_gimbal(gimbal, time):
        ups = np.stack([camera_up(elevation, roll) for _, (_, elevation, roll) in samples])
        return consensus_up(orientation[[i for i, _ in samples]], ups)
    position = {step.frame: i for i, step in enumerate(tracked.steps)}
    predictions = [estimate.prediction for estimate in tracked.estimates.values()]
    ups = np.stack([camera_up(p.camera_elevation, p.camera_roll) for p in predictions])
    return consensus_up(orientation[[position[f] for f in tracked.estimates]], ups)


def _sample_gimbal(gimbal: Gimbal, time: Floats) -> list[tuple[int, tuple[float, float, float]]]:
    """Read a gimbal every GIMBAL_INTERVAL.

    Args:
        gimbal: may be empty.
        time: (N,) s, of the frames, rising.

    Returns:
        Indices into `time`, each with heading, elevation and roll, deg.
    """
    first = np.unique((time - time[0]) // GIMBAL_INTERVAL, return_index=True)[1]
    return [(int(i), angles) for i in first if (angles := gimbal.at(float(time[i]))) is not None]


# The camera's path.


@dataclass(frozen=True, eq=False)
class _CameraPath:
    """How the camera pointed, frame by frame."""

    time: Floats
    """Time, (N,) s."""
    heading: Floats
    """(N,) deg clockwise from the first frame's, continuous: it may pass 180."""
    elevation: Floats
    """Elevation, (N,) deg."""
    roll: Floats
    """Roll, (N,) deg."""
    bridged: NDArray[np.bool_]
    """(N,) where nothing could be followed and the neighbors tell."""


def _make_camera_path(time: Floats, orientations: Floats, is_used: NDArray[np.bool_], leveling: Floats) -> _CameraPath:
    """Make a camera's path: gaps bridged, trembling smoothed.

    Args:
        time: (N,) s, rising.
        orientations: (N, 3, 3) against the shot's first camera.
        is_used: (N,), which of them are reliable; at least one.
        leveling: (3, 3) rotation that levels the first camera.
    """
    heading, elevation, roll = heading_elevation_roll(orientations, leveling)
    heading, elevation, roll = heading[is_used], elevation[is_used], roll[is_used]
    heading, roll = (np.degrees(np.unwrap(np.radians(angle))) for angle in (heading, roll))
    interpolated = (np.interp(time, time[is_used], angle) for angle in (heading, elevation, roll))
    heading, elevation, roll = (smooth_parabolic(time, v) for v in interpolated)
    return _CameraPath(time, heading, np.clip(elevation, -90.0, 90.0), roll, ~is_used)


@dataclass(frozen=True, eq=False)
class _ShotView:
    """The frame of a shot that its maps show."""

    index: int
    """In the shot's arrays."""
    coarse_panorama: NDArray[np.float32]
    """Of what lies around that frame, as `EstimatedLight.surroundings` has it."""


@dataclass(frozen=True, eq=False)
class Shot:
    """One shot: where the camera points in each frame, and the light in the axes of its first frame."""

    frames: NDArray[np.intp]
    """(N,) indices in the clip."""
    path: _CameraPath
    """How the camera moved."""
    gains: Floats
    """(N, 3) of the linear values, relative to the shot's first frame."""
    vertical_fov: float
    """Deg, of the shot's first frame."""
    fov_std: float
    """Deg, one standard deviation of that."""
    zoom: Floats
    """(N,) focal length by the first frame's; 1 throughout unless the lens was zoomed."""
    posterior: Posterior
    """The sun, as the shot's first camera sees it, its tilt removed."""
    ground: Floats | None
    """(3,) reflectance; None where no frame shows it."""
    prior: MetadataPrior
    """What the metadata say."""
    north: float | None
    """Deg clockwise from true north, where azimuth 0 points; None unknown."""
    view: _ShotView | None = None
    """The frame that maps show; None where the network predicts no surroundings."""


def solve_shot(tracked: ShotObservations, clip_metadata: ClipMetadata) -> Shot:
    """Find a shot's lens, path and light.

    Args:
        tracked: what was observed of it.
        clip_metadata: what is known of the clip.

    Raises:
        VideoError: the network saw none of its frames.
        ParameterError: the user's time and place are of night at the clip's first frame.
    """
    if not tracked.estimates:
        raise VideoError("No frame of the shot is bright enough, and shows enough, for daylight.")
    if (unzoomed := remove_zoom(tracked, clip_metadata)) is None:
        by_lens = {frame: seen.by_lens or seen for frame, seen in tracked.estimates.items()}
        lens = fit_fov(tracked, clip_metadata)
        unzoomed = UnzoomedShot(replace(tracked, estimates=by_lens), np.ones(len(tracked.steps)), lens)
    tracked, fov = unzoomed.tracked, unzoomed.lens[0]
    rotations = _estimate_frame_rotations(tracked, fov)
    orientation, reliable = _estimate_orientations(tracked, rotations, fov)
    time = np.array([step.time for step in tracked.steps])
    up = _estimate_up(tracked, orientation, time, clip_metadata.gimbal)
    path = _make_camera_path(time, orientation, reliable, leveling_rotation(up))
    warnings = tuple(_tracking_warnings(unzoomed, clip_metadata, rotations))
    return _light_shot(unzoomed, clip_metadata, path, chain_gains(tracked.steps), warnings)


def _tracking_warnings(
    unzoomed: UnzoomedShot, clip_metadata: ClipMetadata, rotations: Sequence[FrameRotation]
) -> Iterator[str]:
    """Sentences on why headings may be wrong though points were followed."""
    steps = unzoomed.tracked.steps
    shares = [rotation.share for rotation, step in zip(rotations, steps, strict=True) if len(step.matches)]
    fov, expected = unzoomed.lens[0], prior_fov(unzoomed.tracked, clip_metadata)[0]
    if unzoomed.zoom_share < MIN_ZOOMED_FRAMES:
        yield _ZOOM_LOST.format(100.0 * (1.0 - unzoomed.zoom_share))
    if shares and (share := float(np.median(shares))) < MIN_AGREEMENT:
        yield _FEW_AGREE.format(100.0 * share)
    if clip_metadata.user_input.vertical_fov is None and abs(fov - expected) > MAX_FOV_STDS * NETWORK_FOV_STD:
        yield _ODD_LENS.format(fov, expected)


def _light_shot(
    unzoomed: UnzoomedShot, clip_metadata: ClipMetadata, path: _CameraPath, gains: Floats, warnings: tuple[str, ...]
) -> Shot:
    """The shot along a path with gains (N, 3): the light of its estimates, with `warnings`."""
    tracked, (fov, fov_std) = unzoomed.tracked, unzoomed.lens
    first = clip_metadata.prior_at(float(path.time[0]), _compass_heading(path, clip_metadata.gimbal))
    position = {step.frame: i for i, step in enumerate(tracked.steps)}
    priors = {frame: clip_metadata.prior_at(float(path.time[position[frame]])) for frame in tracked.estimates}
    by_day = {frame for frame, prior in priors.items() if not prior.is_night}
    if not by_day or first.is_night:  # only in a shot that begins by day frames of night do not count
        by_day = set(priors)
    light = ShotLight()
    for frame, estimate in tracked.estimates.items():
        if frame in by_day:
            i = position[frame]
            gain, frame_fov = float(luminance(gains[i])), zoomed_fov(fov, float(unzoomed.zoom[i]))
            light.add(FrameObservation(estimate, float(path.heading[i]), frame_fov, gain, priors[frame].observations))
    if night := [float(path.time[position[frame]]) for frame in priors if frame not in by_day]:
        first = replace(first, warnings=(*first.warnings, _NIGHT_FALLS.format(min(night))))
    first = replace(first, warnings=(*clip_metadata.warnings, *first.warnings, *warnings))
    posterior = light.answer(first.observations)
    posterior = replace(posterior, prediction=replace(posterior.prediction, vertical_fov=fov))
    frames, north = np.array([step.frame for step in tracked.steps]), estimate_north(posterior, first)
    view = _choose_view({position[frame]: tracked.estimates[frame] for frame in sorted(by_day)}, path)
    return Shot(frames, path, gains, fov, fov_std, unzoomed.zoom, posterior, light.ground, first, north, view)


def _choose_view(estimates: Mapping[int, FrameEstimate], path: _CameraPath) -> _ShotView | None:
    """The sharpest of the most suitable frames, the first of equals; estimates are by their index in the shot."""
    lights = {i: light for i, seen in estimates.items() if (light := seen.prediction.light) is not None}
    panoramas = {i: light.surroundings for i, light in lights.items() if light.surroundings is not None}
    followed = [i for i in panoramas if not path.bridged[i]] or list(panoramas)
    if not followed:
        return None
    index = choose_sharpest({i: estimates[i] for i in followed})
    return _ShotView(index, panoramas[index])


def _compass_heading(path: _CameraPath, gimbal: Gimbal) -> float | None:
    """Where azimuth 0 points by the gimbal, deg clockwise from north; None without one."""
    if not (samples := _sample_gimbal(gimbal, path.time)):
        return None
    return circular_mean([heading - path.heading[i] for i, (heading, *_) in samples]) % 360.0


def estimate_north(posterior: Posterior, prior: MetadataPrior) -> float | None:
    """Return where azimuth 0 points: by sun and compass together, or by the compass alone.

    Args:
        posterior: of the light, azimuth 0 being the shot's or chain's.
        prior: what metadata say of that moment.

    Returns:
        deg clockwise from true north; None where it is unknown.
    """
    return prior.observations.heading if posterior.camera_heading is None else posterior.camera_heading.best


# Records of frames.


@dataclass(frozen=True)
class FrameLight:
    """One frame's answer."""

    shot: int
    """Counted from 1."""
    frame: int
    """Counted from 0 in the clip."""
    time: float
    """Seconds from the clip's first frame."""
    lighting: Lighting
    """As this frame's camera sees it; `relative_heading` is against the shot's first frame."""
    gain: tuple[float, float, float]
    """Linear red, green and blue against the shot's first frame."""
    bridged: bool
    """Whether the camera's angles follow from its neighbors, because nothing could be followed."""
    probe: LightProbe
    """Of that light, and of the place where the maps show it."""
    in_map: bool = False
    """Whether the shot's maps show this frame."""

    def to_line(self, name: str) -> str:
        """Return one line of JSON about the frame.

        Args:
            name: of the clip.
        """
        record = {"file": name, "shot": self.shot, "frame": self.frame, "time": round(self.time, 6)}
        record |= {"gain": list(self.gain), "bridged": self.bridged, "in_map": self.in_map}
        return json.dumps(record | {"lighting": record_with_coefficients(self.lighting, self.probe)}, allow_nan=False)


def shot_lighting(shot: Shot, adjustments: Adjustments | None = None) -> Lighting:
    """Return a shot's light as its first camera sees it.

    Args:
        shot: a solved one.
        adjustments: what is changed of it by hand; None: nothing.
    """
    light = with_ground_color(build_estimate(shot.posterior, shot.prior).lighting, shot.ground)
    elevation, roll = _round_angle(shot.path.elevation[0]), _round_angle(wrap_azimuth(shot.path.roll[0]))
    heading = None if shot.north is None else _round_heading(shot.north)
    light = replace(light, camera_elevation=elevation, camera_roll=roll, camera_heading=heading)
    return light if adjustments is None else adjust_lighting(light, adjustments)


def frame_lights(
    shot: Shot,
    number: int,
    adjustments: Adjustments | None = None,
    sun: bool | None = None,
    harmonics: Floats | None = None,
) -> Iterator[FrameLight]:
    """Return one record a frame.

    Args:
        shot: a solved one.
        number: the shot's, counted from 1.
        adjustments: what is changed of the light by hand; None: nothing.
        sun: whether the light probes have a sun; None where it likely shines.
        harmonics: (9, 3) of the light and the place as the first camera sees them; None: of sky and ground alone.
    """
    base, path = shot_lighting(shot, adjustments), shot.path
    coefficients = compute_light_probe(base, sun=sun).coefficients if harmonics is None else harmonics
    for i, frame in enumerate(shot.frames.tolist()):
        red, green, blue = (round(float(g), 5) for g in shot.gains[i])
        lighting = lighting_in_frame(shot, i, scale_exposure(base, shot.gains[i]))
        if lighting.utc_time is not None:
            later = timedelta(seconds=float(path.time[i] - path.time[0]))
            lighting = replace(lighting, utc_time=lighting.utc_time + later)
        gain = radiance_gain(base, shot.gains[i])
        seen = rotate_harmonics(coefficients, -float(path.heading[i])) * gain  # one sky, seen from a turned camera
        probe = LightProbe(seen, main_light(lighting, sun=sun))
        in_map = shot.view is not None and i == shot.view.index
        bridged, time = bool(path.bridged[i]), float(path.time[i])
        yield FrameLight(number, frame, time, lighting, (red, green, blue), bridged, probe, in_map)


def lighting_in_frame(shot: Shot, index: int, light: Lighting) -> Lighting:
    """Return a shot's light as the camera of one of its frames sees it.

    Args:
        shot: a solved one.
        index: of the frame in the shot's arrays.
        light: as the shot's first camera sees it.
    """
    path = shot.path
    angles = float(path.heading[index]), float(path.elevation[index]), float(path.roll[index])
    return lighting_in_camera(light, angles, zoomed_fov(light.vertical_fov, float(shot.zoom[index])), shot.north)


def lighting_in_camera(
    light: Lighting, angles: tuple[float, float, float], fov: float, north: float | None
) -> Lighting:
    """Return a light as another camera sees it.

    Args:
        light: as a level camera at azimuth 0 sees it.
        angles: deg, heading from azimuth 0 (clockwise), elevation and roll of the other camera.
        fov: deg, vertical field of view of the other camera.
        north: deg clockwise from true north, where azimuth 0 points; None is unknown.
    """
    heading, elevation, roll = angles
    return replace(
        light,
        sun_azimuth=_round_angle(wrap_azimuth(light.sun_azimuth - heading)),
        sun_candidates=(),
        camera_elevation=_round_angle(elevation),
        camera_roll=_round_angle(wrap_azimuth(roll)),
        vertical_fov=_round_angle(fov),
        camera_heading=None if north is None else _round_heading(north + heading),
        camera_heading_probability=(),
        relative_heading=_round_heading(heading),
    )


def _round_angle(degrees: Floats | float) -> float:
    """To four digits behind the point."""
    return round(float(degrees), 4)


def _round_heading(degrees: float) -> float:
    """The same from 0 up to 360."""
    return _round_angle(degrees % 360.0) % 360.0


def analyze_shots(
    clip: Clip,
    model: Model,
    user_input: UserInput = NO_USER_INPUT,
    every: float = NETWORK_INTERVAL,
    progress: Callable[[float], object] | None = None,
) -> Iterator[Shot | VideoError]:
    """Solve each shot of an open clip as soon as it is over.

    Args:
        clip: an open one, not yet read.
        model: the network.
        user_input: of the clip's first frame.
        every: s between the frames that the network sees.
        progress: called with the time [s] of each frame; None is not called.

    Returns:
        The shots; in place of one without light the reason, a VideoError.

    Raises:
        MissingExtraError: OpenCV is not installed.
        ModelError: the network fails.
        ParameterError: the user's time and place are of night at the clip's first frame.
    """
    clip_metadata = ClipMetadata.of_clip(clip, user_input)
    known_fov = clip_metadata.vertical_fov
    for tracked in observe_shots(clip.frames(), model, every, progress, known_fov, clip.keep_picture):
        try:
            yield solve_shot(tracked, clip_metadata)
        except VideoError as error:
            first, last = tracked.steps[0].time, tracked.steps[-1].time
            yield VideoError(f"From {first:.1f} to {last:.1f} s: {error}")
