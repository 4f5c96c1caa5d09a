"""Evidence about the sun: a photo's pixels, metadata, user, ephemeris and other photos; and its fusion."""

from typing import TYPE_CHECKING

from lighting.lazy import from_homes

if TYPE_CHECKING:
    from lighting.evidence.answer import estimate_of
    from lighting.evidence.contradiction import ELEVATION_TAIL, HEADING_TAIL, LENS_RATIO
    from lighting.evidence.distributions import elevation_density, ring_of, seen_from
    from lighting.evidence.ephemeris import sun_position
    from lighting.evidence.facts import location_of, zones
    from lighting.evidence.frames import check_heading, check_headings, read_headings
    from lighting.evidence.fusion import Evidence, Fused, compass_prior, fuse, on_rings, ring_density, stand
    from lighting.evidence.given import NOTHING_GIVEN, Given, check_given
    from lighting.evidence.gravity import MOST_APART, Gravity, tilt_spread
    from lighting.evidence.metadata import Known, camera_evidence, known, known_alone, known_later, known_together
    from lighting.evidence.overlap import power
    from lighting.evidence.said import as_shown, said_of, upright
    from lighting.evidence.seen import fuse_photo
    from lighting.evidence.together import fuse_together

__all__ = [
    "ELEVATION_TAIL",
    "HEADING_TAIL",
    "LENS_RATIO",
    "MOST_APART",
    "NOTHING_GIVEN",
    "Evidence",
    "Fused",
    "Given",
    "Gravity",
    "Known",
    "as_shown",
    "camera_evidence",
    "check_given",
    "check_heading",
    "check_headings",
    "compass_prior",
    "elevation_density",
    "estimate_of",
    "fuse",
    "fuse_photo",
    "fuse_together",
    "known",
    "known_alone",
    "known_later",
    "known_together",
    "location_of",
    "on_rings",
    "power",
    "read_headings",
    "ring_density",
    "ring_of",
    "said_of",
    "seen_from",
    "stand",
    "sun_position",
    "tilt_spread",
    "upright",
    "zones",
]

__getattr__ = from_homes(
    __name__,
    {
        "ELEVATION_TAIL": "contradiction",
        "HEADING_TAIL": "contradiction",
        "LENS_RATIO": "contradiction",
        "MOST_APART": "gravity",
        "NOTHING_GIVEN": "given",
        "Evidence": "fusion",
        "Fused": "fusion",
        "Given": "given",
        "Gravity": "gravity",
        "Known": "metadata",
        "as_shown": "said",
        "camera_evidence": "metadata",
        "check_given": "given",
        "check_heading": "frames",
        "check_headings": "frames",
        "compass_prior": "fusion",
        "elevation_density": "distributions",
        "estimate_of": "answer",
        "fuse": "fusion",
        "fuse_photo": "seen",
        "fuse_together": "together",
        "known": "metadata",
        "known_alone": "metadata",
        "known_later": "metadata",
        "known_together": "metadata",
        "location_of": "facts",
        "on_rings": "fusion",
        "power": "overlap",
        "read_headings": "frames",
        "ring_density": "fusion",
        "ring_of": "distributions",
        "said_of": "said",
        "seen_from": "distributions",
        "stand": "fusion",
        "sun_position": "ephemeris",
        "tilt_spread": "gravity",
        "upright": "said",
        "zones": "facts",
    },
)
