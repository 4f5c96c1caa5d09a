"""How well the light of the example photos is found: `python -m scripts.examples`.

Of each photo in `examples/examples.csv`, whose panorama shows the true sun: the answer's error, and the radii that the
answer states. README's first example is sure, with a `radius_90` of at most 30°, and right.
"""

import csv
from typing import NamedTuple

from lighting import Estimate, estimate
from lighting.geometry import angle_between, direction
from scripts.gallery import EXAMPLES


class ExampleAnswer(NamedTuple):
    """The answer about a photo."""

    estimate: Estimate
    error: float
    """Degrees between its sun and the true one."""


def read_suns() -> list[dict[str, str]]:
    """Return the rows of examples.csv."""
    with (EXAMPLES / "examples.csv").open(newline="", encoding="utf-8") as lines:
        return list(csv.DictReader(lines))


def measure_example(row: dict[str, str]) -> ExampleAnswer:
    """Return the answer about a photo.

    Args:
        row: of examples.csv.
    """
    found = estimate(EXAMPLES / row["file"])
    true = direction(float(row["sun_azimuth"]), float(row["sun_elevation"]))
    return ExampleAnswer(found, float(angle_between(true, found.lighting.sun_direction)))


def main() -> None:
    """Print a line a photo."""
    print(f"{'photo':20}{'error':>8}{'50 % within':>13}{'90 % within':>13}")
    for row in read_suns():
        found, error = measure_example(row)
        print(f"{row['file']:20}{error:7.1f}°{found.lighting.radius_50:12.1f}°{found.lighting.radius_90:12.1f}°")


if __name__ == "__main__":
    main()
