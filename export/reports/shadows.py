"""How near the sun is with what a person marked, beside the network alone: `shadows.csv`, `photo_marks.csv`.

The marks of `photo_marks.csv` were made before anyone looked at the true suns. They are on 100 photos in direct sun,
drawn at random, at most one of a scene, and on a photo of each further scene of `val`.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from export.data.panoramas import read_table
from export.evaluation.metrics import markdown_table
from lighting.errors import ParameterError
from lighting.estimator import Estimator
from lighting.fusion.marks import LitSide, OwnShadow, Shadow, ShadowMark, read_shadow
from lighting.fusion.user_input import UserInput
from lighting.geometry import Floats, angle_between, angles, direction, wrap_azimuth
from lighting.model import Model
from lighting.photo.reader import Photo, read_photo

PHOTO_MARKS = Path(__file__).parents[1] / "data" / "photo_marks.csv"
_PHOTO_TABLES = {"val": "photos.csv", "train": "photos_train.csv"}  # by split
_TRUE_SUN = ("sun_azimuth", "sun_elevation")
_HEADINGS = (
    *("marks", "n", "azimuth: median", "90 %", "whole: median", "90 %"),
    *("network: azimuth: median", "90 %", "whole: median", "90 %", "50 and 90 % regions hold", "over the network"),
)


@dataclass(frozen=True, eq=False)
class _Marked:
    """A photo that a person marked."""

    photo: Photo
    sun: Floats  # (3,)
    alone: Floats  # (3,) by the network


@dataclass(frozen=True)
class _MarkedAnswer:
    """What marks make of an answer."""

    groups: tuple[str, ...]
    errors: tuple[float, ...]  # deg, of the azimuth and in all; then both of the network alone
    in_regions: tuple[bool, bool]  # of 50 and 90 %


def report_shadows(model: Model, data: Path) -> str:
    """Print tables in Markdown of the sun's errors with marks: of crops by how sure the mark is, and of photos.

    Args:
        model: the network to ask.
        data: folder with `shadows.csv` and the tables of photos.

    Raises:
        DataError: a table is missing.
    """
    estimator = Estimator(model)
    single, (first, together, alone) = _answer_crops(estimator, data), _answer_photos(estimator, data)
    doubted: list[_MarkedAnswer | None] = [
        replace(answer, groups=("crops and photos, doubtful",))
        for answer in (*single, *alone)
        if answer is not None and not {"all crops, doubtful", "shadow, doubted"}.isdisjoint(answer.groups)
    ]
    tables = {"One shadow each:": single, first: together, "Each mark alone:": alone, "All doubtful shadows:": doubted}
    return "\n\n".join(f"{title}\n\n{_table(answers)}" for title, answers in tables.items())


def _answer_crops(estimator: Estimator, data: Path) -> list[_MarkedAnswer | None]:
    """One shadow at a time: as it is, and as a line of which nobody knows the foot."""
    answers = []
    for row in read_table(data / "shadows.csv", ("file", "foot_x", "sure", *_TRUE_SUN)):
        if not row["sun_azimuth"]:
            continue
        marked, shadow = _ask(estimator, data, row), _shadow_text(row)
        kind, sure = "crops" if row["panorama"] else "photos", "sure" if row["sure"] == "yes" else "doubtful"
        pooled = ("all crops", f"all crops, {sure}") if row["panorama"] else ()
        answers.append(_answer(estimator, marked, [shadow], (f"{kind}, {sure}, {row['split']}", *pooled)))
        line = "line:" + ",".join(shadow.removeprefix("doubt:").split(",")[:4])
        answers.append(_answer(estimator, marked, [line], [f"{name}, as lines" for name in pooled[:1]]))
    return answers


def _shadow_text(row: dict[str, str]) -> str:
    """A row of `shadows.csv` as the command line writes it, "doubt:" before it where who marked it was not sure."""
    size = float(row["width"]), float(row["height"])
    ends = [
        min(max(float(row[f"{name}_{axis}"]), 0.0), side)
        for name in ("foot", "tip", "top")
        if row[f"{name}_x"]
        for axis, side in zip("xy", size, strict=True)
    ]
    return f"{'doubt:' * (row['sure'] != 'yes')}{','.join(map(str, ends))}"


def _answer_photos(
    estimator: Estimator, data: Path
) -> tuple[str, list[_MarkedAnswer | None], list[_MarkedAnswer | None]]:
    """How many photos take a gesture; all marks of a photo at once by its sample; each mark alone by its gesture."""
    rows = {
        row["file"]: (split, row)
        for split, table in _PHOTO_TABLES.items()
        for row in read_table(data / table, ("file", *_TRUE_SUN))
    }
    photos: dict[tuple[str, str], list[str]] = {}  # their marks, by file and sample
    for row in read_table(PHOTO_MARKS, ("file", "sample", "mark")):
        photos.setdefault((row["file"], row["sample"]), []).extend([row["mark"]] if row["mark"] else [])
    together: list[_MarkedAnswer | None] = []
    alone: list[_MarkedAnswer | None] = []
    for (file, sample), texts in photos.items():
        if not texts:
            continue
        split, row = rows[file]
        marked = _ask(estimator, data, row)
        single = [_answer(estimator, marked, [text], [_gesture(read_shadow(text))]) for text in texts]
        alone += single
        good = [text for text, found in zip(texts, single, strict=True) if found is not None]
        groups = [f"{sample}", f"{sample}, {split}"] if sample == "random" else []
        groups += ["every scene of val"] if split == "val" else []
        together.append(_answer(estimator, marked, good, groups) if good else None)
    count = sum(sample == "random" for _, sample in photos)
    taken = sum(answer is not None and "random" in answer.groups for answer in together)
    return f"Of {count} photos at random {taken} take a gesture. All marks of a photo:", together, alone


def _gesture(mark: ShadowMark) -> str:
    """What a person drew."""
    match mark:
        case Shadow():
            return "shadow, doubted" if mark.is_doubted else f"shadow{', with its top' * (mark.top is not None)}"
        case OwnShadow():
            return "own shadow, the head's" if mark.is_head else "own shadow"
        case LitSide():
            return f"lit side{', with its border' * (mark.border is not None)}"
    return "line"


def _ask(estimator: Estimator, data: Path, row: dict[str, str]) -> _Marked:
    """A row's photo, its true sun, and that of the network alone."""
    photo = read_photo(data / row["file"])
    alone = estimator(photo, UserInput(metadata=False)).lighting.sun_direction
    return _Marked(photo, direction(*(float(row[name]) for name in _TRUE_SUN)), alone)


def _answer(estimator: Estimator, marked: _Marked, marks: Sequence[str], groups: Iterable[str]) -> _MarkedAnswer | None:
    """The answer with marks; None if they are refused."""
    try:
        light = estimator(marked.photo, UserInput(metadata=False, shadows=marks)).lighting
    except ParameterError:
        return None
    errors: list[float] = []
    for answer in (light.sun_direction, marked.alone):
        azimuth = abs(float(wrap_azimuth(angles(answer)[0] - angles(marked.sun)[0])))
        errors += azimuth, float(angle_between(answer, marked.sun))
    in_regions = errors[1] <= light.radius_50, errors[1] <= light.radius_90
    return _MarkedAnswer(tuple(groups), tuple(errors), in_regions)


def _table(answers: Iterable[_MarkedAnswer | None]) -> str:
    """A row for each group."""
    groups: dict[str, list[_MarkedAnswer]] = {}
    for answer in filter(None, answers):
        for group in answer.groups:
            groups.setdefault(group, []).append(answer)
    return markdown_table(_HEADINGS, [_row(name, members) for name, members in sorted(groups.items())])


def _row(name: str, answers: Sequence[_MarkedAnswer]) -> list[str]:
    errors = np.array([a.errors for a in answers])
    figures = np.percentile(errors, [50, 90], axis=0).T.ravel()
    inside = " / ".join(f"{100 * share:.0f} %" for share in np.mean([a.in_regions for a in answers], axis=0))
    ratio = np.median(errors[:, 1]) / np.median(errors[:, 3])
    return [name, str(len(answers)), *(f"{figure:.1f}°" for figure in figures), inside, f"{ratio:.2f}"]
