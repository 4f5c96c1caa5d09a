"""Dissolves between two places: how many are found, and how many clips without one are divided all the same."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from export.crops import generator
from export.data import Panorama
from export.evaluation.tables import table
from export.video.sequences import RATE, Pixels, Sequenced, sequences, turned
from lighting.model import Model
from lighting.video.clip import Frame
from lighting.video.dissolves import EVERY, Dissolves
from lighting.video.watch import shots_watched

LENGTHS = (0.3, 0.5, 1.0, 2.0)  # s
ALONE = 2.5  # s of each picture without the other
CAMERAS = ("still", "hand", "pan", "tilt", "zoom")

EXPLAINED = (
    f"Two cameras, each still, held, turned or zoomed, in two places: {ALONE:g} s of the first, a dissolve, "
    f"{ALONE:g} s of the second. `two shots`: clips that were taken for two [%]; `one shot`: for one [%]. `off`: error "
    "of where the second shot begins, against the middle of the dissolve, in the median and at the worst [s]."
)
UNDIVIDED = "Clips without a dissolve or cut. `divided`: those in which a dissolve was found [%]."


@dataclass(frozen=True, eq=False)
class Dissolved:
    """A clip of two places."""

    first: Sequenced
    second: Sequenced
    seconds: float  # that both are seen

    @property
    def middle(self) -> float:
        """s, of the dissolve."""
        return ALONE + self.seconds / 2.0

    def frames(self) -> Iterator[Frame]:
        """The clip."""
        alone, both = round(ALONE * RATE), round(self.seconds * RATE)
        for i in range(2 * alone + both):
            share = float(np.clip((i - alone + 1) / (both + 1), 0.0, 1.0))
            yield Frame(i, i / RATE, self._mixed(i, i - alone, share))

    def _mixed(self, i: int, j: int, share: float) -> Pixels:
        if share in (0.0, 1.0):
            return self.second.picture(j) if share else self.first.picture(i)
        mixed = (1.0 - share) * self.first.picture(i) + share * self.second.picture(j)
        return np.round(mixed).astype(np.uint8)


def dissolve_report(panoramas: Sequence[Panorama], kinds: Sequence[str], model: Model) -> str:
    """Both tables."""
    found = [[f"{s:g} s", *(f"{v:.2f}" for v in _measured(panoramas, s, model))] for s in LENGTHS]
    divided = [[kind, *(f"{v:.2f}" for v in _divided(panoramas, kind))] for kind in kinds]
    return "\n\n".join(
        [
            "## Dissolves",
            EXPLAINED,
            table(["", "clips", "two shots", "one shot", "off", "off, worst"], found),
            UNDIVIDED,
            table(["", "clips", "divided"], divided),
        ]
    )


def dissolved(panoramas: Sequence[Panorama], seconds: float) -> Iterator[Dissolved]:
    """One for each panorama, which dissolves into the next one."""
    for first, second in zip(panoramas, [*panoramas[1:], panoramas[0]], strict=True):
        rng = generator(first.name, 0, f"dissolve {seconds}")
        yield Dissolved(_filmed(first, rng), _filmed(second, rng), seconds)


def _filmed(panorama: Panorama, rng: np.random.Generator) -> Sequenced:
    camera = str(rng.choice(CAMERAS))
    if camera != "still":
        return turned(panorama, camera, rng)
    held = turned(panorama, "hand", rng)
    picture = held.picture(0)
    return replace(held, picture=lambda _: picture)


def _measured(panoramas: Sequence[Panorama], seconds: float, model: Model) -> tuple[float, ...]:
    counts, off = [], [np.nan]
    for clip in dissolved(panoramas, seconds):
        shots = list(shots_watched(clip.frames(), model, 1.0))
        counts.append(len(shots))
        off += [abs(shots[1].steps[0].time - clip.middle)] if len(shots) == 2 else []
    shares = (100.0 * float(np.mean(np.array(counts) == n)) for n in (2, 1))
    return len(counts), *shares, float(np.nanmedian(off)), float(np.nanmax(off))


def _divided(panoramas: Sequence[Panorama], kind: str) -> tuple[float, float]:
    told = [_is_divided(clip) for clip in sequences(panoramas, kind)]
    return len(told), 100.0 * float(np.mean(told))


def _is_divided(clip: Sequenced) -> bool:
    dissolves = Dissolves()
    every = max(1, round(EVERY / float(np.median(np.diff(clip.time)))))
    told = [dissolves.take(frame) for frame in clip.frames(every)]
    return any(dissolve is not None for dissolve in (*told, dissolves.finish()))
