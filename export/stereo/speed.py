"""How long the normals of 512 x 512 pixels from eight photos take."""

import os
import time
from collections.abc import Callable

import numpy as np

from export.stereo.trials import SEASONS
from lighting.stereo.days import in_grey
from lighting.stereo.mean_light import illumination
from lighting.stereo.normals.frame import to_world
from lighting.stereo.normals.network import Network
from lighting.stereo.normals.solve import Session, solve

SIDE = 512  # pixels


def report(say: Callable[[str], None]) -> None:
    """Print wall and processor seconds of the search alone and with the network, for one channel and for three."""
    day = SEASONS["47° N, June"]
    y, x = np.mgrid[:SIDE, :SIDE] / (SIDE / 2) - 1
    normals = np.stack([0.6 * x, -0.6 * y, np.sqrt(1 - 0.36 * (x * x + y * y))], axis=-1).reshape(-1, 3)
    world = to_world(normals[::16], day.pose)
    for channels in (1, 3):
        skies = day.skies() if channels == 3 else in_grey(day.skies())
        values = np.einsum("ptjc,pj->ptc", illumination(skies, world), world)
        images = np.moveaxis(np.repeat(values, 16, axis=0).reshape(SIDE, SIDE, -1, channels), 2, 0).astype(np.float32)
        images += np.random.default_rng(0).normal(0, 0.01 * images.max(), images.shape).astype(np.float32)
        session = Session(np.maximum(images, 0), np.ones((SIDE, SIDE), dtype=bool), skies, day.pose)
        for network in (None, Network.load()):
            wall, cpu = time.perf_counter(), os.times()
            solve(session, network=network)
            spent = os.times().user + os.times().system - cpu.user - cpu.system
            how = "search and network" if network else "search"
            say(f"{channels} channel(s), {how}: {time.perf_counter() - wall:.0f} s, {spent:.0f} s of processor")
