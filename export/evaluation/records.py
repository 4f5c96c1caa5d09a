"""What is true of a set of crops, and what a method says about them, as arrays; angles in deg."""

from dataclasses import dataclass, fields
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats

Bools = NDArray[np.bool_]
Names = NDArray[np.str_]
Record = TypeVar("Record", "Truth", "Answers")


@dataclass(frozen=True)
class Truth:
    """The truth about N crops; NaN where it is unknown."""

    panorama: Names  # (N,) name
    place: Names  # (N,) where it was taken; panoramas of one place are not independent
    scored: Bools  # (N,) the sun's direction is known well enough to score
    sun: Floats  # (N, 3)
    camera: Floats  # (N, 3) elevation, roll, vertical field of view
    aspect: Floats  # (N,) width over height
    visibility: Floats  # (N,) 1 direct sun, 0.5 partly, 0 none
    turbidity: Floats  # (N,)
    exposure: Floats  # (N,)
    in_view: Names  # (N,) "sun in view", "sky in view" or "no sky"


@dataclass(frozen=True)
class Answers:
    """The answers of one method for N crops; NaN where it has none."""

    sun: Floats  # (N, 3)
    radius_50: Floats  # (N,)
    radius_90: Floats  # (N,)
    nll: Floats  # (N,) negative log density [nat, of 1/sr] at the true sun
    camera: Floats  # (N, 3) as in Truth
    visibility: Floats  # (N,) probability of direct sun
    turbidity: Floats  # (N,)
    exposure: Floats  # (N,)


def select(record: Record, chosen: Bools) -> Record:
    """The same record, of the chosen crops alone."""
    return type(record)(**{f.name: getattr(record, f.name)[chosen] for f in fields(record)})


def answers(sun: Floats, **given: Floats) -> Answers:
    """Answers of a method that gives the sun (N, 3) and the fields in `given`, and nothing else."""
    unknown = np.full(len(sun), np.nan)
    values = {f.name: unknown for f in fields(Answers)} | {"camera": np.full((len(sun), 3), np.nan), "sun": sun}
    return Answers(**(values | given))
