"""How well photos' ground is found, and the spot where an object may stand, on labeled pictures (`ground.csv`)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from PIL import Image

from export.training.segmentation import LabelledPicture, cross_validate_segmentation, read_labelled_pictures
from lighting.fusion.estimate import estimate_light, refine_prediction
from lighting.fusion.user_input import NO_USER_INPUT
from lighting.geometry import Floats
from lighting.model import Model
from lighting.photo.reader import photo_from_array
from lighting.prediction import Prediction, Segments, SurfaceClass

_MIN_CELLS = 4  # of ground, in a picture that is expected to have a spot


@dataclass(frozen=True, eq=False)
class GroundAnswer:
    """What is found in a picture."""

    segments: Segments
    spot: tuple[float, float] | None  # (x, y) in shares of the picture's width and height


def report_ground(model: Model, data: Path, split: str = "val") -> str:
    """How right spots, refusals and cells are on the rows of a split, in words.

    Args:
        model: the network that estimates the camera.
        data: folder with `ground.csv`.
        split: "train" or "val".

    Raises:
        DataError: a table is missing, or a grid cannot be read.
    """
    pictures = read_labelled_pictures(data, split)
    return describe_answers(pictures, [_answer(picture, _predict(model, picture)) for picture in pictures])


def report_ground_by_folds(model: Model, data: Path, folds: int) -> str:
    """The same on all pictures with grids; what each shows is said by a head that knows no other of its group.

    Args:
        model: the network that estimates the camera.
        data: folder with `ground.csv`, and its pictures.
        folds: 2 or more.

    Raises:
        DataError: a table is missing, a grid cannot be read, or there are more folds than photographers and places.
    """
    pictures, answers = [], []
    for picture, canvas in cross_validate_segmentation(data, folds):
        pictures.append(picture)
        answers.append(_answer(picture, replace(_predict(model, picture), segments=canvas)))
    return describe_answers(pictures, answers)


def _predict(model: Model, picture: LabelledPicture) -> Prediction:
    return model.predict_one(photo_from_array(picture.pixels))


def _answer(picture: LabelledPicture, prediction: Prediction) -> GroundAnswer:
    height, width = picture.pixels.shape[:2]
    photo = photo_from_array(picture.pixels)
    light = estimate_light(photo, refine_prediction(prediction, photo, NO_USER_INPUT))
    assert light.segments is not None
    pixel = light.lighting.spot_pixel
    return GroundAnswer(light.segments, pixel and (pixel[0] / width, pixel[1] / height))


def describe_answers(pictures: Sequence[LabelledPicture], answers: Sequence[GroundAnswer]) -> str:
    """How right answers about pictures are, in words.

    Args:
        pictures: with their grids.
        answers: one a picture.
    """
    on_ground, with_ground, refused, without = 0, 0, 0, 0
    common, union, right, cells = 0, 0, 0, 0
    for picture, answer in zip(pictures, answers, strict=True):
        ground = picture.grid == SurfaceClass.GROUND
        if not ground.any():
            refused, without = refused + (answer.spot is None), without + 1
        elif ground.sum() >= _MIN_CELLS and not picture.weak:
            on_ground, with_ground = on_ground + _is_on(ground, answer.spot), with_ground + 1
        shares = _resample(answer.segments, len(ground), ground.shape[1])
        found = shares[..., SurfaceClass.GROUND] > 0.5
        common, union = common + int((found & ground).sum()), union + int((found | ground).sum())
        right, cells = right + int((shares.argmax(axis=-1) == picture.grid).sum()), cells + ground.size
    share, iou = 100 * on_ground / with_ground, common / union
    return "\n".join(
        (
            f"Of {with_ground} pictures with ground, the spot of {on_ground} lies on it ({share:.0f} %).",
            f"Of {without} without, {refused} have no spot.",
            f"Ground against the rest has an IoU of {iou:.3f}; of {cells} cells {100 * right / cells:.1f} % are right.",
        )
    )


def _is_on(ground: np.ndarray[tuple[int, ...], np.dtype[np.bool_]], spot: tuple[float, float] | None) -> bool:
    """Whether a spot, in shares, lies in a cell of ground (R, C)."""
    if spot is None:
        return False
    row, column = (min(int(share * count), count - 1) for share, count in zip(spot[::-1], ground.shape, strict=True))
    return bool(ground[row, column])


def _resample(segments: Segments, rows: int, columns: int) -> Floats:
    """Probabilities (R, C, classes) on another grid."""
    size = (columns, rows)
    planes = (Image.fromarray(plane).resize(size, Image.Resampling.BOX) for plane in np.moveaxis(segments, 2, 0))
    return np.stack([np.asarray(plane) for plane in planes], axis=-1)
