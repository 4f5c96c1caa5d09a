"""Whether a scene was as bright as daylight makes it, by the exposure that the camera noted.

At ISO 100 sunlight takes EV 15, open shade and a heavy sky 12, a landscape just after sunset 9; streets and shop
windows in bright lamplight take 8, rooms 5 to 7 (ANSI PH2.7, Photographic Exposure Guide). Exposures tell indoors from
outdoors better than pixels do (Boutell and Luo, CVPR 2004).
"""

_DARK = 8.0  # EV at ISO 100 that is as often lamplight as daylight: about 30 cd/m2
_STEEPNESS = 2.5  # of the probability in doublings of the odds for each EV: scenes and meters vary by a stop


def daylight_probability(exposure_value: float) -> float:
    """Probability that daylight lit a scene which took an exposure value [EV at ISO 100]."""
    return float(1.0 / (1.0 + 2.0 ** (_STEEPNESS * (_DARK - exposure_value))))


def too_dark(exposure_value: float, subject: str) -> tuple[str, ...]:
    """A sentence for people where daylight is the less likely light of a `subject`."""
    if daylight_probability(exposure_value) >= 0.5:
        return ()
    return (
        f"The {subject} was exposed for a dark scene (EV {exposure_value:.1f} at ISO 100): night, indoors, or a dark "
        "filter on the lens.",
    )
