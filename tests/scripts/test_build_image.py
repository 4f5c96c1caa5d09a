"""How the image is built, as far as it needs neither root nor an engine."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from scripts import build_image
from scripts.build_image import (
    Engine,
    UnavailableError,
    _pip_settings,
    _run,
    enter_mount_namespace,
    load_base,
    network_environment,
    replace_bases,
    shared_files,
)
from scripts.check_image import _resident, check_layer, main
from scripts.image_process import BrokenPromiseError, Image, _children, expect, healthy
from tests.helpers.requirements import require

DOCKERFILE = "FROM python:3.11@sha256:0a AS page\nRUN a\nFROM python:3.11 AS venv\nFROM python:3.11\nCMD b\n"


def test_only_stages_that_build_get_the_variables() -> None:
    built = "FROM localhost/base AS page{0}\nRUN a\nFROM localhost/base AS venv{0}\nFROM localhost/base\nCMD b\n"
    assert replace_bases(DOCKERFILE, {}) == built.format("")
    assert replace_bases(DOCKERFILE, {"A": 'x "$y"'}) == built.format('\nENV A="x \\"\\$y\\""')


def test_the_environment_of_pip_wins_over_its_files() -> None:
    listed = ":env:.cert='/a'\nglobal.cert='/b'\nglobal.index-url='https://c'\ninstall.proxy='d'\nsearch.index='e'\n"
    assert _pip_settings(listed) == {"cert": "/a", "index-url": "https://c", "proxy": "d"}


@pytest.fixture
def configured(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine on which pip says what the test wants them to."""
    for name in build_image._OF_ENVIRONMENT:
        monkeypatch.delenv(name, raising=False)
    pip = "global.index-url='https://p'\nglobal.extra-index-url='file:///p'\nglobal.quiet='1'"
    monkeypatch.setattr(build_image, "_run", lambda _: pip)


@pytest.mark.usefixtures("configured")
def test_what_pip_needs_goes_along(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SSL_CERT_FILE", "/c.pem")
    assert network_environment() == {"PIP_INDEX_URL": "https://p", "SSL_CERT_FILE": "/c.pem"}


def test_files_that_variables_name_are_shown_to_the_stages(tmp_path: Path) -> None:
    (tmp_path / "c.pem").touch()
    named = {"A": f"{tmp_path}/c.pem", "B": f"{tmp_path}/c.pem", "C": f"{tmp_path}/none", "D": "https://e"}
    assert shared_files(named) == [f"--volume={tmp_path}/c.pem:{tmp_path}/c.pem:ro"]


def test_a_failed_program_is_named_with_its_last_lines() -> None:
    assert _run([sys.executable, "-c", "print(input())"], "words") == "words\n"
    with pytest.raises(RuntimeError, match=r"ended with 3:\n9\n(\d+\n)*38$"):
        _run([sys.executable, "-c", "[print(i) for i in range(39)]; raise SystemExit(3)"])


def test_the_engine_keeps_to_its_storage() -> None:
    argv = Engine(Path("/s")).argv("images")
    assert argv == ["buildah", "--root", "/s/root", "--runroot", "/s/run", "--storage-driver", "vfs", "images"]


def test_a_machine_that_cannot_build_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    with pytest.raises(UnavailableError, match=r"^it needs root$"):
        enter_mount_namespace("buildah", "mmdebstrap")
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    monkeypatch.setattr("shutil.which", lambda _: None)
    with pytest.raises(UnavailableError, match=r"^there is no buildah and no mmdebstrap$"):
        enter_mount_namespace("buildah", "mmdebstrap")
    monkeypatch.setattr("shutil.which", lambda name: f"/bin/{name}")
    monkeypatch.setattr(build_image, "unshare", lambda _: (_ for _ in ()).throw(PermissionError(1, "unshare")))
    with pytest.raises(UnavailableError, match=r"^it needs mount namespaces$"):
        enter_mount_namespace("buildah", "mmdebstrap")

    def fail(*_: object) -> str:
        raise RuntimeError("mmdebstrap ended with 1:\nI: chroot\nE: no mount\nE: mmdebstrap failed to run")

    monkeypatch.setattr(build_image, "_run", fail)
    with pytest.raises(UnavailableError, match=r"^mmdebstrap ended with 1: E: no mount$"):
        load_base(Engine(tmp_path), tmp_path)


ROOT = Path(__file__).parents[2]
STAGES = re.split(r"^(?=FROM )", (ROOT / "Dockerfile").read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
LAST = re.findall(r"^([A-Z]+) ((?:.*\\\n)*.*)$", STAGES[-1], re.MULTILINE)  # word and value of every step
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_every_base_is_one_version_by_its_digest() -> None:
    base = r"FROM python:\d+\.\d+\.\d+-slim-bookworm@sha256:[0-9a-f]{64}( AS [a-z]+)?\n"
    assert len(STAGES) == 2
    assert all(re.match(base, stage) for stage in STAGES)


def test_the_run_stage_copies_one_folder_and_runs_nothing() -> None:
    assert [value for word, value in LAST if word in ("COPY", "ADD", "RUN")] == ["--from=venv /opt/venv /opt/venv"]


def test_it_has_a_user_of_its_own_and_starts_no_shell() -> None:
    steps = dict(LAST)
    assert all(int(identity) >= 1000 for identity in steps["USER"].split(":"))
    assert steps["ENTRYPOINT"] == '["/usr/bin/env"]'
    assert steps["CMD"] == '["lighting-server"]'
    assert re.search(r' CMD \["python", "-c", .*/livez', steps["HEALTHCHECK"])


def test_its_label_names_its_base() -> None:
    labels = dict(re.findall(r'org\.opencontainers\.image\.([a-z.]+)="([^"]*)"', dict(LAST)["LABEL"]))
    assert labels["base.name"] == "docker.io/library/" + dict(LAST)["FROM"].split("@")[0]
    assert labels["licenses"] == PROJECT["license"]


def test_hadolint_finds_nothing() -> None:
    result = subprocess.run([require("hadolint"), str(ROOT / "Dockerfile")], capture_output=True, text=True, timeout=60)
    assert (result.returncode, result.stdout) == (0, "")


@pytest.fixture
def base(tmp_path: Path) -> Path:
    (tmp_path / "base" / "usr").mkdir(parents=True)
    (tmp_path / "base" / "usr" / "gcc").write_bytes(bytes(1_000_000))
    return tmp_path / "base"


@pytest.fixture
def files(base: Path) -> Path:
    root = base.parent / "image"
    package = root / "opt/venv/lib/python3.11/site-packages/numpy"
    package.mkdir(parents=True)
    (package / "core.so").write_bytes(bytes(3_000_000))
    (root / "usr").mkdir()
    (root / "usr" / "gcc").write_bytes(bytes(1_000_000))
    return root


def test_a_small_layer_keeps_every_promise(base: Path, files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    check_layer(base, files)
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == ["   4 MB with its base; numpy 3 MB", "ok: the image is 3 MB over its base, under 350"]
    assert [line.startswith("ok: ") for line in lines[1:]] == [True] * 3


@pytest.mark.parametrize(
    ("file", "promise"), [("opt/venv/bin/gcc", "no compiler"), ("home/notes.txt", "nothing in it but /opt/venv")]
)
def test_what_does_not_belong_in_the_layer_is_named(base: Path, files: Path, file: str, promise: str) -> None:
    (files / file).parent.mkdir(parents=True, exist_ok=True)
    (files / file).write_text("#")
    with pytest.raises(BrokenPromiseError, match=f"^not kept: {promise}"):
        check_layer(base, files)


def test_a_broken_promise_ends_the_check() -> None:
    expect(True, "all is well")
    with pytest.raises(BrokenPromiseError, match="not kept: all is well"):
        expect(False, "all is well")


def test_a_command_runs_as_the_images_user_without_capabilities() -> None:
    image = Image(Path("/view"), ["A=1", "LIGHTING_PORT=80"], "/work", "7:8", ["env", "serve"], ["true"])
    command = image.command(["lighting"])
    assert command[:3] == ["chroot", "/view", "setpriv"]
    assert {"--reuid=7", "--regid=8", "--clear-groups", "--no-new-privs", "--bounding-set=-all"} <= set(command)
    assert command[-7:] == ["env", "-i", "-C", "/work", "A=1", "LIGHTING_PORT=80", "lighting"]
    assert image.port == 80


def test_health_is_the_status_of_the_probe() -> None:
    assert healthy([sys.executable, "-c", ""])
    assert not healthy([sys.executable, "-c", "raise SystemExit(1)"])


def test_a_machine_that_cannot_build_skips_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.setattr(sys, "argv", ["check_image", str(tmp_path / "cache")])
    monkeypatch.setattr("tempfile.mkdtemp", lambda: str(tmp_path / "space"))
    (tmp_path / "space").mkdir()
    main()
    assert capsys.readouterr().out == "skipped: no image can be built here: it needs root\n"
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads Linux's /proc")
def test_processes_are_read_from_proc() -> None:
    assert _resident(os.getpid()) > 1_000_000
    assert _children(2**22 + 1) == []
