"""A photo's result as one line of JSON, the same from `estimate --json` and in a batch."""

import json
from typing import Any


def json_line(name: str, **content: Any) -> str:
    """One line about the photo `name`: its `lighting` record, or the `error` in place of one."""
    return json.dumps({"file": name, **content}, allow_nan=False)


def reason(error: Exception) -> str:
    """An error as a sentence, without the name of the file."""
    return f"{error.strerror or error}." if isinstance(error, OSError) else str(error)
