"""The image's recipe, as text: what it promises, and what its lock files hold."""

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]
STAGES = re.split(r"^(?=FROM )", (ROOT / "Dockerfile").read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
LAST = re.findall(r"^([A-Z]+) ((?:.*\\\n)*.*)$", STAGES[-1], re.MULTILINE)  # word and value of every step
LOCKS = ("requirements.lock", "requirements-turns.lock", "requirements-traces.lock")
LOCK = "".join((ROOT / name).read_text(encoding="utf-8") for name in LOCKS)
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
    program = shutil.which("hadolint", path=str(Path(sys.executable).parent)) or shutil.which("hadolint")
    if not program:
        pytest.skip("hadolint is not installed")
    result = subprocess.run([program, str(ROOT / "Dockerfile")], capture_output=True, text=True, timeout=60)
    assert (result.returncode, result.stdout) == (0, "")


@pytest.mark.parametrize("extra", ["", "turns", "traces"])
def test_the_lock_file_holds_what_the_project_asks_for(extra: str) -> None:
    """Its first lines say how it is renewed."""
    locked = dict(re.findall(r"^([a-z0-9-]+)==(\S+) \\$", LOCK, re.MULTILINE))
    requirements = PROJECT["optional-dependencies"][extra] if extra else PROJECT["dependencies"]
    for requirement in map(Requirement, requirements):
        name = re.sub(r"[-_.]+", "-", requirement.name).lower()
        assert requirement.specifier.contains(locked[name]), name


def test_every_locked_requirement_has_its_hashes() -> None:
    blocks = re.split(r"^(?=[a-z])", LOCK, flags=re.MULTILINE)[1:]
    assert len(blocks) > 20
    assert all("--hash=sha256:" in block for block in blocks)
