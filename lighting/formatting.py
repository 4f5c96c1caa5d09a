"""Angles of a light in words, the same wherever they are printed or drawn."""


def format_azimuth(azimuth: float, digits: int = 0) -> str:
    """Where an azimuth [deg] lies for the camera: "straight ahead", "41° left" or "120° right (behind)"."""
    size = round(abs(azimuth), digits)
    if size == 0:
        return "straight ahead"
    if size == 180:
        return "straight behind"
    return f"{format_side(azimuth, digits)}{' (behind)' if size > 90 else ''}"


def format_side(azimuth: float, digits: int = 0) -> str:
    """An azimuth [deg] as an angle to one side of anything: "41° left"."""
    return f"{abs(azimuth):.{digits}f}° {'left' if azimuth < 0 else 'right'}"


def format_tilt(elevation: float, digits: int = 0) -> str:
    """A camera's elevation [deg]: "3° down"; a level one looks "0° up"."""
    tilt = round(elevation, digits)
    return f"{abs(tilt):.{digits}f}° {'up' if tilt >= 0 else 'down'}"
