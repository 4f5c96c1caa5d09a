"""Folders of sky probes in the layout of the SkyDB: `YYYYMMDD/HHMMSS/envmap.exr`, one probe a moment."""

import re
import reprlib
from dataclasses import dataclass
from datetime import UTC, datetime, tzinfo
from pathlib import Path

from lighting.errors import ErrorCode, ProbeError
from lighting.files import read_attributes

FILE = "envmap.exr"
TIME = "lighting.time"  # the header's attribute: ISO 8601 with the offset from UTC

_DAY, _MOMENT = re.compile(r"\d{8}"), re.compile(r"\d{6}")


@dataclass(frozen=True)
class ProbeFile:
    """A probe on disk: a lat-long map in the world's axes, centre column true north."""

    time: datetime  # aware
    path: Path


def probe_path(folder: str | Path, time: datetime) -> Path:
    """Where a probe of an aware time belongs: folders are named by UTC."""
    return Path(folder) / time.astimezone(UTC).strftime("%Y%m%d/%H%M%S") / FILE


def probes_in(folder: str | Path, zone: tzinfo = UTC) -> list[ProbeFile]:
    """All probes below a folder, by time.

    The time is that in a file's header; without one, that of the folders' names, which are in `zone`. Raises ProbeError
    where there is no such folder or no probe in it.
    """
    root = Path(folder)
    if not root.is_dir():
        raise ProbeError(f"There is no folder {root}.", "folder", ErrorCode.MISSING)
    probes = [_probe(path, zone) for path in root.glob(f"*/*/{FILE}") if _is_dated(path)]
    if not probes:
        raise ProbeError(f"{root} holds no probe: none of its folders is YYYYMMDD/HHMMSS with {FILE} inside.")
    return sorted(probes, key=lambda probe: probe.time)


def _is_dated(path: Path) -> bool:
    return bool(_DAY.fullmatch(path.parts[-3]) and _MOMENT.fullmatch(path.parts[-2]))


def _probe(path: Path, zone: tzinfo) -> ProbeFile:
    filed = read_attributes(path).get(TIME)
    if isinstance(filed, str):
        return ProbeFile(_filed(filed, path, zone), path)
    try:
        named = datetime.strptime("".join(path.parts[-3:-1]), "%Y%m%d%H%M%S")
    except ValueError as error:
        raise ProbeError(f"{path.parent} is not named by a time.") from error
    return ProbeFile(named.replace(tzinfo=zone), path)


def _filed(text: str, path: Path, zone: tzinfo) -> datetime:
    """The time in a file's header."""
    try:
        time = datetime.fromisoformat(text)
    except ValueError as error:
        raise ProbeError(
            f"{path}: {TIME} is {reprlib.repr(text)}, which is no time.", code=ErrorCode.MALFORMED
        ) from error
    return time if time.tzinfo else time.replace(tzinfo=zone)
