"""Answers, cache headers, links."""

import json
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import numpy as np
from fastapi import Request, Response

from lighting.envmap.latlong import Image
from lighting.files import MAP_FORMATS
from lighting.geometry import angles
from lighting.model import figures_path
from lighting.records import (
    Lighting,
    ModelSpec,
    SunDistribution,
    record_with_coefficients,
    round_significant,
    warning_code,
)
from lighting.sky import SKY_MODEL
from lighting.sun_grid import grid_directions
from lighting.validation import COLOR_RANGES
from lighting.version import __version__
from server.dependencies import PhotoAnswer, Service
from server.query_params import LightingQuery, Query

# What answers hold beside a lighting record: links, the sun's probability, files with their headers.

WARNINGS = "Lighting-Warnings"
ZIP = "application/zip"


def estimates_json(found: Sequence[PhotoAnswer], query: LightingQuery, root: str) -> dict[str, Any]:
    """The JSON of one estimate, or of several in a list; with the sun's probability where the query asks for it."""
    records = [_answer_record(answer, root, query.probability) for answer in found]
    return records[0] if len(records) == 1 else {"lightings": records}


def _answer_record(answer: PhotoAnswer, root: str, probability: bool) -> dict[str, Any]:
    """The JSON of an answer, with a link to its environment map."""
    lighting = answer.estimate.lighting
    record = {**record_with_coefficients(lighting), "links": {"envmap": _envmap_link(lighting, root)}}
    if lighting.warnings:
        record["warning_codes"] = [warning_code(warning).value for warning in lighting.warnings]
    if probability:
        record["probability"] = _sun_probability(answer.estimate.distribution)
    if answer.factors is not None:
        record["surroundings"] = _surroundings(answer.factors)
    return record


def _surroundings(factors: Image) -> dict[str, Any]:
    """Factors (R, 2R, 3) on the cells of a map, cell by cell."""
    rows, columns = factors.shape[:2]
    cells = [[float(f"{value:.3g}") for value in cell] for cell in factors.reshape(-1, 3)]
    return {"rows": rows, "columns": columns, "factors": cells}


def _envmap_link(lighting: Lighting, root: str) -> str:
    """Where the environment map of a light is on this host; the service lives under the path `root`."""
    names = ("sun_azimuth", "sun_elevation", "turbidity", "exposure", "ground_albedo")
    values = {name: getattr(lighting, name) for name in names}
    values |= {name: ",".join(f"{v:g}" for v in c) for name in COLOR_RANGES if (c := getattr(lighting, name))}
    values |= {} if lighting.sky_cover is None else {"sky_cover": lighting.sky_cover}
    values |= {} if lighting.sky_model == SKY_MODEL else {"sky": lighting.sky_model}
    return f"{root}/v1/envmap?{urlencode({**values, 'sun': str(lighting.sun_painted).lower()}, safe=',')}"


def _sun_probability(sun: SunDistribution) -> dict[str, Any]:
    """The probability of each cell of the sun grid with the cell's angles [deg]."""
    azimuth, elevation = angles(grid_directions(sun.grid))
    return {
        "grid": sun.grid,
        "azimuth": np.round(azimuth, 3).tolist(),
        "elevation": np.round(elevation, 3).tolist(),
        "probability": [round_significant(float(value)) for value in sun.probability],
    }


def map_response(data: bytes, format: str, headers: dict[str, str] | None = None) -> Response:
    """An environment map as a file."""
    return Response(data, media_type=MAP_FORMATS[format].media_type, headers=headers)


def scene_response(data: bytes, warnings: Sequence[str], headers: dict[str, str] | None = None) -> Response:
    """A scene as an archive, and in a header what `lighting scene` says of it on stderr."""
    told = {WARNINGS: json.dumps(warnings)} if warnings else {}  # JSON has no letters that a header cannot carry
    return Response(data, media_type=ZIP, headers={**(headers or {}), **told})


def _cache_headers(query: Query, seconds: int, public: bool) -> dict[str, str]:
    """Headers that let caches keep a map; the tag is weak since the last bit may differ between machines."""
    digest = sha256(f"{__version__} {query.model_dump_json()}".encode()).hexdigest()[:32]
    scope = "public" if public else "private"
    return {"ETag": f'W/"{digest}"', "Cache-Control": f"{scope}, max-age={seconds}"}


def caching(request: Request, service: Service, query: Query) -> tuple[dict[str, str], Response | None]:
    """The headers that let caches keep an answer, and the 304 for a client whose copy is still good."""
    headers = _cache_headers(query, service.settings.cache_seconds, public=not service.keys)
    return headers, Response(status_code=304, headers=headers) if _is_fresh(request, headers["ETag"]) else None


def _is_fresh(request: Request, etag: str) -> bool:
    """Whether the client's copy has this tag."""
    known = request.headers.get("if-none-match", "")
    tags = {tag.strip().removeprefix("W/") for tag in known.split(",")}
    return known.strip() == "*" or etag.removeprefix("W/") in tags


# The accuracy that was measured for a network, as the service returns it.


def accuracy(spec: ModelSpec, folder: Path) -> dict[str, Any]:
    """Figures by protocol and name, from the JSON file in a network's folder; empty if there is none."""
    path = figures_path(spec, folder)
    return dict(json.loads(path.read_text(encoding="utf-8"))["accuracy"]) if path.is_file() else {}
