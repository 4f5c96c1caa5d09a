"""The JSON of a lighting, the same in every file, line and HTTP answer."""

import json
from typing import Any

from lighting.records import Lighting
from lighting.sky import sky_coefficients


def full_record(lighting: Lighting) -> dict[str, Any]:
    """The JSON record with `sky.coefficients`, for programs that draw the sky themselves."""
    record = lighting.to_dict()
    coefficients = sky_coefficients(lighting.sun_elevation, lighting.turbidity, lighting.ground_albedo)
    return record | {"sky": record["sky"] | {"coefficients": coefficients}}


def json_line(name: str, answer: Lighting | str) -> str:
    """One line of JSON about the photo `name`: its `lighting` record, or the `error` in place of one."""
    content = {"error": answer} if isinstance(answer, str) else {"lighting": full_record(answer)}
    return json.dumps({"file": name, **content}, allow_nan=False)
