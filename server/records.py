"""Lighting records that clients send."""

from fastapi.exceptions import RequestValidationError
from pydantic import ValidationError

from lighting.parameters import Lighting
from server import problems
from server.problems import ProblemError
from server.schemas import LightingRecord


def lighting_of(data: bytes) -> Lighting:
    """The light in a JSON record; raises ProblemError for what is not JSON, RequestValidationError for wrong fields."""
    try:
        return LightingRecord.model_validate_json(data).lighting()
    except ValidationError as error:
        found = error.errors(include_url=False)
        if found[0]["type"] == "json_invalid":
            raise ProblemError(problems.UNREADABLE_BODY, f"The body is not JSON: {found[0]['msg']}.") from error
        raise RequestValidationError([{**item, "loc": ("body", *item["loc"])} for item in found]) from error
