"""The OpenAPI document at /openapi.json, which /docs shows: its words, its schemas, its examples."""

from threading import Lock

from fastapi import APIRouter, FastAPI, Request, Response

from lighting.records import Json
from server import problems
from server.request_body import FORM_TYPE, PHOTO_FIELD
from server.responses import tagged_json_response
from server.schemas import LightingRecord, Problem
from server.settings import Settings

DESCRIPTION = """Send a photo taken outdoors by daylight; get its light as JSON, as an environment map or as a scene.

```sh
curl -F photo=@photo.jpg http://127.0.0.1:8000/v1/lighting
curl -F photo=@photo.jpg -F height=256 -F format=hdr http://127.0.0.1:8000/v1/envmap -o sky.hdr
```

- **A photo** is the file `photo` of a form, or the whole body: JPEG, PNG, WebP, TIFF, AVIF or HEIC. URLs of photos and
  photos inside JSON are refused.
- **Parameters** go into the URL or the form, each once.
- **Angles** are degrees. Azimuth 0 is where the camera points, positive to the right. Colours are linear Rec.709.
- **`ETag`** is in every answer: the same one, the same answer. `GET` with it in `If-None-Match` answers 304.
  `POST` ignores that header, as RFC 9110 (13.2.1) says of methods that neither read nor change what lies at an address.
- **Errors** are `application/problem+json`. Programs read `type`, and each error's `field` and `code`.
- **Photos are not kept.** They stay in memory while they are worked on.
"""
TAGS = [
    {"name": "lighting", "description": "From photos to their light, and from light to environment maps and scenes."},
    {"name": "jobs", "description": "Long work: clips, many photos, normals. Off unless the operator names a folder."},
    {"name": "operations", "description": "For operators."},
]

_ETAG = {"description": "Of the answer's bytes, or of what they follow from", "schema": {"type": "string"}}

router = APIRouter(include_in_schema=False)


@router.get("/openapi.json")
async def _describe_api(request: Request) -> Response:
    return tagged_json_response(request, request.app.openapi())


def complete_document(app: FastAPI, settings: Settings) -> None:
    """Have the app's document hold the schemas of bodies and errors, every problem, and how many photos a form takes.

    Args:
        app: the app with its routes.
        settings: the operator's.
    """
    generate, lock = app.openapi, Lock()
    documents: list[Json] = []

    def openapi() -> Json:
        with lock:  # two threads that generate at a time disturb each other
            if not documents:
                document = generate()
                _add_schemas(document["components"]["schemas"])
                document["components"]["examples"] = {
                    kind.name: {
                        "summary": kind.title,
                        "description": kind.meaning,
                        "value": problems.problem_example(kind),
                    }
                    for kind in problems.KINDS
                }
                _add_tags(document["paths"])
                form = document["paths"]["/v1/lightings"]["post"]["requestBody"]["content"][FORM_TYPE]["schema"]
                form["properties"][PHOTO_FIELD]["maxItems"] = settings.max_photos
                documents.append(document)
        return documents[0]

    app.openapi = openapi  # type: ignore[method-assign]


def _add_tags(paths: Json) -> None:
    """Say that the answers under /v1 have tags, other than those of jobs."""
    for path, operations in paths.items():
        if path.startswith("/v1/") and not path.startswith("/v1/jobs"):
            for operation in operations.values():
                operation["responses"]["200"].setdefault("headers", {})["ETag"] = _ETAG


def _add_schemas(schemas: Json) -> None:
    """Add what no route of FastAPI's own names: the record of a body, and the problem."""
    for model in (Problem, LightingRecord):
        if model.__name__ not in schemas:
            schema = model.model_json_schema(ref_template="#/components/schemas/{model}")
            schemas.update({**schema.pop("$defs", {}), model.__name__: schema, **schemas})
