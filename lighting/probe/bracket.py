"""The exposures of a bracket, the files of a folder grouped into brackets by time, and folders of probes.

Folders are in the layout of the SkyDB: `YYYYMMDD/HHMMSS/envmap.exr`, one a moment.
"""

import re
import reprlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta, tzinfo
from itertools import pairwise
from pathlib import Path

import numpy as np

from lighting.errors import EnvironmentMapError, ErrorCode, PhotoError, ProbeError
from lighting.files import MAP_FORMATS
from lighting.files.exr import read_exr_attributes
from lighting.fusion.instants import PhotoInstants, resolve_instants, resolve_together
from lighting.fusion.metadata_prior import merge_user_input, share_location
from lighting.fusion.time_zones import offset_in_file
from lighting.fusion.user_input import NO_USER_INPUT, UserInput
from lighting.photo.linear import (
    RAW_SUFFIXES,
    Curve,
    LinearPhoto,
    linear_from_array,
    read_linear,
    read_metadata_and_exposure,
)
from lighting.photo.metadata import PhotoMetadata

_FLOAT_SUFFIXES = tuple(f".{name}" for name, entry in MAP_FORMATS.items() if entry.read)
_PICTURE_SUFFIXES = (".png", ".tif", ".tiff", ".jpg", ".jpeg", *_FLOAT_SUFFIXES)


@dataclass(frozen=True, eq=False)
class Bracket:
    """Two exposures or more of one view, the shortest first."""

    photos: tuple[LinearPhoto, ...]
    """From the same place, of different exposures."""
    names: tuple[str, ...]
    """Of the files, for messages."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Each warning about the files once."""
        return tuple(dict.fromkeys(warning for photo in self.photos for warning in photo.warnings))


def read_bracket(paths: Sequence[str | Path], curve: Curve | None = None) -> Bracket:
    """Read the exposures in files, in any order.

    Args:
        paths: two files or more, all of one size.
        curve: how values are coded; None believes the files.

    Raises:
        ProbeError: fewer than two files, one of them twice, or sizes that differ.
        PhotoError: a file cannot be read.
        OSError: a file is missing or forbidden.
    """
    if len(paths) < 2:
        raise ProbeError(f"A probe needs two exposures or more; there {'is only one' if paths else 'are none'}.")
    files = [Path(path).resolve() for path in paths]
    for i, path in enumerate(paths):
        if files[i] in files[:i]:
            raise ProbeError(f"{path} is given twice.", code=ErrorCode.DUPLICATE)
    photos = [_read_exposure(Path(path), curve) for path in paths]
    return make_bracket(photos, [Path(path).name for path in paths])


def make_bracket(photos: Sequence[LinearPhoto], names: Sequence[str] | None = None) -> Bracket:
    """Put exposures in order: by EXIF where all have it, else by how bright they are.

    Args:
        photos: one or more of one size, linear.
        names: what messages call them; None numbers them.

    Raises:
        ProbeError: there is no exposure, or sizes differ.
    """
    if not photos:
        raise ProbeError("A bracket needs at least one exposure.")
    sizes = {photo.pixels.shape[:2] for photo in photos}
    if len(sizes) > 1:
        listed = ", ".join(f"{width} x {height}" for height, width in sorted(sizes))
        raise ProbeError(f"The exposures differ in size: {listed} pixels.")
    lengths = [photo.exposure for photo in photos if photo.exposure is not None]
    if len(lengths) < len(photos):  # by the mean of the values, each counted up to full scale
        lengths = [float(np.minimum(photo.pixels[::4, ::4], 1.0).mean()) for photo in photos]
    order = sorted(range(len(photos)), key=lengths.__getitem__)
    all_names = names or [f"exposure {number}" for number in range(1, len(photos) + 1)]
    return Bracket(tuple(photos[i] for i in order), tuple(all_names[i] for i in order))


def _read_exposure(path: Path, curve: Curve | None) -> LinearPhoto:
    if path.suffix.lower() not in _FLOAT_SUFFIXES:
        return read_linear(path, curve)
    if curve == "srgb":
        raise PhotoError(f"{path.name} holds floats, which are linear; --curve srgb is for integers.")
    read = MAP_FORMATS[path.suffix.lower().removeprefix(".")].read
    assert read is not None
    try:
        return linear_from_array(read(path.read_bytes()))
    except (PhotoError, EnvironmentMapError) as error:
        raise PhotoError(f"{path}: {error}") from error


_MAX_EXPOSURE_GAP = timedelta(seconds=20)  # between the starts of two exposures from which on another bracket begins

_STAMP = re.compile(r"(20\d{2})(\d{2})(\d{2})\D?(\d{2})(\d{2})(\d{2})")


@dataclass(frozen=True)
class BracketFiles:
    """The files of one bracket and what they say of when and where."""

    files: tuple[Path, ...]
    """Of its photos."""
    metadata: PhotoMetadata
    """Clock and place of the first files that have them."""

    def instants(self, user_input: UserInput = NO_USER_INPUT) -> PhotoInstants:
        """Return when the bracket was taken.

        Args:
            user_input: what the user states of it.

        Raises:
            ProbeError: the time or its zone is not known.
        """
        found = resolve_instants(merge_user_input(self.metadata, user_input), user_input)
        if found.likeliest is not None:
            return found
        if self.metadata.local_time is None and user_input.time is None:
            sentence = f"{self.files[0]} does not say when it was taken; tell the time."
            raise ProbeError(sentence, "time", ErrorCode.MISSING)
        sentence = f"{self.files[0]} has a local time of no known zone; tell its offset from UTC."
        raise ProbeError(sentence, "utc_offset", ErrorCode.MISSING)


def read_bracket_files(files: Sequence[Path]) -> BracketFiles:
    """Read the first time and location that a bracket's files or their folder's name say.

    Args:
        files: one or more, all in one folder.
    """
    metadata = share_location([read_metadata_and_exposure(file)[0] for file in files])
    timed = next((m for m in metadata if m.local_time is not None or m.gps_time is not None), None)
    if timed is None:
        return BracketFiles(tuple(files), replace(metadata[0], local_time=_time_in_names(files[0].parent)))
    known = next((offset[0] for m in metadata if (offset := offset_in_file(m)) is not None), None)
    return BracketFiles(tuple(files), timed if timed.utc_offset is not None else replace(timed, utc_offset=known))


def group_brackets(inputs: Sequence[Path]) -> list[BracketFiles]:
    """Group a series into brackets: a folder is one, files are divided where their EXIF times leave a gap.

    Args:
        inputs: folders and files, in any order.

    Raises:
        ProbeError: a folder has no pictures, or a file no time.
    """
    folders, files = ([path for path in inputs if path.is_dir() is is_folder] for is_folder in (True, False))
    brackets = [read_bracket_files(list_pictures(folder)) for folder in folders]
    return brackets + [read_bracket_files(group) for group in _split_by_time(files)]


def list_pictures(folder: Path) -> list[Path]:
    """List the pictures directly in a folder, by name.

    Args:
        folder: one that exists.

    Raises:
        ProbeError: it holds no pictures.
    """
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() in (*_PICTURE_SUFFIXES, *RAW_SUFFIXES))
    if not files:
        raise ProbeError(f"{folder} holds no pictures.")
    return files


def _split_by_time(files: Sequence[Path]) -> list[list[Path]]:
    times = _comparable_times(files, [read_metadata_and_exposure(file)[0] for file in files])
    timed = sorted(zip(times, files, strict=True))
    groups = [[timed[0][1]]] if timed else []
    for (before, _), (time, file) in pairwise(timed):
        if time - before > _MAX_EXPOSURE_GAP:
            groups.append([])
        groups[-1].append(file)
    return groups


def _comparable_times(files: Sequence[Path], metadata: Sequence[PhotoMetadata]) -> list[datetime]:
    """Times by one clock: the camera's, whether or not a file has its offset from UTC, or else GPS."""
    for clock in ("local_time", "gps_time"):
        times = [getattr(m, clock) for m in metadata]
        if all(time is not None for time in times):
            return times
    instants = [one.likeliest for one in resolve_together(share_location(metadata), NO_USER_INPUT)]
    for file, instant in zip(files, instants, strict=True):
        if instant is None:
            raise ProbeError(f"{file} has no time in EXIF; give each bracket of a series as a folder of its own.")
    return [instant.utc_time for instant in instants if instant is not None]


def _time_in_names(folder: Path) -> datetime | None:
    """The naive time in the names of a folder and its parent, such as 20240601/143000 or 2024060114_3000."""
    stamp = _STAMP.search("".join(folder.absolute().parts[-2:]))
    try:
        return datetime(*(int(part) for part in stamp.groups())) if stamp else None  # type: ignore[arg-type]
    except ValueError:
        return None


_PROBE_FILE = "envmap.exr"
TIME_ATTRIBUTE = "lighting.time"  # the header's attribute: ISO 8601 with the offset from UTC

_DAY, _MOMENT = re.compile(r"\d{8}"), re.compile(r"\d{6}")


@dataclass(frozen=True)
class _ProbeFile:
    """A probe on disk: a lat-long map in the world's axes, center column true north."""

    time: datetime  # aware
    path: Path


def probe_path(folder: str | Path, time: datetime) -> Path:
    """Return the path of a probe in the layout of the SkyDB, whose folders are named by UTC.

    Args:
        folder: the root of the layout.
        time: aware.
    """
    return Path(folder) / time.astimezone(UTC).strftime("%Y%m%d/%H%M%S") / _PROBE_FILE


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
    files = root.glob(f"*/*/{_PROBE_FILE}")
    dated = [path for path in files if _DAY.fullmatch(path.parts[-3]) and _MOMENT.fullmatch(path.parts[-2])]
    if not dated:
        raise ProbeError(f"{root} holds no probe: none of its folders is YYYYMMDD/HHMMSS with {_PROBE_FILE} inside.")
    return sorted((_read_probe_file(path, zone) for path in dated), key=lambda probe: probe.time)


def _read_probe_file(path: Path, zone: tzinfo) -> _ProbeFile:
    text = read_exr_attributes(path).get(TIME_ATTRIBUTE)
    is_told = isinstance(text, str)
    try:
        name = "".join(path.parts[-3:-1])
        time = datetime.fromisoformat(str(text)) if is_told else datetime.strptime(name, "%Y%m%d%H%M%S")
    except ValueError as error:
        if not is_told:
            raise ProbeError(f"{path.parent} is not named by a time.") from error
        sentence = f"{path}: {TIME_ATTRIBUTE} is {reprlib.repr(text)}, which is no time."
        raise ProbeError(sentence, code=ErrorCode.MALFORMED) from error
    return _ProbeFile(time if time.tzinfo else time.replace(tzinfo=zone), path)
