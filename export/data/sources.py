"""What a folder of training data holds, so that anyone can see what was learnt from: `sources.csv` beside this file.

A list of facts and addresses. No picture is in it.
"""

import hashlib
import re
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, fields, replace
from pathlib import Path

from export.data.panoramas import INDEX, DataError, Panorama, is_permissive, read_index, read_table, write_table

_PHOTO_TABLES = {"photos_train.csv": "train", "photos.csv": "val", "unsuitable.csv": "train"}  # with their splits
_PICTURE = re.compile(r"\.(jpe?g|png|webp|tiff?|heic|hdr|exr)$", re.IGNORECASE)
_COMMITS = Path(__file__).with_name("source_commits.csv")  # found after the pictures were
_CUBE_FACE = re.compile(r"(?:^|[/_])(?:[bdflru]|[pn][xyz]|(?:pos|neg)[xyz])\.\w+$", re.IGNORECASE)
_STITCHED = re.compile(r"\bstitched\b|\bcube (?:tiles|faces|to equirect)")


@dataclass(frozen=True, kw_only=True)
class _SourceRow:
    """One picture; empty where nothing is known. Angles in deg, as in export/README.md."""

    table: str  # file of the folder that lists the picture
    file: str
    split: str
    networks: str = ""  # versions of those that learnt from it, by spaces
    place: str = ""  # of a panorama
    stitched: str = ""  # "yes" for a panorama made of tiles or cube faces; "no" for one published as it is
    sun: str  # of a panorama as in its index; of a photo "known" or "unknown"
    sun_azimuth: str
    sun_elevation: str
    sun_uncertainty: str
    direct: str
    label: str  # who or what says so
    licence: str  # as it was found
    permissive: str  # "yes" if `train --licensed-only` uses it
    address: str
    commit: str = ""  # of the address, which holds some of its pictures that are listed
    path: str  # at that address; of a stitched panorama the tiles' folder, first name or one face
    version: str  # first digits of the published file's hash
    sha256: str  # of our file


def list_sources(data: Path, out: Path, taught: Sequence[tuple[str, Path]] = ()) -> str:
    """Write one row per panorama and photo of a folder; returns a sentence that counts them.

    Args:
        data: the folder, with `panoramas.csv`.
        out: the CSV file to write.
        taught: versions of networks, each with the folder whose tables list what it learnt from.

    Raises:
        DataError: for a table or picture that is missing or cannot be read.
    """
    panoramas = [_panorama_row(panorama, data.resolve()) for panorama in read_index(data)]
    photos = [row for name in _PHOTO_TABLES for row in _photo_rows(data, name)]
    commits = {row["address"]: row["commit"] for row in read_table(_COMMITS, ("address", "commit"))}
    learnt = [(version, _read_taught_files(folder)) for version, folder in taught]
    rows = [
        replace(
            row,
            commit=commits.get(row.address, ""),
            networks=" ".join(version for version, files in learnt if row.split == "train" and row.file in files),
        )
        for row in (*panoramas, *photos)
    ]
    write_table(out, [field.name for field in fields(_SourceRow)], map(astuple, rows))
    return (
        f"{out}: {len(panoramas)} panoramas and {len(photos)} photos, "
        f"{sum(row.split == 'train' for row in rows)} of them to learn from; "
        f"{sum(row.permissive == 'yes' for row in rows)} state a permissive licence."
    )


def _read_taught_files(folder: Path) -> set[str]:
    """The pictures to learn from that a folder's tables list."""
    photos = [name for name, split in _PHOTO_TABLES.items() if split == "train" and (folder / name).is_file()]
    listed = {row["file"] for name in photos for row in read_table(folder / name, ("file",))}
    return listed | {row["file"] for row in read_table(folder / INDEX, ("file", "split")) if row["split"] == "train"}


def _panorama_row(panorama: Panorama, root: Path) -> _SourceRow:
    published = _published_fields(panorama.source, panorama.licence, panorama.path)
    return _SourceRow(
        table=INDEX,
        file=panorama.path.relative_to(root).as_posix(),
        split=panorama.split,
        place=panorama.place,
        stitched="yes" if _is_stitched(published["path"], panorama.notes) else "no",
        sun=panorama.sun,
        sun_azimuth=_format_angle(panorama.sun_azimuth),
        sun_elevation=_format_angle(panorama.sun_elevation),
        sun_uncertainty=_format_angle(panorama.sun_uncertainty),
        direct=panorama.direct,
        label=panorama.label,
        **published,
    )


def _photo_rows(data: Path, name: str) -> Iterator[_SourceRow]:
    """The rows of one table of photos; none if the folder lacks it."""
    if not (data / name).is_file():
        return
    for row in read_table(data / name, ("file",)):
        yield _SourceRow(
            table=name,
            file=row["file"],
            split=_PHOTO_TABLES[name],
            sun="known" if row.get("sun_elevation") else "unknown",
            sun_azimuth=row.get("sun_azimuth", ""),
            sun_elevation=row.get("sun_elevation", ""),
            sun_uncertainty=row.get("expected_azimuth_error", ""),
            direct=row.get("direct", ""),
            label=row.get("label_source") or row.get("kind", ""),
            **_published_fields(row.get("source", ""), row.get("licence", ""), data / row["file"]),
        )


def _format_angle(angle: float | None) -> str:
    return "" if angle is None else f"{angle:g}"


def _published_fields(source: str, licence: str, file: Path) -> dict[str, str]:
    """The fields from `licence` on, without `commit`, of a picture whose source is OWNER/REPOSITORY:PATH@VERSION.

    A source may be pypi-PACKAGE:PATH as well; the address may be unknown.
    """
    where, _, path = source.partition(":")
    path, _, version = path.partition("@")
    address = f"https://github.com/{where}" if where.count("/") == 1 else ""
    if where.startswith("pypi-"):
        address = f"https://pypi.org/project/{where.removeprefix('pypi-')}/"
    return {
        "licence": licence or "unknown",
        "permissive": "yes" if is_permissive(licence) else "no",
        **{"address": address, "path": path, "version": version, "sha256": _hash_file(file)},
    }


def _is_stitched(path: str, notes: str) -> bool:
    """Whether tiles or cube faces were published: the notes say it, or the path names no whole picture."""
    named = bool(path) and (not _PICTURE.search(path) or bool(_CUBE_FACE.search(path)))
    return named or bool(_STITCHED.search(notes))


def _hash_file(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise DataError(f"{path} cannot be read: {error.strerror or error}.") from error
