"""The server for assistants, by the client of the protocol's own SDK over stdin and stdout."""

import base64
import json
import os
import sys
from collections.abc import Awaitable, Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import anyio
import pytest
from jsonschema import validate  # type: ignore[import-untyped]
from mcp import Client, StdioServerParameters, stdio_client
from mcp.server.mcpserver.exceptions import ToolError
from mcp_types import CallToolResult, ImageContent, TextContent
from PIL import Image

from lighting.files.exr import read_exr
from lighting.records import Lighting
from server.mcp_server import AllowedFolders
from tests.conftest import encode, munich, scene
from tests.helpers.pages import ROOT
from tests.helpers.photos import png
from tests.helpers.processes import error_of, invoke_command

Call = Callable[..., Awaitable[CallToolResult]]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a photo, and beside it a secret that a link in the folder leads to."""
    own = tmp_path / "own"
    own.mkdir()
    (own / "photo.jpg").write_bytes(encode(Image.fromarray(scene(320, 240)), exif=munich()))
    (tmp_path / "secret.jpg").write_bytes(encode(scene(320, 240)))
    (own / "link.jpg").symlink_to(tmp_path / "secret.jpg")
    (own / "outside").symlink_to(tmp_path)
    return own


def with_client(folder: Path, use: Callable[[Client, Call], Awaitable[None]]) -> None:
    """Start `lighting mcp FOLDER` and use it."""
    environment = {"PATH": os.environ["PATH"], "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    parameters = StdioServerParameters(
        command=sys.executable, args=["-P", "-m", "lighting", "mcp", str(folder)], env=environment
    )

    async def run() -> None:
        with anyio.fail_after(120):
            async with Client(stdio_client(parameters)) as client:

                async def call(tool: str, /, **arguments: Any) -> CallToolResult:
                    return await client.call_tool(tool, arguments)

                await use(client, call)

    anyio.run(run)


def text_of(result: CallToolResult) -> str:
    (block,) = result.content
    assert isinstance(block, TextContent)
    return block.text


def test_every_tool_answers(folder: Path) -> None:
    async def use(client: Client, call: Call) -> None:
        tools = {tool.name: tool for tool in (await client.list_tools()).tools}
        assert set(tools) == {
            *("estimate_light", "explain_answer", "draw_preview", "write_environment_map", "write_scene"),
        }
        steps: list[tuple[float, float | None]] = []

        async def note(progress: float, total: float | None, message: str | None) -> None:
            assert message
            steps.append((progress, total))

        known = {"heading": 61.5}
        answer = await client.call_tool(
            "estimate_light", {"photo": "photo.jpg", "known": known}, progress_callback=note
        )
        assert not answer.is_error, answer.content
        assert [done for done, _ in steps] == sorted(done for done, _ in steps)
        assert steps[-1] == (3, 3)
        schema = tools["estimate_light"].output_schema
        assert schema is not None
        validate(answer.structured_content, schema)
        assert schema["$defs"]["SunPart"]["properties"]["azimuth"]["minimum"] == -180.0
        assert json.loads(text_of(answer)) == answer.structured_content
        light = Lighting.from_dict(answer.structured_content)
        assert light.camera_heading is not None
        assert "heading" in light.evidence

        said = (await call("explain_answer", photo="photo.jpg")).structured_content
        validate(said, tools["explain_answer"].output_schema)
        assert said["trust"] in ("sure", "unsure", "no sun")
        assert sum(sun["probability"] for sun in said["candidates"]) == pytest.approx(1.0, abs=0.01)
        assert not any(text.startswith("time") for text in said["would_help"])  # which the photo has

        shown = await call("draw_preview", photo="photo.jpg", options={"overcast": True})
        (picture,) = shown.content
        assert isinstance(picture, ImageContent)
        with Image.open(BytesIO(base64.b64decode(picture.data))) as preview:
            assert preview.width == 1600

        options = {"height": 64, "sun": "40,25"}
        made = await call("write_environment_map", photo="photo.jpg", output="map.exr", options=options)
        validate(made.structured_content, tools["write_environment_map"].output_schema)
        assert made.structured_content["file"] == str(folder / "map.exr")
        image, record = read_exr(folder / "map.exr")
        assert image.shape == (64, 128, 3)
        assert record is not None
        assert record.sun_azimuth == 40.0

        made = await call("write_scene", photo="photo.jpg", tool="threejs", folder="page")
        validate(made.structured_content, tools["write_scene"].output_schema)
        assert made.structured_content["files"] == ["scene.html"]
        assert str(folder / "page" / "scene.html") in made.structured_content["how_to_open"]

    with_client(folder, use)


def test_nothing_leaves_the_folders_or_replaces_a_file(folder: Path) -> None:
    before = {path: path.read_bytes() for path in folder.parent.rglob("*.jpg")}
    (folder / "map.exr").write_bytes(b"mine")
    out, photo = str(folder.parent / "out.exr"), "photo.jpg"
    (folder / "huge.png").write_bytes(png(100_000, 100_000, b"\0"))
    refused: list[tuple[str, dict[str, Any], str]] = [
        *(
            ("estimate_light", {"photo": name}, "is not below")
            for name in ("../secret.jpg", str(folder.parent / "secret.jpg"), "link.jpg", "outside/secret.jpg")
        ),
        ("estimate_light", {"photo": "https://example.com/photo.jpg"}, "nothing is fetched"),
        ("estimate_light", {"photo": "nothing.jpg"}, "There is no file"),
        ("estimate_light", {"photo": "huge.png"}, "more than its limit of 128 million pixels"),
        ("estimate_light", {"photo": photo, "known": {"latitude": 91}}, "latitude"),
        ("write_environment_map", {"photo": photo, "output": out}, "is not below"),
        ("write_environment_map", {"photo": photo, "output": "outside/out.exr"}, "is not below"),
        ("write_environment_map", {"photo": photo, "output": "map.exr"}, "overwrite=true replaces it"),
        ("write_environment_map", {"photo": photo, "output": "map.tif"}, ".exr"),
        ("write_environment_map", {"photo": photo, "output": photo, "overwrite": True}, "would replace the photo"),
        ("write_scene", {"photo": photo, "tool": "usd", "folder": "outside/new"}, "is not below"),
        ("write_scene", {"photo": photo, "tool": "usd", "folder": "."}, "overwrite=true replaces"),
        ("write_scene", {"photo": photo, "tool": "maya", "folder": "new"}, "'blender'"),
        ("write_scene", {"photo": photo, "tool": "gltf", "folder": "n", "tool_options": {"up_axis": "Z"}}, "goes with"),
    ]

    async def use(_client: Client, call: Call) -> None:
        for tool, arguments, words in refused:
            result = await call(tool, **arguments)
            assert result.is_error, arguments
            assert words in text_of(result), (arguments, text_of(result))

    with_client(folder, use)
    assert {path: path.read_bytes() for path in folder.parent.rglob("*.jpg")} == before
    assert (folder / "map.exr").read_bytes() == b"mine"
    assert not (folder.parent / "out.exr").exists()


def test_a_sidecar_behind_a_link_is_not_read(folder: Path) -> None:
    (folder.parent / "light.xmp").write_text("<x/>")
    (folder / "photo.xmp").symlink_to(folder.parent / "light.xmp")
    (folder / "own.xmp").write_text("<x/>")
    allowed = AllowedFolders((folder.resolve(),))
    assert allowed.read_small(folder / "photo.xmp") is None
    assert allowed.read_small(folder / "own.xmp") == b"<x/>"
    with pytest.raises(ToolError, match="is not below"):
        allowed.find("..")


def test_the_command_names_a_folder_that_is_missing(tmp_path: Path) -> None:
    assert error_of(invoke_command("mcp", tmp_path / "none"), 2) == f"There is no folder {tmp_path / 'none'}."


def test_the_command_prints_an_assistants_settings(tmp_path: Path) -> None:
    printed = invoke_command("mcp", tmp_path, "--json").stdout
    entry = json.loads(printed)["mcpServers"]["lighting"]
    assert entry["command"] == sys.executable
    assert entry["args"][-2:] == ["mcp", str(tmp_path)]
