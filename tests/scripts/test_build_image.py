"""How the image is built, as far as it needs neither root nor an engine."""

import os
import sys
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
        enter_mount_namespace()
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    monkeypatch.setattr("shutil.which", lambda _: None)
    with pytest.raises(UnavailableError, match=r"^there is no buildah and no mmdebstrap$"):
        enter_mount_namespace()
    monkeypatch.setattr("shutil.which", lambda name: f"/bin/{name}")
    monkeypatch.setattr(build_image, "unshare", lambda _: (_ for _ in ()).throw(PermissionError(1, "unshare")))
    with pytest.raises(UnavailableError, match=r"^it needs mount namespaces$"):
        enter_mount_namespace()

    def fail(*_: object) -> str:
        raise RuntimeError("mmdebstrap ended with 1:\nI: chroot\nE: no mount\nE: mmdebstrap failed to run")

    monkeypatch.setattr(build_image, "_run", fail)
    with pytest.raises(UnavailableError, match=r"^mmdebstrap ended with 1: E: no mount$"):
        load_base(Engine(tmp_path), tmp_path)
