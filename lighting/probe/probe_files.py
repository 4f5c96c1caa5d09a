"""Folders of probes, in the layout of the SkyDB: `YYYYMMDD/HHMMSS/envmap.exr`, one a moment."""

import re
import reprlib
from dataclasses import dataclass
from datetime import UTC, datetime, tzinfo
from pathlib import Path

from lighting.errors import ErrorCode, ProbeError
from lighting.files.exr import read_exr_attributes

PROBE_FILE = "envmap.exr"
TIME_ATTRIBUTE = "lighting.time"  # the header's attribute: ISO 8601 with the offset from UTC

_DAY, _MOMENT = re.compile(r"\d{8}"), re.compile(r"\d{6}")


@dataclass(frozen=True)
class _ProbeFile:
    """A probe on disk: a lat-long map in the world's axes, centre column true north."""

    time: datetime  # aware
    path: Path


def probe_path(folder: str | Path, time: datetime) -> Path:
    """Return the path of a probe in the layout of the SkyDB, whose folders are named by UTC.

    Args:
        folder: the root of the layout.
        time: aware.
    """
    return Path(folder) / time.astimezone(UTC).strftime("%Y%m%d/%H%M%S") / PROBE_FILE


def probes_in(folder: str | Path, zone: tzinfo = UTC) -> list[_ProbeFile]:
    """List all probes below a folder, by time.

    Args:
        folder: the root of the layout `YYYYMMDD/HHMMSS/envmap.exr`.
        zone: of the folders' names, which count where a file's header has no time.

    Raises:
        ProbeError: there is no such folder, or no probe in it.
    """
    root = Path(folder)
    if not root.is_dir():
        raise ProbeError(f"There is no folder {root}.", "folder", ErrorCode.MISSING)
    files = root.glob(f"*/*/{PROBE_FILE}")
    dated = [path for path in files if _DAY.fullmatch(path.parts[-3]) and _MOMENT.fullmatch(path.parts[-2])]
    if not dated:
        raise ProbeError(f"{root} holds no probe: none of its folders is YYYYMMDD/HHMMSS with {PROBE_FILE} inside.")
    return sorted((_read_probe_file(path, zone) for path in dated), key=lambda probe: probe.time)


def _read_probe_file(path: Path, zone: tzinfo) -> _ProbeFile:
    text = read_exr_attributes(path).get(TIME_ATTRIBUTE)
    if isinstance(text, str):
        return _ProbeFile(_parse_time_attribute(text, path, zone), path)
    try:
        folder_time = datetime.strptime("".join(path.parts[-3:-1]), "%Y%m%d%H%M%S")
    except ValueError as error:
        raise ProbeError(f"{path.parent} is not named by a time.") from error
    return _ProbeFile(folder_time.replace(tzinfo=zone), path)


def _parse_time_attribute(text: str, path: Path, zone: tzinfo) -> datetime:
    """The time in a file's header."""
    try:
        time = datetime.fromisoformat(text)
    except ValueError as error:
        sentence = f"{path}: {TIME_ATTRIBUTE} is {reprlib.repr(text)}, which is no time."
        raise ProbeError(sentence, code=ErrorCode.MALFORMED) from error
    return time if time.tzinfo else time.replace(tzinfo=zone)
