"""A probe as an OpenEXR map with what is known of it in the header."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from lighting.errors import ErrorCode, ProbeError
from lighting.files import write_exr
from lighting.probe.develop import Probe
from lighting.probe.folders import TIME, probe_path


def target_of(output: str | Path, time: datetime) -> Path:
    """Where a probe of an aware time goes: the file that ends in .exr, or below a folder in the SkyDB's layout."""
    path = Path(output)
    return path if path.suffix.lower() == ".exr" and not path.is_dir() else probe_path(path, time)


def write_probe(probe: Probe, output: str | Path) -> Path:
    """Write to a file that ends in .exr, or below a folder in the SkyDB's layout; the path that was written.

    Raises EnvironmentMapError or ProbeError where it cannot be written.
    """
    path = target_of(output, probe.moment.time)
    if path != Path(output):
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ProbeError(
                f"{path.parent} cannot be made: {error.strerror or error}.", code=ErrorCode.UNWRITABLE
            ) from error
    write_exr(path, probe.image, attributes=attributes(probe))
    return path


def attributes(probe: Probe) -> dict[str, Any]:
    """The header's entries: time, the ephemeris's sun, and what the sun's light rests on."""
    utc = probe.moment.time.astimezone(UTC)
    azimuth, elevation = probe.moment.sun
    known: dict[str, Any] = {
        TIME: utc.isoformat(timespec="seconds"),
        "capDate": utc.strftime("%Y:%m:%d %H:%M:%S"),
        "utcOffset": 0.0,
        "lighting.sun_azimuth": azimuth,
        "lighting.sun_elevation": elevation,
        "lighting.sun_found": int(probe.spot is not None),
        "lighting.sun_clipped": int(probe.spot is not None and probe.spot.clipped),
        "lighting.sun_estimated": int(probe.estimated),
        "comments": " ".join(probe.warnings),
    }
    if probe.spot is not None:
        known["lighting.sun_irradiance"] = np.asarray(probe.spot.irradiance, dtype=np.float32)
    if probe.fit is not None:
        known |= {"lighting.turbidity": probe.fit.turbidity, "lighting.exposure": probe.fit.exposure}
    return known
