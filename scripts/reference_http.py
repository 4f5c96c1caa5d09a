"""The page of the service's routes, from its OpenAPI document."""

from collections.abc import Iterator, Mapping
from typing import Any

from lighting.fields import Json
from scripts.markdown import WRITTEN, escape_marks, write_table
from server.app import create_app
from server.request_body import FORM_TYPE, JSON_TYPE, PHOTO_FIELD
from server.settings import Settings

_SERVICE = "http://127.0.0.1:8000"
_SUFFIXES = {"image/x-exr": ".exr", "image/png": ".png", "image/jpeg": ".jpg", "application/zip": ".zip"}
_JOB = "4d1c0a6f5e2b7398"  # an id as a job has one
_PREDEFINED = {  # what examples ask for
    "date": "2026-12-21", "latitude": "48.2", "longitude": "16.4", "heading": "120",
    "for": "usd", "kind": "video", "x": "0.5", "y": "0.8",
}  # fmt: skip
_OF_PHOTO = {"/v1/day": ("latitude", "longitude", "heading")}  # what a route needs that most photos do not hold
_BASIC = ("400", "403", "421", "422", "431")  # problems that every route below /v1 may answer


def write_http() -> str:
    """Return the page of routes: parameters, bodies, answers, problems, and an example of each."""
    document = create_app(Settings()).openapi()
    routes = [
        (f"{m.upper()} {path}", route) for path, methods in document["paths"].items() for m, route in methods.items()
    ]
    index = [f"- [`{name}`](#{_anchor(name)}): {route['summary']}" for name, route in routes]
    head = f"""# HTTP

The routes of `lighting serve`. `/openapi.json` says the same to programs, and `/docs` lets you try them.
{WRITTEN}

A parameter stands in the URL or in the form, each once. Angles are degrees. Errors are [problems](problems.md).
Where the service has API keys, send one: `Authorization: Bearer KEY`.
"""
    everywhere = ", ".join(_problem(status) for status in _BASIC)
    return "\n".join(
        [
            *(head, *index, "", f"Every route below `/v1` may answer {everywhere}.", ""),
            *(line for name, route in routes for line in _section(name, route, document)),
        ]
    )


def _anchor(name: str) -> str:
    return "".join(letter for letter in name.lower().replace(" ", "-") if letter.isalnum() or letter in "-_")


def _problem(status: str) -> str:
    return f"`{status}`"


def _section(name: str, route: Json, document: Json) -> Iterator[str]:
    yield from (f"## {name}", "", f"{route['summary']}.", "")
    for paragraph in route["description"].split("\n\n"):
        yield from (escape_marks(" ".join(paragraph.split())), "")
    yield from ("```sh", _example(name, route), "```", "")
    parameters = route.get("parameters", [])
    if parameters:
        rows = (_parameter_row(parameter) for parameter in parameters)
        yield from write_table(("parameter", "default", "range", "meaning"), rows)
    if "requestBody" in route:
        yield from (f"Body: {_list_body(route['requestBody']['content'])}.", "")
    answers = {status: answer for status, answer in route["responses"].items() if status < "400"}
    yield from write_table(("answer", "type", "meaning"), (_answer_row(*pair, document) for pair in answers.items()))
    problems = [status for status in sorted(route["responses"]) if status >= "400" and status not in _BASIC]
    if problems:
        yield from (f"Problems: {', '.join(map(_problem, problems))}.", "")


def _parameter_row(parameter: Json) -> tuple[str, str, str, str]:
    schema = parameter["schema"]
    meaning = parameter.get("description") or schema.get("description", "")
    default = schema.get("default")
    shown = "required" if parameter["required"] else "" if default is None else f"`{str(default).lower()}`"
    place = " (in the path)" if parameter["in"] == "path" else ""
    return f"`{parameter['name']}`", shown, _range(schema), escape_marks(meaning) + place


def _range(schema: Json) -> str:
    if "enum" in schema:
        return ", ".join(f"`{value}`" for value in schema["enum"])
    if schema["type"] == "array":
        return f"{_range(schema['items'])}, several" if "minimum" in schema["items"] else "several"
    low, high = schema.get("minimum"), schema.get("maximum")
    if low is not None and high is not None:
        return f"{low:g} to {high:g}"
    return {"boolean": "true, false"}.get(schema["type"], "text")


def _list_body(content: Mapping[str, Any]) -> str:
    """The types of a body in words: those of photos are one."""
    pictures = [kind.removeprefix("image/").upper() for kind in content if kind.startswith("image/")]
    others = {FORM_TYPE: "a form", JSON_TYPE: "a lighting record as JSON"}
    parts = [others.get(kind, f"`{kind}`") for kind in content if not kind.startswith("image/")]
    if FORM_TYPE in content:
        fields = content[FORM_TYPE]["schema"]["properties"]
        parts[0] = f"a form with {' and '.join(f'`{name}`' for name in fields)}"
    return ", or ".join([*parts, *([f"the photo itself ({', '.join(pictures)})"] if pictures else [])])


def _answer_row(status: str, answer: Json, document: Json) -> tuple[str, str, str]:
    content = answer.get("content", {})
    meaning = answer["description"].replace("Successful Response", "")
    names = [entry["schema"].get("$ref", "").rpartition("/")[2] for entry in content.values()]
    fields = [_list_fields(document["components"]["schemas"][name]) for name in names if name]
    headers = [f"Header `{name}`: {header['description']}." for name, header in answer.get("headers", {}).items()]
    return status, ", ".join(f"`{kind}`" for kind in content), ". ".join(filter(None, [meaning, *fields, *headers]))


def _list_fields(schema: Json) -> str:
    return f"Fields: {', '.join(f'`{name}`' for name in schema.get('properties', {}))}"


def _example(name: str, route: Json) -> str:
    """A curl command for a route."""
    method, path = name.split()
    content = route.get("requestBody", {}).get("content", {})
    needed = [p["name"] for p in route.get("parameters", []) if p["required"] and p["in"] == "query"]
    words = ["curl"]
    if method == "DELETE":
        words.append("-X DELETE")
    if FORM_TYPE in content:
        fields = content[FORM_TYPE]["schema"]
        field = next(iter(fields["properties"]))
        file = "photo.jpg" if field == PHOTO_FIELD else "clip.mp4"
        several = fields["properties"][field].get("type") == "array"
        words += [f"-F {field}=@{file}", *([f"-F {field}=@other.jpg"] if several else [])]
        words += [f"-F {name}={_PREDEFINED[name]}" for name in (*needed, *_OF_PHOTO.get(path, ()))]
    query = "&".join(_query(route)) if not content else ""
    address = f"{_SERVICE}{path.replace('{id}', _JOB)}"
    words.append(f"'{address}?{query}'" if query else address)
    kinds = list(route["responses"].get("200", {}).get("content", {}))
    if kinds and kinds[0] in _SUFFIXES:
        words.append(f"-o answer{_SUFFIXES[kinds[0]]}")
    return " ".join(words)


def _query(route: Json) -> Iterator[str]:
    """What a route without a body needs, and what makes its example tell something."""
    for parameter in route.get("parameters", []):
        if parameter["in"] == "query" and (
            parameter["required"] or parameter["name"] in ("sun_azimuth", "sun_elevation")
        ):
            value = _PREDEFINED.get(parameter["name"]) or parameter["schema"].get("examples", ["30"])[0]
            yield f"{parameter['name']}={value}"
