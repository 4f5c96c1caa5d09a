"""What a stream teaches as its frames come: which way is up, the light, and the lens; memory constant."""

import numpy as np

from lighting.evidence import Fused, Known
from lighting.geometry import Floats
from lighting.turns import Turn, angles_of, level, own_up
from lighting.video.follow import Key
from lighting.video.keyframes import turn_between
from lighting.video.lens import LENS_FLOOR, LENS_SPREAD, tells_lens
from lighting.video.light import Look, ShotLight
from lighting.video.watched import Seen

UPS = 64  # looks whose gravity and lens count; older ones fade


class Looks:
    """What looks tell in the frame of one chain: which way is up, and the light."""

    def __init__(self, chain: int) -> None:
        self.chain = chain
        self.light = ShotLight()
        self.fused: Fused | None = None  # the light's last answer; None before the first look
        self._up: Floats | None = None
        self._ups = 0

    def add(self, seen: Seen, orientation: Floats, vertical_fov: float, gain: float, known: Known) -> None:
        """Count a look by a camera of that orientation (3, 3)."""
        said = seen.prediction
        up = orientation.T @ own_up(said.camera_elevation, said.camera_roll)
        self._ups = min(self._ups + 1, UPS)
        before = up if self._up is None else self._up
        mean = before + (up - before) / self._ups
        self._up = np.asarray(mean / np.linalg.norm(mean))
        self.light.add(Look(seen, self.angles(orientation)[0], vertical_fov, gain, known.evidence))
        self.fused = self.light.answer(known.evidence)

    def angles(self, orientation: Floats) -> tuple[float, float, float]:
        """Heading, elevation and roll [deg] of a camera, once there was a look."""
        assert self._up is not None
        heading, elevation, roll = angles_of(orientation[None], level(self._up))
        return float(heading[0]), float(elevation[0]), float(roll[0])


class LearntLens:
    """A field of view learnt as frames come: given, or by the network, or by turns between keyframes."""

    def __init__(self, given: float | None) -> None:
        self.given = given  # deg; None where it is not known
        self._sum, self._weight = 0.0, 0.0  # of what turns say
        self._seen, self._looks = 50.0, 0

    @property
    def fov(self) -> float:
        """Vertical, deg."""
        if self.given is not None:
            return self.given
        own = LENS_SPREAD**-2
        return (self._sum + own * self._seen) / (self._weight + own)

    def see(self, fov: float) -> None:
        """Count what the network says of a look."""
        self._looks = min(self._looks + 1, UPS)
        self._seen += (fov - self._seen) / self._looks

    def learn(self, a: Key, b: Key) -> None:
        """From the turn between two keyframes, while the lens is not known well."""
        if self.given is not None or self._weight > 1.0 / LENS_FLOOR**2 * 4:
            return
        turn = turn_between(a, b, None)
        if turn is not None and not turn.zoomed:
            self.count(turn)

    def count(self, turn: Turn) -> None:
        """Learn from a turn to a picture that was seen through this lens."""
        if turn.zoomed or tells_lens(turn, self._seen):
            weight = 1.0 / (turn.fov_sigma**2 + LENS_FLOOR**2)
            self._sum, self._weight = self._sum + weight * turn.vertical_fov[1], self._weight + weight
