"""Streams: what `Tracker` makes of a robot's camera that looks around for minutes."""

import resource
import time as clock
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from export.crops import generator
from export.data import Panorama
from export.evaluation.simulated_metadata import sighting
from export.evaluation.tables import table
from export.video.sequences import displayed, look, sun_of
from lighting.evidence import Given
from lighting.geometry import Floats, wrap_azimuth
from lighting.model import Model
from lighting.video import Tracker
from lighting.video.zoom import zoomed_fov

SECONDS, RATE = 90.0, 10.0
SIZE = (640, 480)
FOV = 50.0  # deg
ROUNDS = 2.0  # to the right, and as many back
STREAMS = 3
ZOOM, ZOOMED = 2.0, (20.0, 25.0)  # times, s
OFF = 3.0  # deg

EXPLAINED = (
    f"A camera of {SIZE[0]} x {SIZE[1]} pixels, {FOV:g}° high, {SECONDS:g} s at {RATE:g} frames a second: {ROUNDS:g} "
    "rounds to the right and as many back. `heading` is against the first frame, in the median, at the worst, and at "
    "the end, where the camera is where it began; `absolute` by sun, time and place (simulated as `evaluate "
    "--with-metadata` does), after a sixth of the stream and at its end. `CPU` and `wall` are ms a frame, `slowest` "
    "the longest of all; `growth` is that of the process's peak memory [MB] over the last two thirds. `linked`: frames "
    "whose heading is told as one against the first frame [%]; `silent`: those of them that are off by more than "
    f"{OFF:g}° [% of all]. Where the lens is zoomed, its focal length grows by {ZOOM:g} times from {ZOOMED[0]:g} to "
    f"{ZOOMED[1]:g} s."
)


def stream_report(panoramas: Sequence[Panorama], model: Model) -> str:
    """The table of streams."""
    rows = {
        panorama.name + (", zoomed" if zoom != 1.0 else ""): measured(panorama, model, zoom)
        for panorama in panoramas[:STREAMS]
        for zoom in (1.0, ZOOM)
    }
    columns = list(next(iter(rows.values())))
    lines = [[name, *(f"{row[c]:.1f}" for c in columns)] for name, row in rows.items()]
    return f"## Streams\n\n{EXPLAINED}\n\n{table(['', *columns], lines)}"


def measured(panorama: Panorama, model: Model, zoom: float) -> dict[str, float]:
    """What one stream gives, whose lens is zoomed by so many times."""
    sun, rng = sun_of(panorama), generator(panorama.name, 0, "stream")
    there = sighting(max(sun[1], 1.0), rng)
    tracker = Tracker(model, Given(time=there.time, latitude=there.latitude, longitude=there.longitude))
    picture, time = displayed(panorama), np.arange(round(SECONDS * RATE)) / RATE
    azimuth = rng.uniform(-180, 180) + 360 * ROUNDS * (1 - np.abs(1 - 2 * time / time[-1]))
    north = there.compass - sun[0] + azimuth  # the camera's true heading
    zooms = zoom ** np.clip((time - ZOOMED[0]) / (ZOOMED[1] - ZOOMED[0]), 0.0, 1.0)
    errors, linked, spent, before = [], [], [], 0.0
    for i, moment in enumerate(time):
        at = (float(azimuth[i]), 4.0 * float(np.sin(moment / 3.1)), 1.5 * float(np.sin(moment / 2.3)))
        frame = look(picture, at, zoomed_fov(FOV, float(zooms[i])), SIZE)
        start = clock.process_time(), clock.perf_counter()
        answer = tracker(frame, float(moment))
        spent.append((clock.process_time() - start[0], clock.perf_counter() - start[1]))
        before = _peak() if i == len(time) // 3 else before
        if answer is not None and answer.lighting.camera_heading is not None:
            own = (answer.heading - (azimuth[i] - azimuth[0]), answer.lighting.camera_heading - north[i])
            errors.append(np.abs(wrap_azimuth(own)))
            linked.append(answer.linked)
    return {
        **_errors(np.array(errors), np.array(linked)),
        **_times(1000.0 * np.array(spent)),
        "growth": _peak() - before,
    }


def _errors(errors: Floats, linked: NDArray[np.bool_]) -> dict[str, float]:
    """Of headings relative and absolute (N, 2), of which those `linked` (N,) are told as against the first frame."""
    sixth = len(errors) // 6
    return {
        "heading": float(np.median(errors[:, 0])),
        "worst": float(errors[:, 0].max()),
        "at the end": float(np.median(errors[-20:, 0])),
        "absolute": float(np.median(errors[sixth : sixth + 20, 1])),
        "absolute, end": float(np.median(errors[-20:, 1])),
        "linked": 100.0 * float(linked.mean()),
        "silent": 100.0 * float(np.mean(linked & (errors[:, 0] > OFF))),
    }


def _times(spent: Floats) -> dict[str, float]:
    """Of CPU and wall times (N, 2) [ms]."""
    cpu, wall = spent.mean(axis=0)
    return {"CPU": float(cpu), "wall": float(wall), "slowest": float(spent[:, 1].max())}


def _peak() -> float:
    """Peak memory of this process [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
