"""Several photos of a request matched with each other, in a process of their own; or why they were not."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from anyio.from_thread import check_cancelled

from lighting import turns
from lighting.errors import LightingError, MissingExtraError
from lighting.photo import TARGET
from lighting.records import CodedWarning, Estimate, WarningCode

NO_OPENCV = "The photos were not matched with each other, because the service has no OpenCV."
INFERRED = "How they are turned is inferred from their compasses, if all have one, or from their light alone."


@dataclass
class Matching:
    """Finds where a request's photos look, as `Estimator.together` asks for it; `failure` says why it did not."""

    seconds: float  # that it may take
    failure: str = ""

    @property
    def target(self) -> int:
        """Pixels along the longer side in which it wants its photos."""
        return turns.MAX_SIDE if turns.has_opencv() else TARGET

    def __call__(self, views: Sequence[turns.View]) -> Sequence[turns.Placed] | None:
        """Where they look; None where that was not found. It ends with the request if the client goes away."""
        if not turns.has_opencv():
            self.failure = NO_OPENCV
            return None
        try:
            return turns.place_apart(views, self.seconds, check_cancelled)
        except MissingExtraError:
            self.failure = NO_OPENCV
            return None
        except LightingError as error:
            self.failure = str(error)
            return None

    def explained(self, estimates: list[Estimate]) -> list[Estimate]:
        """The estimates, with a warning each where the photos were not matched."""
        if not self.failure:
            return estimates
        warning = CodedWarning(f"{self.failure} {INFERRED}", WarningCode.TURN_INFERRED)
        return [_warned(estimate, warning) for estimate in estimates]


def _warned(estimate: Estimate, warning: CodedWarning) -> Estimate:
    lighting = estimate.lighting
    return replace(estimate, lighting=replace(lighting, warnings=(*lighting.warnings, warning)))
