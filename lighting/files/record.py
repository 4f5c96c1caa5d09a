"""The JSON of a lighting, the same in every file, line and HTTP answer."""

import json
from collections import Counter
from typing import Any

from lighting.errors import ErrorCode, ParameterError
from lighting.records import Lighting
from lighting.sky.hosek_wilkie import sky_coefficients

MAX_RECORD_BYTES = 1_000_000  # the service's longest answer has 50,000, and 400,000 indented in UTF-16


def full_record(lighting: Lighting) -> dict[str, Any]:
    """The JSON record with `sky.coefficients`, for programs that draw the sky themselves."""
    record = lighting.to_dict()
    coefficients = sky_coefficients(lighting.sun_elevation, lighting.turbidity, lighting.ground_albedo)
    return record | {"sky": record["sky"] | {"coefficients": coefficients}}


def json_line(name: str, answer: Lighting | str) -> str:
    """One line of JSON about the photo `name`: its `lighting` record, or the `error` in place of one."""
    content = {"error": answer} if isinstance(answer, str) else {"lighting": full_record(answer)}
    return json.dumps({"file": name, **content}, allow_nan=False)


def named_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """The object of JSON with these keys and values, for `json.loads`; ParameterError where a key stands twice."""
    content = dict(pairs)
    if len(content) < len(pairs):
        often = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise ParameterError(f"The key {often!r} stands twice.", often, ErrorCode.DUPLICATE)
    return content


def one_record(content: Any) -> Any:
    """The record in JSON that was read, bare or in a line that `json_line` made; other JSON stays as it is.

    Raises ParameterError where it holds an error, or the records of several photos.
    """
    if not isinstance(content, dict):
        return content
    if "error" in content:
        raise ParameterError("The JSON holds an error in place of a lighting record.", "error", ErrorCode.MISSING)
    if "lightings" in content:
        sentence = "The JSON holds the records of several photos, and one is read at a time."
        raise ParameterError(sentence, "lightings", ErrorCode.CONTRADICTION)
    return content.get("lighting", content)
