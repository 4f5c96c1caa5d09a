"""Lighting records that clients send."""

import json

from fastapi.exceptions import RequestValidationError
from pydantic import ValidationError
from pydantic_core import from_json

from lighting.errors import ParameterError
from lighting.files import named_once, one_record
from lighting.ranges import record_path
from lighting.records import Lighting
from server import problems
from server.problems import ProblemError
from server.schemas import LightingRecord


def parse_record(data: bytes) -> Lighting:
    """The light in a JSON record, bare or in the line that `lighting estimate --json` printed.

    It is UTF-8, with or without a byte order mark, or UTF-16, as PowerShell redirects that line.
    Raises ProblemError for what is not JSON, a key given twice, an error, an answer about several photos and fields
    that do not fit each other, RequestValidationError for wrong fields.
    """
    try:
        text = data.decode(json.detect_encoding(data))
        from_json(text)  # refuses what is nested too deep, and half a surrogate pair
    except ValueError as error:
        raise ProblemError(problems.UNREADABLE_BODY, f"The body is not JSON: {error}.") from error
    try:
        content = one_record(json.loads(text, object_pairs_hook=named_once))
        return LightingRecord.model_validate(content).lighting()
    except ValidationError as error:
        found = error.errors(include_url=False)
        raise RequestValidationError([{**item, "loc": ("body", *item["loc"])} for item in found]) from error
    except ParameterError as error:
        named = error.renamed(record_path)
        raise problems.invalid(named.field or "body", str(named), "body", named.code) from error
