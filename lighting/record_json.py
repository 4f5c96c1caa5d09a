"""Lines of JSON that hold a photo's light: written, and taken out of what was read."""

import json
from collections import Counter
from collections.abc import Mapping
from typing import Any

from lighting.errors import ErrorCode, ParameterError
from lighting.fields import Json
from lighting.records import Lighting, LightProbe
from lighting.sky.clear_sky import sky_coefficients

MAX_RECORD_BYTES = 1_000_000  # the service's longest answer has 50,000, and 400,000 indented in UTF-16


def record_with_coefficients(lighting: Lighting, probe: LightProbe | None = None) -> Json:
    """Return the JSON record with `sky.coefficients`, for programs that draw the sky themselves, and `light_probe`.

    Args:
        lighting: any.
        probe: of the light and, where it is known, of the place; None: without `light_probe`.
    """
    record = lighting.to_dict()
    coefficients = sky_coefficients(max(lighting.sun_elevation, 0.0), lighting.turbidity, lighting.ground_albedo)
    extra = {} if probe is None else {"light_probe": probe.to_dict()}
    return record | {"sky": record["sky"] | {"coefficients": coefficients}} | extra


def json_line(
    name: str,
    answer: Lighting | str,
    probe: LightProbe | None = None,
    outputs: Mapping[str, str] = {},
    *,
    crop: Mapping[str, int] | None = None,
) -> str:
    """Return one line of JSON about a photo: its `lighting` record and `crop`, or the `error` in place of them.

    Args:
        name: of the photo's file.
        answer: the photo's light, or the sentence that says why it has none.
        probe: for `light_probe` of the record; None: without.
        outputs: names of files that were made of it, such as `output`.
        crop: the fields of the photo's `PhotoCrop`; None where the whole picture is the photo.
    """
    content: Json = {"error": answer}
    if not isinstance(answer, str):
        content = {"lighting": record_with_coefficients(answer, probe), **({"crop": dict(crop)} if crop else {})}
    return json.dumps({"file": name, **outputs, **content}, allow_nan=False)


def reject_duplicate_keys(pairs: list[tuple[str, object]]) -> Json:
    """Make an object of JSON, as `object_pairs_hook` of `json.loads`.

    Args:
        pairs: keys and values.

    Raises:
        ParameterError: a key is given twice.
    """
    content = dict(pairs)
    if len(content) < len(pairs):
        often = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise ParameterError(f"The key {often!r} is given twice.", often, ErrorCode.DUPLICATE)
    return content


def unwrap_record(content: Any) -> Any:
    """Take the record out of JSON that was read, bare or in a line that `json_line` made; other JSON stays as it is.

    Args:
        content: what `json.loads` returned.

    Raises:
        ParameterError: it holds an error, or the records of several photos.
    """
    if not isinstance(content, dict):
        return content
    if "error" in content:
        raise ParameterError("The JSON holds an error in place of a lighting record.", "error", ErrorCode.MISSING)
    if "lightings" in content:
        sentence = "The JSON holds the records of several photos, and one is read at a time."
        raise ParameterError(sentence, "lightings", ErrorCode.CONTRADICTION)
    return content.get("lighting", content)
