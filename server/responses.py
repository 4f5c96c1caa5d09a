"""Responses: lighting records with links, JSON with a tag, and whether a client's copy is still good."""

import posixpath
from dataclasses import asdict
from datetime import UTC
from hashlib import sha256
from urllib.parse import urlencode

import numpy as np
from fastapi import Request, Response
from starlette.staticfiles import NotModifiedResponse

from lighting.envmap.latlong import Image
from lighting.envmap.surroundings import surroundings_gain
from lighting.errors import warning_code
from lighting.fields import COLOR_RANGES, Json, round_all
from lighting.geometry import angles
from lighting.photo.metadata import PhotoMetadata
from lighting.photo_estimate import Estimate
from lighting.prediction import SunDistribution
from lighting.record_json import record_with_coefficients
from lighting.records import Lighting
from lighting.sky import SKY_MODEL
from lighting.sun_grid import grid_directions
from lighting.tracing import trace_step
from server.problems import route_path
from server.query_params import LightingQuery
from server.schemas import LightingEstimate

WARNINGS_HEADER = "Lighting-Warnings"
ZIP_TYPE = "application/zip"


def link_from(request: Request, target: str) -> str:
    """A link to another route, relative to a request's URL: it leads there under any path of a proxy.

    Args:
        request: whose answer holds the link.
        target: path of the route, perhaps with a query.
    """
    return posixpath.relpath(target, posixpath.dirname(route_path(request.scope)))


def estimate_to_json(request: Request, estimate: Estimate, query: LightingQuery) -> Json:
    """The JSON of an estimate.

    Args:
        request: which asks for it.
        estimate: of a photo.
        query: what else to include.
    """
    lighting, photo = estimate.lighting, estimate.photo
    links = {"envmap": link_from(request, _envmap_path(lighting))}
    record = {**record_with_coefficients(lighting, estimate.probe()), "links": links}
    if lighting.warnings:
        record["warning_codes"] = [warning_code(warning).value for warning in lighting.warnings]
    if query.probability:
        record["probability"] = _sun_probability(estimate.distribution)
    if photo.crop is not None:
        record["crop"] = asdict(photo.crop)
    if query.photo_metadata:
        record["photo_metadata"] = _photo_metadata(photo.metadata)
    if query.surroundings and (context := estimate.context()):
        with trace_step("map"):
            record["surroundings"] = _surroundings(surroundings_gain(lighting, context))
    return record


def _photo_metadata(metadata: PhotoMetadata) -> Json:
    """What the file says, without what it does not say."""
    time, gps_time = metadata.local_time, metadata.gps_time
    names = [name for name in LightingEstimate.PhotoMetadataRecord.model_fields if name != "time"]
    values = {
        "time": time.isoformat(timespec="seconds") if time else None,
        **{name: getattr(metadata, name) for name in names},
        "gps_time": gps_time.astimezone(UTC).isoformat(timespec="seconds") if gps_time else None,
    }
    return {name: value for name, value in values.items() if value is not None}


def _surroundings(gain: Image) -> Json:
    """The gain (R, 2R, 3) of the surroundings, cell by cell."""
    rows, columns = gain.shape[:2]
    cells = [[float(f"{value:.3g}") for value in cell] for cell in gain.reshape(-1, 3)]
    return {"rows": rows, "columns": columns, "factors": cells}


def _envmap_path(lighting: Lighting) -> str:
    """The path and query of the environment map of a lighting."""
    names = ("sun_azimuth", "sun_elevation", "turbidity", "exposure", "ground_albedo")
    values = {name: getattr(lighting, name) for name in names}
    colors = {name: color for name in COLOR_RANGES if (color := getattr(lighting, name))}
    values |= {name: ",".join(f"{value:g}" for value in color) for name, color in colors.items()}
    values |= {} if lighting.sky_cover is None else {"sky_cover": lighting.sky_cover}
    values |= {} if lighting.map_sky == SKY_MODEL else {"sky": lighting.map_sky}
    return f"/v1/envmap?{urlencode({**values, 'sun': str(lighting.sun_painted).lower()}, safe=',')}"


def _sun_probability(sun: SunDistribution) -> Json:
    """The probability of each cell of the sun grid with the cell's angles [deg]."""
    azimuth, elevation = angles(grid_directions(sun.grid))
    return {
        "grid": sun.grid,
        "azimuth": np.round(azimuth, 3).tolist(),
        "elevation": np.round(elevation, 3).tolist(),
        "probability": round_all(sun.probability),
    }


def tag_response(request: Request, response: Response) -> Response:
    """A response with a tag of its bytes, by which caches ask again; 304 for a client whose copy is still good.

    Args:
        request: may have If-None-Match.
        response: with its body.
    """
    response.headers.setdefault("Cache-Control", "no-cache")
    etag = response.headers["ETag"] = tag_bytes(response.body)
    return NotModifiedResponse(response.headers) if is_fresh(request, etag) else response


def tag_bytes(data: bytes | memoryview) -> str:
    """The tag of an answer of these bytes.

    Args:
        data: the body, as it is sent.
    """
    return f'"{sha256(data).hexdigest()[:32]}"'


def is_fresh(request: Request, etag: str) -> bool:
    """Whether the client's copy has a tag.

    Args:
        request: may have If-None-Match.
        etag: of the answer.
    """
    if_none_match = request.headers.get("if-none-match", "")
    tags = {tag.strip().removeprefix("W/") for tag in if_none_match.split(",")}
    return if_none_match.strip() == "*" or etag.removeprefix("W/") in tags
