"""compose.yaml: images by digest, the proxy's limits those of the service, and memory for what its limits admit."""

import re
import shlex
from typing import Any

import pytest
import uvicorn
import yaml
from packaging.version import Version

from lighting.photo.reader import memory_budget
from lighting.registration import photo_set
from lighting.registration.features import MATCH_SIDE
from lighting.scene.records import PLATE_SIDE
from scripts.book import read_code_blocks
from server.connections import MAX_HEADER_BYTES
from server.limits import PLACE_BYTES
from server.settings import PREFIX, Settings
from tests.helpers.pages import ROOT

IDLE, DECODER, MATCHER = (
    300_000_000,
    50_000_000,
    60_000_000,
)  # bytes of the process, and of each that decodes or matches
CONNECTION = 50_000  # bytes of an open connection
LARGEST = 4 * 3 * 4096 * 2048  # bytes of an answer: a map without compression


@pytest.fixture(scope="module")
def services() -> Any:
    return yaml.safe_load((ROOT / "compose.yaml").read_text())["services"]


def settings_of(services: Any) -> Settings:
    said = services["lighting"]["environment"].items()
    given: dict[str, Any] = {name.removeprefix(PREFIX).lower(): str(value) for name, value in said}
    return Settings(**given)


def test_every_setting_is_one_and_the_images_are_pinned(services: Any) -> None:
    settings_of(services)
    assert re.fullmatch(r"caddy:[\d.]+-alpine@sha256:[0-9a-f]{64}", services["proxy"]["image"])


def test_the_pinned_proxy_is_the_one_that_the_caddyfile_speaks_of(services: Any) -> None:
    named = re.search(r"from Caddy ([\d.]+) on", (ROOT / "Caddyfile").read_text())
    pinned = re.search(r"caddy:([\d.]+)-", services["proxy"]["image"])
    assert named
    assert pinned
    assert Version(pinned[1]) >= Version(named[1])


def test_one_address_cannot_take_all_uploads(services: Any) -> None:
    settings = settings_of(services)
    assert 2 * settings.uploads_per_client <= settings.uploads


def test_the_proxy_s_limits_are_the_service_s(services: Any) -> None:
    settings, proxy = settings_of(services), services["proxy"]["environment"]
    assert (proxy["MAX_BYTES"], proxy["UPLOAD_SECONDS"], proxy["HEADER_SECONDS"]) == (
        settings.max_bytes,
        settings.upload_seconds,
        settings.header_seconds,
    )
    caddy = (ROOT / "Caddyfile").read_text()
    for line in (
        "max_size {$MAX_BYTES}",
        "read_body {$UPLOAD_SECONDS}s",
        "read_header {$HEADER_SECONDS}s",
        f"max_header_size {MAX_HEADER_BYTES}",
        "respond /metrics 404",
    ):
        assert line in caddy


def test_the_proxy_ends_idle_connections_before_the_service_does() -> None:
    """A request on a connection that the service just ends would be lost."""
    seconds = re.search(r"keepalive (\d+)s", (ROOT / "Caddyfile").read_text())
    assert seconds
    assert int(seconds[1]) < uvicorn.Config("").timeout_keep_alive


def test_its_memory_holds_what_its_limits_admit(services: Any) -> None:
    """What the service needs at once, at most, by its limits."""
    s = settings_of(services)
    bodies = (s.workers + s.queue + s.uploads) * s.max_bytes
    decoding = memory_budget(s.max_bytes, s.max_pixels, PLATE_SIDE)
    kept = s.max_photos * 3 * (2 * MATCH_SIDE - 1) ** 2  # photos to be matched, and once more on their way
    matching = MATCHER + photo_set.BASE_MEMORY + s.max_photos * photo_set.MEMORY_PER_PHOTO + 2 * kept
    assert kept + memory_budget(s.max_bytes, s.max_pixels, MATCH_SIDE) < decoding
    workers = s.workers * (DECODER + max(decoding, matching))
    answers = s.unsent_bytes + 2 * s.workers * LARGEST
    connections = s.connections * (PLACE_BYTES + CONNECTION)
    limit = services["lighting"]["deploy"]["resources"]["limits"]["memory"]
    assert IDLE + workers + bodies + answers + connections < int(limit.removesuffix("g")) * 2**30


def test_the_page_s_commands_name_what_the_files_have(services: Any) -> None:
    """The image, its port, the profile and the variable of the host name."""
    page = (ROOT / "docs" / "do" / "run-the-service.md").read_text(encoding="utf-8")
    dockerfile, compose = (ROOT / "Dockerfile").read_text(), (ROOT / "compose.yaml").read_text()
    (block,) = (block for block in read_code_blocks(page) if "docker build" in block.text)
    build, run, up, proxied = (shlex.split(line, comments=True) for line in block.text.splitlines())
    name = services["lighting"]["image"]
    assert build == ["docker", "build", "-t", name, "."]
    outside, inside = run[run.index("-p") + 1].split(":")
    assert f"\nEXPOSE {inside}\n" in dockerfile
    assert services["lighting"]["ports"] == [f"127.0.0.1:{outside}:{inside}"]
    assert (run[-1], run[run.index("--cap-drop") + 1]) == (name, services["lighting"]["cap_drop"][0])
    assert "--read-only" in run
    assert services["lighting"]["read_only"]
    assert up == ["docker", "compose", "up", "--build"]
    variable = proxied[0].partition("=")[0]
    assert f"${{{variable}:-" in compose
    assert [proxied[proxied.index("--profile") + 1]] == services["proxy"]["profiles"]
    for argument in re.findall(r"--build-arg (\w+)=", page):
        assert f"\nARG {argument}=" in dockerfile
    for user in re.findall(r"as user (\d+)", page):
        assert f"\nUSER {user}:" in dockerfile
