"""Responses: lighting records with links, files with their headers, cache validation, accuracy figures."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC
from hashlib import sha256
from pathlib import Path
from urllib.parse import urlencode

import numpy as np
from fastapi import Request, Response
from fastapi.responses import JSONResponse

from lighting import __version__
from lighting.envmap.latlong import Image
from lighting.fields import COLOR_RANGES, round_all
from lighting.files import MAP_FORMATS
from lighting.geometry import angles
from lighting.model import METRICS
from lighting.photo.metadata import PhotoMetadata
from lighting.records import Json, Lighting, ModelSpec, SunDistribution, record_with_coefficients, warning_code
from lighting.sky import SKY_MODEL
from lighting.sun_grid import grid_directions
from server.dependencies import RESULT_TAG, PhotoAnswer, Service, tag_bytes
from server.query_params import LightingQuery, Query

WARNINGS_HEADER = "Lighting-Warnings"
ZIP_TYPE = "application/zip"


def estimate_to_json(answer: PhotoAnswer, query: LightingQuery, root: str) -> Json:
    """The JSON of an estimate.

    Args:
        answer: of a photo.
        query: whether to include the sun's probability.
        root: the path under which the service lives; empty at the host's root.
    """
    lighting = answer.estimate.lighting
    record = {**record_with_coefficients(lighting, answer.probe), "links": {"envmap": _envmap_link(lighting, root)}}
    if lighting.warnings:
        record["warning_codes"] = [warning_code(warning).value for warning in lighting.warnings]
    if query.probability:
        record["probability"] = _sun_probability(answer.estimate.distribution)
    if answer.crop is not None:
        record["crop"] = asdict(answer.crop)
    if answer.metadata is not None:
        record["photo_metadata"] = _photo_metadata(answer.metadata)
    if answer.gain is not None:
        record["surroundings"] = _surroundings(answer.gain)
    return record


def _photo_metadata(metadata: PhotoMetadata) -> Json:
    """What the file says, without what it does not say."""
    time, offset, gps_time = metadata.local_time, metadata.utc_offset, metadata.gps_time
    values = {
        "time": time.isoformat(timespec="seconds") if time else None,
        "utc_offset": offset,
        "gps_time": gps_time.astimezone(UTC).isoformat(timespec="seconds") if gps_time else None,
        "latitude": metadata.latitude,
        "longitude": metadata.longitude,
        "heading": metadata.heading,
        "heading_reference": metadata.heading_reference.value if metadata.heading_reference else None,
        "focal_length": metadata.focal_length,
        "vertical_fov": metadata.vertical_fov,
        "camera_elevation": metadata.camera_elevation,
        "camera_roll": metadata.camera_roll,
        "camera_height": metadata.camera_height,
        "orientation": metadata.orientation,
    }
    return {name: value for name, value in values.items() if value is not None}


def _surroundings(gain: Image) -> Json:
    """The gain (R, 2R, 3) of the surroundings, cell by cell."""
    rows, columns = gain.shape[:2]
    cells = [[float(f"{value:.3g}") for value in cell] for cell in gain.reshape(-1, 3)]
    return {"rows": rows, "columns": columns, "factors": cells}


def _envmap_link(lighting: Lighting, root: str) -> str:
    """The path and query of the environment map of a lighting."""
    names = ("sun_azimuth", "sun_elevation", "turbidity", "exposure", "ground_albedo")
    values = {name: getattr(lighting, name) for name in names}
    colors = {name: color for name in COLOR_RANGES if (color := getattr(lighting, name))}
    values |= {name: ",".join(f"{value:g}" for value in color) for name, color in colors.items()}
    values |= {} if lighting.sky_cover is None else {"sky_cover": lighting.sky_cover}
    values |= {} if lighting.map_sky == SKY_MODEL else {"sky": lighting.map_sky}
    return f"{root}/v1/envmap?{urlencode({**values, 'sun': str(lighting.sun_painted).lower()}, safe=',')}"


def _sun_probability(sun: SunDistribution) -> Json:
    """The probability of each cell of the sun grid with the cell's angles [deg]."""
    azimuth, elevation = angles(grid_directions(sun.grid))
    return {
        "grid": sun.grid,
        "azimuth": np.round(azimuth, 3).tolist(),
        "elevation": np.round(elevation, 3).tolist(),
        "probability": round_all(sun.probability),
    }


def map_response(data: bytes, format: str, headers: dict[str, str] | None = None) -> Response:
    """An environment map as a file.

    Args:
        data: the file.
        format: a key of MAP_FORMATS.
        headers: further headers.
    """
    return Response(data, media_type=MAP_FORMATS[format].media_type, headers=headers)


def scene_response(data: bytes, warnings: Sequence[str], headers: dict[str, str] | None = None) -> Response:
    """A scene as a ZIP archive, with its warnings in a header.

    Args:
        data: the archive.
        warnings: sentences, as `lighting scene` prints them on stderr.
        headers: further headers.
    """
    warned = {WARNINGS_HEADER: json.dumps(warnings)} if warnings else {}  # JSON in ASCII, as a header must be
    return Response(data, media_type=ZIP_TYPE, headers={**(headers or {}), **warned})


def _cache_headers(query: Query, seconds: int, public: bool) -> dict[str, str]:
    """Headers that let caches keep a map; the tag is weak since the last bit may differ between machines."""
    digest = sha256(f"{__version__} {query.model_dump_json()}".encode()).hexdigest()[:32]
    scope = "public" if public else "private"
    return {"ETag": f'W/"{digest}"', "Cache-Control": f"{scope}, max-age={seconds}"}


def check_cache(request: Request, service: Service, query: Query) -> tuple[dict[str, str], Response | None]:
    """The headers for caches, and the 304 for a client whose copy is still good.

    Args:
        request: may have If-None-Match.
        service: says how long caches may keep the response, and whether it is public.
        query: determines the response.
    """
    headers = _cache_headers(query, service.settings.cache_seconds, public=not service.keys)
    return headers, Response(status_code=304, headers=headers) if is_fresh(request, headers["ETag"]) else None


def tagged_json_response(request: Request, content: Json) -> Response:
    """JSON with a tag of its bytes; 304 for a client whose copy is still good.

    Args:
        request: may have If-None-Match.
        content: what it holds.
    """
    response = JSONResponse(content)
    etag = tag_bytes(response.body)
    headers = {"ETag": etag, "Cache-Control": "no-cache"}
    if is_fresh(request, etag):
        return Response(status_code=304, headers=headers)
    response.headers.update(headers)
    return response


def tag_response(request: Request, response: Response) -> None:
    """Give a whole answer to a photo the tag of its bytes: a client sees by it whether the answer is another.

    Args:
        request: knows the tag of what a worker made.
        response: changed in place, if it succeeded and has no tag.
    """
    if response.status_code == 200 and isinstance(response.body, bytes) and "ETag" not in response.headers:
        data, tag = request.scope.get(RESULT_TAG) or (None, "")
        response.headers["ETag"] = tag if response.body is data else tag_bytes(response.body)


def is_fresh(request: Request, etag: str) -> bool:
    """Whether the client's copy has a tag.

    Args:
        request: may have If-None-Match.
        etag: of the answer.
    """
    if_none_match = request.headers.get("if-none-match", "")
    tags = {tag.strip().removeprefix("W/") for tag in if_none_match.split(",")}
    return if_none_match.strip() == "*" or etag.removeprefix("W/") in tags


def read_accuracy(spec: ModelSpec, folder: Path) -> Json:
    """The accuracy of a network by evaluation protocol; empty if it has no published figures.

    Args:
        spec: names the network.
        folder: the network's folder.
    """
    path = folder / METRICS
    metrics = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    is_of_network = (metrics.get("name"), metrics.get("version")) == (spec.name, spec.version)
    return dict(metrics["accuracy"]) if is_of_network else {}
