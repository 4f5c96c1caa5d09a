"""A server of the Model Context Protocol on stdin and stdout: `python -m server.mcp_server FOLDER...`.

Assistants start it by `lighting mcp`. Its tools read and write below the folders alone, and fetch nothing.
"""

import json
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, TypeVar

import anyio
import anyio.to_thread
import numpy as np
from mcp.server.mcpserver import Context, Image, MCPServer
from mcp.server.mcpserver.exceptions import ToolError
from mcp_types import CallToolResult, TextContent, ToolAnnotations
from pydantic import BaseModel, ConfigDict, Field, ValidationError

import lighting.scene.writer as writer
from lighting.errors import LightingError, describe_error
from lighting.estimator import Estimator
from lighting.fields import Json
from lighting.files import encode_jpeg, is_address
from lighting.map_options import MapOptions
from lighting.model import Model
from lighting.photo.reader import Photo, read_photo
from lighting.photo.sidecars import MAX_SIDECAR_BYTES, read_sidecar
from lighting.photo_estimate import Estimate
from lighting.records import MIN_SUITABLE, SURE_RADIUS, EvidenceKind, Lighting, Trust
from lighting.scene import EXPORTERS
from lighting.version import __version__
from server.query_params import (
    AdjustQuery,
    MapQuery,
    PlaceQuery,
    PreviewQuery,
    SceneQuery,
    UserInputQuery,
    with_options,
)
from server.schemas import LightingRecord

_INSTRUCTIONS = """Estimates sun, sky and camera of one outdoor photo taken by daylight.
Azimuths are degrees from where the camera points, positive to the right.
Ask explain_answer before you rely on the sun, and tell the person what would help.
Paths are below these folders; relative ones begin in the first: {}"""
_PREVIEW_QUALITY = 85  # of its JPEG, 1 to 100
_HELP = {  # what the person may state, by the evidence that it makes
    EvidenceKind.TIME_AND_PLACE: "time (with its offset from UTC), latitude and longitude of the photo",
    EvidenceKind.SHADOW: "shadow: a shadow on level ground, from the foot of what casts it to its tip, in pixels",
    EvidenceKind.HEADING: "heading: where the camera points, in degrees clockwise from true north",
    EvidenceKind.FOCAL_LENGTH: "vertical_fov: the vertical field of view, if the photo was cropped or lost its EXIF",
}
_READS = ToolAnnotations(read_only_hint=True, open_world_hint=False)
_WRITES = ToolAnnotations(read_only_hint=False, destructive_hint=True, idempotent_hint=True, open_world_hint=False)

_Photo = Annotated[str, Field(description="path of the photo's file")]
_Overwrite = Annotated[bool, Field(description="replace files that are there")]
_TOOL_OPTIONS = "; ".join(
    f"{name}, with {tool}: {' or '.join(option.choices)}"
    for tool, entry in EXPORTERS.items()
    for name, option in entry.options.items()
    if option.choices
)
_Context = Context[Any, Any]
_NOTHING_KNOWN, _DEFAULT_PREVIEW = UserInputQuery(), PreviewQuery()
_T = TypeVar("_T")


class _MapToolQuery(UserInputQuery, AdjustQuery, PlaceQuery, MapQuery):
    """What is known of the photo, what changes of its light, and how the map is rendered."""


@with_options(MapOptions, "height")
class _SceneToolQuery(PreviewQuery):
    """What is known of the photo, and what changes of its light."""


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Explanation(_Part):
    """How far to trust an answer, and what would make it better."""

    trust: Trust = Field(description="of the sun's direction")
    reasons: list[str] = Field(description="sentences")
    candidates: list[LightingRecord.SunPart.CandidatePart] = Field(description="the answer first; `pick` takes another")
    would_help: list[str] = Field(description="what the person could state: fields of `known` and `options`")
    evidence: list[str] = Field(description="what the answer uses")
    warnings: list[str] = Field(description="sentences of the record")


class WrittenMap(_Part):
    """An environment map in a file."""

    file: str
    width: int
    height: int
    lighting: LightingRecord = Field(description="the light that the map shows")


class WrittenScene(_Part):
    """A scene in a folder."""

    folder: str
    files: list[str]
    how_to_open: str
    warnings: list[str] = Field(description="tell the person")


@dataclass(frozen=True)
class AllowedFolders:
    """The folders that tools may read and write; each a full path without links."""

    folders: tuple[Path, ...]

    def find(self, name: str) -> Path:
        """Return the full path without links of a name; ToolError where it leads out of the folders.

        Args:
            name: of a file or folder, which may not be there yet; a relative one begins in the first folder.
        """
        if is_address(name):
            raise ToolError(f"{name} is an address; nothing is fetched. Give the path of a file.")
        if not name or "\0" in name:
            raise ToolError("The path is empty, or no path.")
        try:
            path = (self.folders[0] / Path(name).expanduser()).resolve()
        except (OSError, RuntimeError) as error:  # links in a circle, a home that nobody has
            raise ToolError(f"{name} is no path that leads anywhere.") from error
        if not any(path.is_relative_to(folder) for folder in self.folders):
            raise ToolError(f"{name} is not below {' or '.join(map(str, self.folders))}.")
        return path

    def read_small(self, path: Path) -> bytes | None:
        """Return what a file beside a photo holds; None where there is none, or a link leads out of the folders.

        Args:
            path: of the file.
        """
        try:
            with self.find(str(path)).open("rb") as stream:
                return stream.read(MAX_SIDECAR_BYTES + 1)
        except (OSError, ToolError):
            return None


def make_server(allowed: AllowedFolders) -> MCPServer[Any]:
    """Return the server with its tools.

    Args:
        allowed: the folders below which they read and write.
    """
    server: MCPServer[Any] = MCPServer(
        "lighting",
        version=__version__,
        instructions=_INSTRUCTIONS.format(", ".join(map(str, allowed.folders))),
        log_level="WARNING",
    )
    one_at_a_time = anyio.Lock()  # each photo takes hundreds of megabytes

    async def work(ctx: _Context, photo: str, known: UserInputQuery, make: Callable[[Estimate], _T]) -> _T:
        """Estimate the light of a photo, and make something of it."""
        path = allowed.find(photo)
        async with one_at_a_time:
            await ctx.report_progress(0, 3, "Reading the photo")
            image = await _in_thread(lambda: _read_photo(allowed, path))
            await ctx.report_progress(1, 3, "Estimating its light")
            estimate = await _in_thread(lambda: _estimator()(image, known.user_input()))
            await ctx.report_progress(2, 3, "Making the result")
            made = await _in_thread(lambda: make(estimate))
            await ctx.report_progress(3, 3, "Done")
        return made

    @server.tool(annotations=_READS)
    async def estimate_light(
        ctx: _Context, photo: _Photo, known: UserInputQuery = _NOTHING_KNOWN
    ) -> Annotated[CallToolResult, LightingRecord]:
        """Estimate sun, sky, ground and camera of one outdoor photo. The record's fields have units and ranges."""
        return await work(ctx, photo, known, lambda estimate: _answer(_record(estimate.lighting)))

    @server.tool(annotations=_READS)
    async def explain_answer(
        ctx: _Context, photo: _Photo, known: UserInputQuery = _NOTHING_KNOWN
    ) -> Annotated[CallToolResult, Explanation]:
        """Say how far to trust the estimate of a photo, where else the sun may be, and what would help."""
        return await work(ctx, photo, known, lambda estimate: _answer(explain_estimate(estimate)))

    @server.tool(annotations=_READS, structured_output=False)
    async def draw_preview(ctx: _Context, photo: _Photo, options: PreviewQuery = _DEFAULT_PREVIEW) -> Image:
        """Draw a photo, where its sun may be, its environment map, and three balls in its light."""

        def draw(estimate: Estimate) -> Image:
            pixels = np.asarray(estimate.preview(options.view()))
            return Image(data=encode_jpeg(pixels, _PREVIEW_QUALITY), format="jpeg")

        return await work(ctx, photo, options, draw)

    @server.tool(annotations=_WRITES)
    async def write_environment_map(
        ctx: _Context,
        photo: _Photo,
        output: Annotated[str, Field(description="path of the map; ends in .exr, .hdr or .png")],
        options: _MapToolQuery = _MapToolQuery(),  # noqa: B008  # frozen
        overwrite: _Overwrite = False,
    ) -> Annotated[CallToolResult, WrittenMap]:
        """Write the HDR environment map of a photo's light, for the world of a 3D program."""
        target = allowed.find(output)
        if target == allowed.find(photo):
            raise ToolError("The map would replace the photo; choose another output.")
        if target.exists() and not overwrite:
            raise ToolError(f"{target} is there already; overwrite=true replaces it.")
        with _tool_errors():
            file = options.file_options().for_path(target)

        def write(estimate: Estimate) -> CallToolResult:
            rendered = estimate.render(options.view())
            rendered.write(target, file)
            height = options.view().height
            lighting = _record(rendered.lighting)
            return _answer({"file": str(target), "width": 2 * height, "height": height, "lighting": lighting})

        return await work(ctx, photo, options, write)

    @server.tool(annotations=_WRITES)
    async def write_scene(
        ctx: _Context,
        photo: _Photo,
        tool: Annotated[str, Field(description="that opens the scene", json_schema_extra={"enum": list(EXPORTERS)})],
        folder: Annotated[str, Field(description="path of the scene's folder: new or empty unless `overwrite`")],
        options: _SceneToolQuery = _SceneToolQuery(),  # noqa: B008  # frozen
        tool_options: Annotated[dict[str, str], Field(description=_TOOL_OPTIONS)] = {},  # noqa: B006  # never changed
        overwrite: _Overwrite = False,
    ) -> Annotated[CallToolResult, WrittenScene]:
        """Write a photo and its light as a scene for Blender, USD, Unreal, Unity, a web page and others.

        It holds the camera with the photo behind it, sun, map, shadow catcher, and a placeholder for the object.
        """
        target, path = allowed.find(folder), allowed.find(photo)
        with _tool_errors():
            chosen = SceneQuery.model_validate({**tool_options, "for": tool}).options()
            writer.check_scene_target(tool, target, overwrite=overwrite)
        if path.parent == target and path.name in EXPORTERS[tool].files:
            raise ToolError("The scene would replace the photo; choose another folder.")

        def write(estimate: Estimate) -> CallToolResult:
            scene = estimate.make_scene(options.view())
            writer.write_scene(scene, tool, target, overwrite=overwrite, **chosen)
            files = [name for name in EXPORTERS[tool].files if (target / name).is_file()]
            how = EXPORTERS[tool].opening_command(str(target))
            return _answer(WrittenScene(folder=str(target), files=files, how_to_open=how, warnings=scene.warnings))

        return await work(ctx, photo, options, write)

    return server


def explain_estimate(estimate: Estimate) -> Explanation:
    """Return how far to trust an estimate, by the rules of the book's page on trust.

    Args:
        estimate: of a photo.
    """
    light = estimate.lighting
    reasons = [
        f"The sun shines on the scene with a probability of {light.sun_visibility:.2f}.",
        f"It lies within {light.radius_90:.0f} deg of the answer with a probability of 0.9.",
    ]
    would_help = [text for kind, text in _HELP.items() if kind.value not in light.evidence]
    if light.suitable is not None and light.suitable < MIN_SUITABLE:
        reasons.insert(0, "This is probably no photo of outdoors by daylight: use nothing of the answer.")
        would_help = ["another photo, of outdoors by daylight"]
    elif light.radius_90 <= SURE_RADIUS:
        would_help = []
    return Explanation(
        trust=light.trust,
        reasons=reasons,
        candidates=[LightingRecord.SunPart.CandidatePart(**asdict(sun)) for sun in light.sun_candidates],
        would_help=would_help,
        evidence=list(light.evidence),
        warnings=list(light.warnings),
    )


def _record(lighting: Lighting) -> Json:
    """The record without the heading's 360 probabilities, which are nothing to read."""
    return replace(lighting, camera_heading_probability=()).to_dict()


def _answer(content: Json | BaseModel) -> CallToolResult:
    """Content as it is, and as text for clients that read no other."""
    values = content.model_dump() if isinstance(content, BaseModel) else content
    return CallToolResult(content=[TextContent(type="text", text=json.dumps(values))], structured_content=values)


def _read_photo(allowed: AllowedFolders, path: Path) -> Photo:
    if not path.is_file():
        raise ToolError(f"There is no file {path}.")
    return read_photo(path, sidecar=read_sidecar(path, allowed.read_small))


@lru_cache(maxsize=1)
def _estimator() -> Estimator:
    return Estimator(Model.load())


@contextmanager
def _tool_errors() -> Iterator[None]:
    """Expected errors as sentences that the assistant reads."""
    try:
        yield
    except ValidationError as error:
        raise ToolError("; ".join(details["msg"] for details in error.errors())) from error
    except (LightingError, OSError) as error:
        sentence = describe_error(error).replace("--overwrite", "overwrite=true")
        raise ToolError(sentence) from error


async def _in_thread(step: Callable[[], _T]) -> _T:
    with _tool_errors():
        return await anyio.to_thread.run_sync(step)


def run_mcp_server() -> None:
    """Serve until stdin ends; the arguments are the folders."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)
    make_server(AllowedFolders(tuple(Path(name).resolve(strict=True) for name in sys.argv[1:]))).run("stdio")


if __name__ == "__main__":
    run_mcp_server()
