"""The image's recipe: what it promises, what goes to its builder, and the reader that checks it."""

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from scripts.dockerfile import Stage, UnsupportedError, context_files, expand, passes, read_rules, read_stages

ROOT = Path(__file__).parents[2]
STAGES = read_stages((ROOT / "Dockerfile").read_text(encoding="utf-8"))
LOCKS = ("requirements.lock", "requirements-turns.lock")
LOCK = "".join((ROOT / name).read_text(encoding="utf-8") for name in LOCKS)
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def value(word: str, stage: Stage = STAGES[-1]) -> str:
    step = stage.last(word)
    assert step
    return step.value


def test_every_base_is_one_version_by_its_digest() -> None:
    for stage in STAGES:
        assert re.fullmatch(
            r"(node|python):\d+\.\d+\.\d+-(bookworm-slim|slim-bookworm)@sha256:[0-9a-f]{64}", stage.base
        )


def test_the_run_stage_copies_one_folder_and_runs_nothing() -> None:
    words = [step.word for step in STAGES[-1].steps]
    assert words.count("COPY") == 1
    assert "RUN" not in words
    assert value("COPY") == "/opt/venv /opt/venv"


def test_it_has_a_user_of_its_own_and_starts_no_shell() -> None:
    uid, gid = value("USER").split(":")
    assert int(uid) >= 1000
    assert int(gid) >= 1000
    assert value("ENTRYPOINT") == '["/usr/bin/env"]'
    assert value("CMD") == '["lighting-server"]'
    assert value("HEALTHCHECK").startswith('CMD ["python", "-c", ')
    assert "/livez" in value("HEALTHCHECK")


def test_its_label_names_its_base() -> None:
    step = STAGES[-1].last("LABEL")
    assert step
    name = step.pairs["org.opencontainers.image.base.name"]
    assert name == "docker.io/library/" + STAGES[-1].base.split("@")[0]
    assert step.pairs["org.opencontainers.image.licenses"] == PROJECT["license"]


def test_hadolint_finds_nothing() -> None:
    program = shutil.which("hadolint", path=str(Path(sys.executable).parent)) or shutil.which("hadolint")
    if not program:
        pytest.skip("hadolint is not installed")
    done = subprocess.run([program, str(ROOT / "Dockerfile")], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (0, "")


@pytest.mark.parametrize("extra", ["", "server", "heif", "turns"])
def test_the_lock_file_holds_what_the_project_asks_for(extra: str) -> None:
    """Its first lines say how it is renewed."""
    locked = dict(re.findall(r"^([a-z0-9-]+)==(\S+) \\$", LOCK, re.MULTILINE))
    wanted = PROJECT["optional-dependencies"][extra] if extra else PROJECT["dependencies"]
    for requirement in map(Requirement, wanted):
        name = re.sub(r"[-_.]+", "-", requirement.name).lower()
        assert requirement.specifier.contains(locked[name]), name


def test_every_locked_requirement_has_its_hashes() -> None:
    blocks = re.split(r"^(?=[a-z])", LOCK, flags=re.MULTILINE)[1:]
    assert len(blocks) > 20
    assert all("--hash=sha256:" in block for block in blocks)


def test_the_builder_gets_what_it_needs_and_nothing_else() -> None:
    files = set(map(str, context_files(ROOT)))
    assert {"pyproject.toml", *LOCKS, "lighting/data/SHA256SUMS", "server/web/package-lock.json"} <= files
    assert {name.split("/")[0] for name in files} == {
        *("LICENSE", "NOTICE", "README.md", "pyproject.toml", *LOCKS, "examples", "lighting", "server")
    }
    assert not [name for name in files if "node_modules" in name or "__pycache__" in name or "web/dist" in name]


@pytest.mark.parametrize(
    ("path", "let_through"),
    [("a/b.py", True), ("a/__pycache__/b.pyc", False), ("a/c/__pycache__", False), ("b/a", False), ("a/d/x", False)],
)
def test_the_last_rule_of_dockerignore_wins(path: str, let_through: bool) -> None:
    assert passes(Path(path), read_rules("# words\n*\n!a\n\n**/__pycache__\na/d\n")) is let_through


def test_a_dockerfile_is_read_as_docker_reads_it() -> None:
    one = "FROM x:1 AS one\n# words\nRUN a \\\n  # inside\n    b\n"
    text = one + 'FROM y\nCOPY --from=one --link=true /a /b\nENV A=1 B="2 3"\n'
    first, second = read_stages(text)
    assert (first.name, first.base, first.steps[0].value, first.steps[0].line) == ("one", "x:1", "a b", 3)
    assert second.steps[0].flags == {"from": "one", "link": "true"}
    assert second.steps[1].pairs == {"A": "1", "B": "2 3"}
    assert expand("$A/${B}/$C", {"A": "1", "B": "2"}) == "1/2/"


@pytest.mark.parametrize("text", ["FROM x\nADD a b\n", "RUN a\n", "FROM x\nRUN <<END\n", "FROM x\nONBUILD RUN a\n"])
def test_what_the_reader_does_not_know_it_refuses(text: str) -> None:
    with pytest.raises(UnsupportedError, match="Line"):
        read_stages(text)


def test_a_shell_form_is_not_an_exec_form() -> None:
    (stage,) = read_stages("FROM x\nCMD lighting-server\n")
    with pytest.raises(UnsupportedError, match="exec form"):
        stage.steps[0].argv  # noqa: B018


def test_rules_below_the_root_are_refused() -> None:
    with pytest.raises(UnsupportedError, match="root"):
        read_rules("*\n!a/b\n")
