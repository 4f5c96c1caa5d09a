"""The Blender extension: its zip, what it asks of command and service, and, where there is a bpy, all of it."""

import ast
import importlib
import io
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from socket import create_server
from threading import Thread
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest

from lighting.batch.photo_search import PHOTO_SUFFIXES
from lighting.envmap.relighting import adjust_lighting
from lighting.envmap.render import render, sun_light
from lighting.estimator import Estimator
from lighting.fusion.marks import OwnShadow, Shadow, marked_points, read_shadow
from lighting.fusion.user_input import UserInput
from lighting.map_options import Adjustments
from lighting.photo.reader import read_photo
from lighting.records import Lighting, SunCandidate
from lighting.scene.records import make_scene
from lighting.scene.writer import write_scene, zip_scene
from lighting.version import __version__
from scripts.blender_extension import ROOT, build, relative, release_name
from tests.helpers.engines import CHROOT, PYTHON, folder_in_chroot, needs_blender, needs_engines, run_in_chroot
from tests.helpers.scenes import sunlit_scene

SHADOW = "800,900,400,950"  # as in try_extension.py
NEEDED = {"scene.json", "plate.png", "environment.exr", "lit_ground.png", "lighting.json"}


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("zip") / "light_from_photo.zip")


@pytest.fixture(scope="module")
def unpacked(package: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The name of a package with the zip's files, without the beginning that needs Blender."""
    folder = tmp_path_factory.mktemp("unpacked")
    zipfile.ZipFile(package).extractall(folder / "unpacked_extension")
    (folder / "unpacked_extension" / "__init__.py").write_text("")
    sys.path.insert(0, str(folder))
    yield "unpacked_extension"
    sys.path.remove(str(folder))


@pytest.fixture(scope="module")
def answers(unpacked: str) -> Any:
    return importlib.import_module(f"{unpacked}.answers")


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    (tmp_path / "photo.png").write_bytes(b"a photo")
    return tmp_path / "photo.png"


# The zip


def test_the_manifest_is_one_of_blender_42(package: Path) -> None:
    with zipfile.ZipFile(package) as archive:
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
    assert manifest["schema_version"] == "1.0.0"
    assert (manifest["id"], manifest["type"]) == ("light_from_photo", "add-on")
    assert manifest["blender_version_min"] == "4.2.0"
    assert "SPDX:Apache-2.0" in manifest["license"]
    assert set(manifest["permissions"]) == {"network", "files"}
    for line in (manifest["tagline"], *manifest["permissions"].values()):
        assert len(line) <= 64
        assert line[-1] not in ".!?"


def test_nothing_is_imported_but_blender_numpy_and_itself(package: Path) -> None:
    with zipfile.ZipFile(package) as archive:
        for name in [name for name in archive.namelist() if name.endswith(".py")]:
            tree = ast.parse(archive.read(name))
            nodes = list(ast.walk(tree))
            imported = {
                alias.name.split(".")[0] for node in nodes if isinstance(node, ast.Import) for alias in node.names
            }
            imported |= {str(n.module).split(".")[0] for n in nodes if isinstance(n, ast.ImportFrom) and not n.level}
            blenders = {"bpy", "bpy_extras", "gpu", "gpu_extras", "mathutils"}
            assert imported - set(sys.stdlib_module_names) <= {*blenders, "numpy"}, name


def test_the_same_files_make_the_same_zip(package: Path, tmp_path: Path) -> None:
    assert build(tmp_path / "again.zip").read_bytes() == package.read_bytes()


def test_a_release_names_it_as_blender_does() -> None:
    assert re.fullmatch(r"light_from_photo-\d+\.\d+\.\d+\.zip", release_name())


def test_imports_become_relative() -> None:
    assert relative("from lighting.geometry import x\n", 1) == "from .geometry import x\n"
    assert relative("    from lighting.sky.perez import x\n", 2) == "    from ..sky.perez import x\n"
    assert relative("import lighting.geometry as g\n", 2) == "from .. import geometry as g\n"
    assert relative("import lighting.sky.perez as p\n", 2) == "from ..sky import perez as p\n"


def test_its_sky_and_sun_are_those_of_the_library(unpacked: str) -> None:
    skies = importlib.import_module(f"{unpacked}.skies")
    numbers: dict[str, Any] = {"sun_azimuth": -40.0, "sun_elevation": 35.0, "turbidity": 3.0, "exposure": 2.0}
    light = importlib.import_module(f"{unpacked}.lighting.records").Lighting(**numbers)
    ours = Lighting(**numbers)
    image = skies.pixels(light, shines=True).reshape(skies.HEIGHT, -1, 4)[::-1]
    np.testing.assert_array_equal(image[..., :3], render(ours, skies.HEIGHT, sun=True, disc=False))
    assert (image[..., 3] == 1).all()
    sun = skies.sun(light, shines=True)
    assert np.array(sun["colour"]) * sun["irradiance"] == pytest.approx(sun_light(ours)[0])
    assert skies.sun(light, shines=False)["irradiance"] == 0


def test_the_lights_power_follows_the_sliders(unpacked: str) -> None:
    """Its irradiances keep their ratio to the model's; single precision is no reason to fail."""
    skies = importlib.import_module(f"{unpacked}.skies")
    irradiance: dict[str, Any] = {"sun_irradiance": (1.9, 1.5, 0.9), "sky_irradiance": (0.4, 0.5, 0.8)}
    stated = Lighting(-40.0, 35.0, 3.0, 2.0, sky_cover=0.3, ground_color=(0.2, 0.1, 0.1), **irradiance)
    record = json.dumps(stated.to_dict())
    sliders = {"sun_azimuth": -40.0, "sun_elevation": 35.0, "haze": 3.0, "exposure": 0.0}
    as_estimated = skies.light_of_sliders(record, sliders)
    assert as_estimated.sky_irradiance == pytest.approx(stated.sky_irradiance)
    moved = sliders | {"sun_elevation": 5.0, "haze": float(np.float32(10.0000001)), "exposure": 1.0}
    for overcast in (False, True):
        ours = adjust_lighting(stated, Adjustments((-40.0, 5.0), 1.0, 10.0, overcast))
        assert Lighting.from_dict(skies.light_of_sliders(record, moved, overcast).to_dict()) == ours


# The command


def command(folder: Path, text: str) -> str:
    program = folder / "a command"
    version = "if sys.argv[1:] == ['--version']: sys.exit(print('lighting, version 0.3.0'))"
    program.write_text(f"#!{sys.executable}\nimport sys, pathlib\n{version}\n{text}\n")
    program.chmod(0o755)
    return str(program)


def test_a_command_fills_the_folder(answers: Any, photo: Path, tmp_path: Path) -> None:
    text = (
        "assert sys.argv[1] == 'scene' and sys.argv[3:5] == ['--for', 'blender'], sys.argv\n"
        f"for name in {sorted(NEEDED)}: (pathlib.Path(sys.argv[6]) / name).write_text('x')"
    )
    (tmp_path / "out").mkdir()
    answers.from_command(command(tmp_path, text), photo, tmp_path / "out")
    assert {path.name for path in (tmp_path / "out").iterdir()} == NEEDED


def test_a_command_is_told_what_the_user_knows(answers: Any, photo: Path, tmp_path: Path) -> None:
    text = "sys.exit(' '.join(sys.argv[7:]))"
    stated = answers.Stated(("1,2,3,40", "own:5,6"), pick=2)
    with pytest.raises(answers.AnswerError, match=r"^--quiet --shadow 1,2,3,40 --shadow own:5,6 --pick 2$"):
        answers.from_command(command(tmp_path, text), photo, tmp_path, stated)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [("sys.exit('Error: p.png: no photo.')", "p.png: no photo."), ("", "The answer has no scene.json, plate.png")],
)
def test_a_command_that_fails_is_a_sentence(
    answers: Any, photo: Path, tmp_path: Path, text: str, sentence: str
) -> None:
    with pytest.raises(answers.AnswerError, match=f"^{sentence}"):
        answers.from_command(command(tmp_path, text), photo, tmp_path)


def test_no_command_is_a_sentence(answers: Any, photo: Path, tmp_path: Path) -> None:
    with pytest.raises(answers.AnswerError, match=r"^There is no command 'absent-command' that works;"):
        answers.from_command("absent-command", photo, tmp_path)


def test_the_command_is_found_where_it_was_built_and_where_installers_put_it(
    answers: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "bin" / "lighting"
    program.parent.mkdir()
    Path(command(tmp_path, "")).rename(program)
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(answers, "_USUAL", ())
    assert answers.find_command("lighting") is None
    with zipfile.ZipFile(build(tmp_path / "own.zip", str(program))) as archive:
        monkeypatch.setattr(answers, "_BUILT_BY", Path(archive.extract("command.txt", tmp_path)))
    assert answers.find_command("lighting") == str(program)
    assert answers.find_command("lighting-2") is None
    monkeypatch.setattr(answers, "_BUILT_BY", tmp_path / "none")
    monkeypatch.setattr(answers, "_USUAL", ("~/bin/lighting",))
    monkeypatch.setenv("HOME", str(tmp_path))
    assert answers.find_command("lighting") == str(program)


@pytest.mark.parametrize("text", ["#!/bin/sh\nexit 1", "#!/bin/sh\necho lamps 2.0", "#!/absent/python\n"])
def test_a_command_that_does_not_work_is_passed_over(
    answers: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    """A broken environment, and another program of the same name, before one that works."""
    (tmp_path / "path").mkdir()
    (tmp_path / "path" / "lighting").write_text(text)
    (tmp_path / "path" / "lighting").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path / "path"))
    monkeypatch.setattr(answers, "_USUAL", (command(tmp_path, ""),))
    assert answers.find_command("lighting") == str(tmp_path / "a command")


def test_the_projects_own_command_is_recognised(answers: Any) -> None:
    program = shutil.which("lighting", path=str(Path(sys.executable).parent))
    assert program is not None
    assert answers.version_of(program) == __version__


def test_only_a_service_of_this_computer_is_used_unasked(answers: Any) -> None:
    for address in ("http://example.com", "ftp://127.0.0.1", "nonsense", "http://127.0.0.1:9", "http://127.0.0.1:x"):
        assert answers.find_service(address, "") is None


def test_a_service_is_found_on_a_later_port(answers: Any) -> None:
    """As `lighting serve` takes one where another program listens; that is asked, and is none."""
    _Service.answers = {"/v1/model": b'{"scene_tools": ["blender", "usd"]}', "/readyz": b"{}"}
    with HTTPServer(("127.0.0.1", 0), _Service) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        address, before = f"http://127.0.0.1:{server.server_port}", f"http://127.0.0.1:{server.server_port - 2}"
        assert answers.find_service(address, " key\n") == address
        assert _Service.received["authorization"] == "Bearer key"
        assert answers.find_service(before, "") == address
        for name, other in (("/readyz", None), ("/v1/model", b'{"name": "another"}'), ("/v1/model", b"<html>")):
            _Service.answers = _Service.answers | {name: other}
            assert answers.find_service(address, "") is None
        server.shutdown()


# What is drawn and dragged


@pytest.fixture(scope="module")
def dome(unpacked: str) -> Any:
    return importlib.import_module(f"{unpacked}.dome")


@pytest.mark.parametrize(("azimuth", "elevation"), [(0.0, 30.0), (-120.0, 5.0), (179.0, 60.0), (40.0, 89.0)])
@pytest.mark.parametrize("eye", [(0.0, 0.0, 1.6), (9.0, -3.0, 4.0)])
def test_a_line_of_sight_to_the_sun_on_the_dome_finds_it(
    dome: Any, azimuth: float, elevation: float, eye: tuple[float, float, float]
) -> None:
    center, radius = np.array([0.5, 5.0, 0.0]), 1.5
    sun = dome.sun_direction(azimuth, elevation)
    sight = center + radius * sun - np.array(eye)
    near = bool(sight @ sun < 0)
    hit = dome.meet_dome(eye, sight / np.linalg.norm(sight), center, radius, near=near)
    assert not hit.misses
    assert dome.sun_angles(hit.direction) == pytest.approx((azimuth, elevation), abs=1e-6)


def test_the_domes_frame_is_that_of_the_lamp(unpacked: str, dome: Any) -> None:
    light = Lighting(-40.0, 35.0, 3.0, 2.0)
    skies = importlib.import_module(f"{unpacked}.skies")
    assert skies.sun(light, shines=True)["direction"] == pytest.approx(dome.sun_direction(-40.0, 35.0), abs=1e-6)


def test_beside_the_dome_the_sun_stays_on_its_rim(dome: Any) -> None:
    eye, center = np.zeros(3), np.array([0.0, 10.0, 0.0])
    hit = dome.meet_dome(eye, np.array([0.6, 0.8, 0.0]), center, 1.0, near=True)
    assert hit.misses
    assert np.linalg.norm(hit.direction) == pytest.approx(1.0)
    assert hit.direction @ np.array([0.6, 0.8, 0.0]) == pytest.approx(0.0)
    assert dome.sun_angles(hit.direction)[0] == pytest.approx(90.0 + np.degrees(np.arctan2(0.6, 0.8)))
    inside = dome.meet_dome(center, np.array([0.0, 0.0, 1.0]), center, 1.0, near=True)
    assert inside.direction == pytest.approx([0, 0, 1])  # an eye in the dome has it all before it


def test_a_click_on_the_photo_is_its_pixel(unpacked: str) -> None:
    marks = importlib.import_module(f"{unpacked}.marks")
    window = (100.0, 500.0), (900.0, 50.0)
    size = (1600, 900)
    assert marks.photo_pixel((100.0, 500.0), *window, size) == (0.0, 0.0)
    assert marks.photo_pixel((300.0, 275.0), *window, size) == pytest.approx((400.0, 450.0))
    assert marks.photo_pixel((900.0, 50.0), *window, size) == (1600.0, 900.0)
    for beside in ((99.0, 275.0), (300.0, 501.0), (901.0, 60.0)):
        assert marks.photo_pixel(beside, *window, size) is None
    assert marks.photo_pixel((1.0, 1.0), (0.0, 0.0), (0.0, 0.0), size) is None


def test_every_kind_of_mark_is_one_that_the_command_reads(unpacked: str) -> None:
    marks = importlib.import_module(f"{unpacked}.marks")
    found = set()
    for name, kind in marks.KINDS.items():
        points = [(10.0 + 50 * number, 20.04) for number in range(len(kind.clicks))]
        mark = read_shadow(marks.mark_text(name, points))
        assert marked_points(mark) == [(x, 20.0) for x, _ in points]
        found.add((type(mark), getattr(mark, "is_head", None), len(points)))
    texts = ("1,2,3,9", "1,2,3,9,5,6", "line:1,2,3,9", "lit:1,2,3,9", "lit:1,2,9,2,4,2")
    kinds = [(type(mark), None, len(marked_points(mark))) for mark in map(read_shadow, texts)]
    assert found == {*kinds, (OwnShadow, False, 1), (OwnShadow, True, 1)}


def test_a_shadow_with_its_foot_is_said_to_be_a_guess(unpacked: str) -> None:
    marks = importlib.import_module(f"{unpacked}.marks")
    for name in ("SHADOW", "TOP"):
        text = marks.mark_text(name, [(10.0, 20.0), (60.0, 40.0), (10.0, 5.0)][: len(marks.KINDS[name].clicks)])
        guessed, shadow = marks.turn_guess(text), read_shadow(text)
        assert isinstance(shadow, Shadow)
        assert read_shadow(guessed) == replace(shadow, is_doubted=True)
        assert (marks.is_guess(text), marks.is_guess(guessed), marks.turn_guess(guessed)) == (False, True, text)
    assert [marks.is_guess(text) for text in ("own:1,2", "head:1,2", "line:1,2,3,9", "lit:1,2,3,9")] == [None] * 4


def test_the_answer_says_its_trust_in_a_line_and_its_suns_on_buttons(unpacked: str) -> None:
    trust = importlib.import_module(f"{unpacked}.trust")
    suns = (SunCandidate(-40.0, 35.0, 0.6), SunCandidate(120.4, 25.0, 0.31))
    unsure = Lighting(-40.0, 35.0, 3.0, 2.0, radius_50=30.0, radius_90=80.0, sun_candidates=suns)
    record = json.dumps(unsure.to_dict())
    assert trust.trust_line(record) == "Unsure: draw a shadow or pick a sun"
    assert trust.sun_labels(record) == ["40° left, 35° high (60 %)", "120° right (behind), 25° high (31 %)"]
    assert trust.sun_labels(json.dumps(replace(unsure, sun_candidates=suns[:1]).to_dict())) == []
    lines = {trust.trust_line(json.dumps(replace(unsure, **change).to_dict())) for change in _OTHER_TRUST}
    assert lines == {"The sun is sure", "No sun is seen: set one by eye"}


_OTHER_TRUST: tuple[dict[str, Any], ...] = ({"radius_90": 20.0}, {"sun_visibility": 0.1})


@pytest.mark.slow
@needs_blender
def test_the_zip_is_valid_by_blenders_own_rules(tmp_path: Path) -> None:
    """What `blender --command extension validate` runs."""
    home = subprocess.run(
        [PYTHON, "-c", "import bpy; print('HOME', bpy.utils.system_resource('SCRIPTS'))"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.partition("HOME ")[2].strip()  # fmt: skip
    program = Path(home, "addons_core", "bl_pkg", "cli", "blender_ext.py")
    if not program.is_file():
        pytest.skip("needs the extensions of Blender 4.2 or newer")
    for zipped in (build(tmp_path / release_name()), build(tmp_path / "own.zip", "/usr/bin/true")):
        done = subprocess.run([PYTHON, program, "validate", zipped], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        assert "success" in (done.stdout + done.stderr).lower()


# The service


class _Service(BaseHTTPRequestHandler):
    """Answers with what the test wants, and remembers what it was asked."""

    answer: tuple[int, bytes, dict[str, str]]
    answers: dict[str, bytes | None]  # to GET, by path; None: it is not ready
    received: dict[str, Any]

    def do_GET(self) -> None:
        data = self.answers.get(self.path)
        if self.path == "/v1/model":
            type(self).received = {name.lower(): value for name, value in self.headers.items()}
        self.send_response(503 if data is None else 200)
        self.end_headers()
        self.wfile.write(data or b"{}")

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        type(self).received = {"path": self.path, "body": body, **{k.lower(): v for k, v in self.headers.items()}}
        status, data, headers = self.answer
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, *_: Any) -> None:
        pass


@pytest.fixture
def address() -> Iterator[str]:
    with HTTPServer(("127.0.0.1", 0), _Service) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def test_a_service_gets_photo_and_key_and_fills_the_folder(
    answers: Any, photo: Path, tmp_path: Path, address: str
) -> None:
    _Service.answer = 200, zip_scene(sunlit_scene(48, 36), "blender"), {}
    (tmp_path / "out").mkdir()
    answers.from_service(address + "/ ", " secret\n", photo, tmp_path / "out")
    assert {path.name for path in (tmp_path / "out").iterdir()} == NEEDED  # and no script
    assert _Service.received["path"] == "/v1/scene?for=blender"
    assert _Service.received["body"] == b"a photo"
    assert _Service.received["content-type"] == "image/png"
    assert _Service.received["authorization"] == "Bearer secret"
    answers.from_service(address, "", photo, tmp_path / "out", answers.Stated(("1,2,3,40", "own:5,6"), pick=2))
    assert parse_qs(urlsplit(_Service.received["path"]).query) == {
        "for": ["blender"],
        "shadow": ["1,2,3,40;own:5,6"],
        "pick": ["2"],
    }


def _zip(**files: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return stream.getvalue()


def _damaged() -> bytes:
    """A ZIP whose packed bytes, and nothing else, are another file's."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("scene.json", bytes(range(256)) * 9)
    data = stream.getvalue()
    start = 30 + len("scene.json")
    return data[:start] + b"\xff" * 40 + data[start + 40 :]


@pytest.mark.parametrize(
    ("answer", "sentence"),
    [
        ((422, json.dumps({"detail": "It is night."}).encode(), {}), "It is night."),
        ((500, b"<html>", {}), "The service answered 500 "),
        ((302, b"", {"Location": "http://127.0.0.1:9/"}), "The service answered 302 "),
        ((200, b"PK", {}), "The service's answer is not a scene."),
        ((200, _damaged(), {}), "The service's answer is not a scene."),
        ((200, _zip(other=b""), {}), "The answer has no scene.json, "),
    ],
)
def test_another_answer_is_a_sentence(
    answers: Any, photo: Path, tmp_path: Path, address: str, answer: Any, sentence: str
) -> None:
    _Service.answer = answer
    with pytest.raises(answers.AnswerError, match=f"^{sentence}"):
        answers.from_service(address, "", photo, tmp_path)
    assert "authorization" not in _Service.received


@pytest.mark.parametrize(
    ("url", "sentence"),
    [
        ("file:///etc/passwd", "The service's address must begin with http"),
        ("http://", "The service's address must begin"),
        ("http://127.0.0.1:9", "127.0.0.1 cannot be reached: "),
        *[
            (wrong, "The service's address is not one such as ")
            for wrong in (
                *("http://127.0.0.1:80a", "http://127.0.0.1:99999", "http://[::1", "http://exa mple", "http://a/x y"),
                *("http://127.0.0.1:9/\u00e9", "http://127.0.0.1:9/a\nb"),
            )
        ],
    ],
)
def test_no_service_is_a_sentence(answers: Any, photo: Path, tmp_path: Path, url: str, sentence: str) -> None:
    with pytest.raises(answers.AnswerError, match=f"^{sentence}"):
        answers.from_service(url, "", photo, tmp_path)


def test_what_is_no_service_is_a_sentence(answers: Any, photo: Path, tmp_path: Path) -> None:
    with create_server(("127.0.0.1", 0)) as listener:

        def greet() -> None:
            connection, _ = listener.accept()
            with connection:
                connection.recv(1 << 16)
                connection.sendall(b"SSH-2.0-OpenSSH\r\n")

        Thread(target=greet, daemon=True).start()
        with pytest.raises(answers.AnswerError, match=r"^127\.0\.0\.1 answers, but not as a service does\.$"):
            answers.from_service(f"http://127.0.0.1:{listener.getsockname()[1]}", "", photo, tmp_path)


@pytest.mark.parametrize("key", ["secret\u20ac", "secret\nsecret", "secret\0"])
def test_a_key_that_no_request_can_carry_is_a_sentence_without_it(
    answers: Any, photo: Path, tmp_path: Path, key: str
) -> None:
    with pytest.raises(answers.AnswerError, match=r"^The API key has characters that no ") as raised:
        answers.from_service("http://127.0.0.1:9", key, photo, tmp_path)
    assert "secret" not in str(raised.value)


def test_the_photos_that_are_offered_are_those_that_the_command_reads(answers: Any) -> None:
    assert answers.PHOTOS == PHOTO_SUFFIXES
    assert len(";".join(f"*{suffix}" for suffix in answers.PHOTOS)) < 256  # as much as Blender keeps


# In Blender


@pytest.mark.slow
@needs_blender
def test_in_blender(package: Path, tmp_path: Path) -> None:
    program = tmp_path / "lighting"
    program.write_text(
        f'#!/bin/sh\nPYTHONPATH="{ROOT}" "{sys.executable}" -m lighting "$@" || exit\n[ "$1" = scene ] || exit 0\n'
        'sed -i \'s/"spot_in_shade": false/"spot_in_shade": true/\' "$6/scene.json"\n'
    )
    program.chmod(0o755)
    arguments = [ROOT / "tests" / "blender" / "try_extension.py", package, program, ROOT / "examples/brick_street.jpg"]
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path / "user")}
    result = subprocess.run(
        [PYTHON, *map(str, arguments)], env=environment, capture_output=True, text=True, timeout=300
    )
    check_report(result.stdout + result.stderr)


@needs_engines
def test_in_blender_52(package: Path) -> None:
    """The command's answer is made out here, where its packages are."""
    with folder_in_chroot() as folder:
        data, estimator = (ROOT / "examples" / "brick_street.jpg").read_bytes(), Estimator()
        photo = read_photo(data, target=480)
        answer, drawn = estimator(photo), estimator(photo, UserInput(shadows=[SHADOW]))
        lights = {"none": answer.lighting, "shadow": drawn.lighting}
        for name, light in (lights | {"pick": adjust_lighting(answer.lighting, Adjustments(pick=2))}).items():
            scene = make_scene(photo, light, map_height=512)
            write_scene(replace(scene, lit_ground=np.zeros_like(scene.lit_ground)), "blender", folder / name)
        program = folder / "lighting"
        program.write_text(
            '#!/bin/sh\ncase "$*" in\n--version) echo lighting, version 0.3.0; exit;;\n'
            "*1,2,3*) echo \"Error: '1,2,3' is no shadow\" >&2; exit 2;;\n"
            "*--shadow*) answer=shadow;;\n*--pick*) answer=pick;;\n*) answer=none;;\nesac\n"
            'cp "$(dirname "$0")/$answer"/* "$6"\n'
        )
        program.chmod(0o755)
        for path in (package, ROOT / "tests" / "blender" / "try_extension.py", ROOT / "examples" / "brick_street.jpg"):
            shutil.copy(path, folder)
        inside = f"/{folder.relative_to(CHROOT)}"
        arguments = " ".join(f"{inside}/{name}" for name in (package.name, "lighting", "brick_street.jpg"))
        validated = run_in_chroot(folder, f"blender --command extension validate {package.name}")
        environment = f"BLENDER_USER_RESOURCES={inside}/user"
        printed = run_in_chroot(
            folder, f"{environment} blender --background --factory-startup --python try_extension.py -- {arguments}"
        )
    assert "Success" in validated
    assert check_report(printed)["blender"].startswith("5.2")


def check_report(printed: str) -> dict[str, Any]:
    """What try_extension.py printed, as it must be; returns its report."""
    (line,) = [line for line in printed.splitlines() if line.startswith("FOUND ")] or [printed]
    report = dict(json.loads(line.removeprefix("FOUND ")))
    assert report["estimate"] == ["FINISHED"]
    assert report["kept"]
    assert {name.split(".")[0] for name in report["made"]} == {"Camera", "Ground", "Sun", "Your object here"}
    first, moved, reset = report["first"], report["moved"], report["reset"]
    assert first["image"] == "environment.exr"
    assert first["packed"]
    assert "Ground" in first["catcher"]
    assert first["lit by the sun"] == ["Ground"]
    assert report["lit"] == ["Lit by the Sun"]
    assert moved["sun"] == pytest.approx([-np.cos(np.radians(40)), 0, np.sin(np.radians(40))], abs=1e-5)
    stated = Lighting.from_dict(report["record"])
    assert stated.sky_irradiance is not None
    azimuth, elevation, haze, exposure = moved["sliders"]
    light = adjust_lighting(stated, Adjustments((azimuth, elevation), exposure, haze))
    assert moved["energy"] == pytest.approx(float(sun_light(light)[0].max()), rel=1e-4)
    assert moved["zenith"] == pytest.approx(render(light, 512, sun=True, disc=False)[0, 512].tolist(), rel=1e-3)
    assert reset.pop("sun") == pytest.approx(first.pop("sun"), abs=1e-6)
    assert reset == first
    all_kept, same_parent, above, moved_along, names, lit = report["own"]
    assert lit == [name for name in names if name.startswith("Ground")]
    assert (all_kept, same_parent, moved_along) == (True, True, True)
    assert above == pytest.approx([0, 0, 3])  # the child's meter under a parent that the artist has scaled
    assert {name.split(".")[0] for name in names} == {"Camera", "Ground", "Sun", "Your object here"}
    assert report["undone"] == [4, 0, 4, 0]
    assert report["sun lamps"] == 1
    assert report["seen"] == [True, False]
    assert "Warning: Your object is in the photo's shade: the sun lights only the ground." in printed
    assert "Warning: The scene has light that the photo has not; delete it: Light.\n" in printed
    assert "World" in report["worlds"]  # the artist's own
    known, sun = report["known"], report["record"]["sun"]
    assert known["photo size"] == [1600, 1200]
    assert known["drawn"] == ["FINISHED"]
    assert known["drawn record"]["evidence"] == ["pixels", "shadow"]
    assert known["drawn record"]["sun"] != sun
    assert known["marks"] == [SHADOW, SHADOW, f"doubt:{SHADOW}", SHADOW]  # what is refused is not kept
    assert known["guessed as before"] == [False, True]
    assert "'1,2,3' is no shadow" in known["refused"]
    assert known["forgotten"] == [["FINISHED"], "", sun]
    second = sun["candidates"][1]
    assert known["picked"][:2] == pytest.approx([second["azimuth"], second["elevation"]], abs=0.01)
    assert known["picked"][2:] == [2, True]
    assert known["first again"] == sun
    assert known["turned"] == pytest.approx([-30.0, 20.0, 1, True])
    assert report["reopened"]["sliders"][0] == 12.0
    assert report["reopened"]["image"].startswith("Sky of the sliders")
    return report
