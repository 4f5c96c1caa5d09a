"""Angles and offsets from UTC as words for people."""


def format_azimuth(azimuth: float, digits: int = 0) -> str:
    """Say where an azimuth lies for the camera: "straight ahead", "41° left" or "120° right (behind)".

    Args:
        azimuth: deg, positive to the right, in (-180, 180].
        digits: behind the point.
    """
    size = round(abs(azimuth), digits)
    if size == 0:
        return "straight ahead"
    if size == 180:
        return "straight behind"
    return f"{format_side(azimuth, digits)}{' (behind)' if size > 90 else ''}"


def format_side(azimuth: float, digits: int = 0) -> str:
    """Say an azimuth as an angle to one side of anything: "41° left".

    Args:
        azimuth: deg, positive to the right, in (-180, 180].
        digits: behind the point.
    """
    return f"{abs(azimuth):.{digits}f}° {'left' if azimuth < 0 else 'right'}"


def format_sun_elevation(elevation: float, digits: int = 0) -> str:
    """Say how high the sun stands: "33° high" or "3° below the horizon".

    Args:
        elevation: deg above the horizon, -90 to 90.
        digits: behind the point.
    """
    height = round(elevation, digits)
    return f"{height + 0.0:.{digits}f}° high" if height >= 0 else f"{-height:.{digits}f}° below the horizon"


def format_tilt(elevation: float, digits: int = 0) -> str:
    """Say a camera's elevation: "3° down"; a level one looks "0° up".

    Args:
        elevation: deg, positive looks up, -90 to 90.
        digits: behind the point.
    """
    tilt = round(elevation, digits)
    return f"{abs(tilt):.{digits}f}° {'up' if tilt >= 0 else 'down'}"


def format_utc_offset(hours: float) -> str:
    """Say an offset from UTC: "+05:45".

    Args:
        hours: local minus universal time.
    """
    minutes = round(abs(hours) * 60)
    return f"{'-' if hours < 0 else '+'}{minutes // 60:02d}:{minutes % 60:02d}"
