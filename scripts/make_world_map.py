"""Make the small map on which the page takes a location without asking anybody.

    npm pack world-atlas@2.0.2 && tar xzf world-atlas-2.0.2.tgz
    python -m scripts.make_world_map package/land-110m.json

Writes `server/web/src/world.svg`: all land in a plate carrée, a unit a tenth of a degree. The outlines are those of
Natural Earth (https://www.naturalearthdata.com), which are in the public domain.
"""

import json
import sys
from collections.abc import Iterator, Sequence
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any

TARGET = Path(__file__).parents[1] / "server" / "web" / "src" / "world.svg"
UNITS = 10  # a degree
_AROUND, _POLE = 360 * UNITS, 90 * UNITS
_GRAY = "#8a929c"  # seen on light and on dark pages

Point = tuple[int, int]  # units to the right of Greenwich, and down from the equator


def decode_arcs(topology: dict[str, Any]) -> list[list[Point]]:
    """Return the arcs of a TopoJSON, whose points are differences of scaled integers.

    Args:
        topology: as JSON holds it.
    """
    (scale_x, scale_y), (left, bottom) = topology["transform"]["scale"], topology["transform"]["translate"]

    def place(column: int, row: int) -> Point:
        return round(UNITS * (left + scale_x * column)), round(-UNITS * (bottom + scale_y * row))

    return [
        [place(*point) for point in accumulate(map(tuple, arc), lambda a, b: (a[0] + b[0], a[1] + b[1]))]
        for arc in topology["arcs"]
    ]


def rings(topology: dict[str, Any]) -> Iterator[list[Point]]:
    """Yield the outlines of all polygons.

    Args:
        topology: of land alone.
    """
    arcs = decode_arcs(topology)
    for geometry in topology["objects"]["land"]["geometries"]:
        for polygon in geometry["arcs"]:
            for ring in polygon:
                yield [point for arc in ring for point in (arcs[arc] if arc >= 0 else arcs[~arc][::-1])]


def unwrap(ring: Sequence[Point]) -> list[Point]:
    """Return an outline whose points go on beyond the edge of the map; one around the pole is closed below it.

    Args:
        ring: its points, the first one again at the end.
    """
    points, turns = [ring[0]], 0
    for (before, _), (x, y) in pairwise(ring):
        turns += (before - x > _AROUND // 2) - (x - before > _AROUND // 2)
        points.append((x + turns * _AROUND, y))
    first, last = points[0][0], points[-1][0]
    return points if first == last else [*points, (last, _POLE), (first, _POLE), points[0]]


def copies(ring: Sequence[Point]) -> Iterator[list[Point]]:
    """Yield an outline as often as the map shows a part of it: one across its edge is at both.

    Args:
        ring: unwrapped.
    """
    columns = [x for x, _ in ring]
    for shift in (-_AROUND, 0, _AROUND):
        if min(columns) + shift < _AROUND // 2 and max(columns) + shift > -_AROUND // 2:
            yield [(x + shift, y) for x, y in ring]


def path_of(ring: Sequence[Point]) -> str:
    """Return an outline as a path of SVG, in steps from point to point.

    Args:
        ring: its points, the first one again at the end.
    """
    points = [point for point, before in zip(ring, [None, *ring], strict=False) if point != before]
    steps = (f"{x - a} {y - b}" for (a, b), (x, y) in pairwise(points[:-1]))
    return f"M{points[0][0]} {points[0][1]}l{' '.join(steps)}z".replace(" -", "-")


def main() -> None:
    topology = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    outlines = (copy for ring in rings(topology) if len(set(ring)) > 2 for copy in copies(unwrap(ring)))
    land = "".join(map(path_of, outlines))
    view = f"{-_AROUND // 2} {-_POLE} {_AROUND} {2 * _POLE}"
    picture = f'<title>Land</title><path fill="{_GRAY}" d="{land}"/>'
    svg = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{view}">{picture}</svg>\n'
    TARGET.write_text(svg, encoding="utf-8")


if __name__ == "__main__":
    main()
