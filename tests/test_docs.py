"""README and docs/ say what the code does: commands, options, names, ranges, links; and their examples run."""

import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import click
import pytest

import lighting
from lighting.cli import cli
from lighting.files import MAP_FORMATS
from lighting.fusion.metadata_prior import DECLINATION_STD, USER_HEADING_STD
from lighting.fusion.single_view import COMPASS_OUTLIER_RATE, COMPASS_STD
from lighting.sky import SKY_MODELS
from lighting.validation import OPTIONAL_RANGES, RANGES
from server.app import create_app
from server.settings import Settings
from tests.helpers.pages import DOCS, README, ROOT, anchors, blocks, links, text
from tests.helpers.processes import list_commands

MOST_LINES = 170  # of README: more than that is not read
EVERY_PAGE = sorted(p for p in ROOT.glob("**/*.md") if not {".venv", "node_modules", "runs"} & set(p.parts))
COMMANDS = sorted(
    (f"{name} {part}".strip(), leaf)
    for name, command in list_commands().items()
    for part, leaf in (command.commands.items() if isinstance(command, click.Group) else [("", command)])
)
COMMAND_LINES = [line for page in DOCS for block in blocks(page, "command line") for line in block.splitlines()]
REQUESTS = [line for page in (README, *DOCS) for block in blocks(page, "http") for line in block.splitlines()]


def named(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def test_readme_is_short() -> None:
    assert len(text(README).splitlines()) <= MOST_LINES


@pytest.mark.parametrize("command", [command for _, command in COMMANDS], ids=[name for name, _ in COMMANDS])
def test_every_command_and_option_has_help(command: click.Command) -> None:
    assert command.help
    assert all(option.help for option in command.params if isinstance(option, click.Option))


def test_the_names_of_registries_are_documented() -> None:
    """Models and formats in the order of their registries; of advanced models the first and the last."""
    advanced = [name for name, model in SKY_MODELS.items() if model.advanced]
    models = [name for name in SKY_MODELS if name not in advanced[1:-1]]
    light, service = (text(ROOT / "docs" / f"{name}.md") for name in ("light", "service"))
    assert [name for name in re.findall(r"`([\w-]+)`", light) if name in models][-len(models) :] == models
    first, *others, last = (f"`{name}`" for name in MAP_FORMATS)
    assert f"`format={first[1:]}, {', '.join(others)} or {last}" in service


def test_every_parameter_is_in_the_table_with_its_range() -> None:
    lines = text(README).splitlines()
    rows = {name: row for row in lines if row.startswith("| `") for name in re.findall(r"`(\w+)`", row)}
    assert set(RANGES) | set(OPTIONAL_RANGES) <= set(rows)
    for name in ("sun_azimuth", "sun_elevation", "sun_visibility", "turbidity", "ground_albedo"):
        low, high = RANGES[name]
        assert f"{low:g} to {high:g}" in rows[name]


def test_readme_marks_what_the_check_runs() -> None:
    """`.ci/run` takes the blocks from README by these marks."""
    marks = re.findall(r"readme (\w+)$", text(ROOT / ".ci" / "run"), re.MULTILINE)
    assert set(marks) == {"try", "test"}
    (setup,), (tests,) = (blocks(README, mark) for mark in ("try", "test"))
    assert "lighting envmap examples/" in setup
    assert "pytest" in tests


@pytest.fixture
def clone(tmp_path: Path) -> tuple[Path, dict[str, str]]:
    """A folder with the examples, and an environment in which `lighting` is this checkout's program."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    program = tmp_path / "bin" / "lighting"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m lighting "$@"\n', encoding="utf-8")
    program.chmod(0o755)
    path = os.pathsep.join([str(program.parent), os.environ["PATH"]])
    return tmp_path, {**os.environ, "PATH": path, "PYTHONPATH": str(ROOT)}


@pytest.mark.slow
def test_the_commands_of_readme_run_one_after_the_other(clone: tuple[Path, dict[str, str]]) -> None:
    folder, environment = clone
    (block,) = blocks(README, "command line")
    done = subprocess.run(
        ["sh", "-eu", "-c", block], cwd=folder, env=environment, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("line", COMMAND_LINES)
def test_the_commands_of_the_pages_are_right_usage(
    line: str, clone: tuple[Path, dict[str, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Parsed only: to run them all would take a minute."""
    monkeypatch.chdir(clone[0])
    program, name, *arguments = shlex.split(line, comments=True)
    assert program == "lighting"
    with click.Context(cli, info_name="lighting", help_option_names=["-h", "--help"]) as parent:
        list_commands()[name].make_context(name, arguments, parent=parent)
    photos = [argument for argument in arguments if argument.startswith("examples/")]
    assert all(list(Path().glob(photo)) for photo in photos)


@pytest.mark.slow
@pytest.mark.parametrize("page", [README, ROOT / "docs" / "python.md"], ids=named)
def test_the_python_of_the_pages_writes_the_map_of_the_command(page: Path, clone: tuple[Path, dict[str, str]]) -> None:
    folder, environment = clone
    code = "\n".join(blocks(page, "python"))
    options: Any = {"cwd": folder, "env": environment, "capture_output": True, "text": True, "timeout": 120}
    done = subprocess.run([sys.executable, "-c", code], check=False, **options)
    assert done.returncode == 0, done.stderr
    command = ["lighting", "envmap", "examples/wide_street.jpg", "-o", "command.exr"]
    assert subprocess.run(command, check=False, **options).returncode == 0
    assert (folder / "sky.exr").read_bytes() == (folder / "command.exr").read_bytes()
    assert (folder / "evening.exr").read_bytes() != (folder / "sky.exr").read_bytes()
    assert (folder / "street").is_dir()


@pytest.mark.parametrize("line", REQUESTS)
def test_every_request_is_to_a_route_with_parameters_that_it_has(line: str) -> None:
    """That they are answered is tested in tests/server/test___main__.py."""
    found = re.search(r"http://127\.0\.0\.1:8000(\S*?)'?(?: |$)", line)
    assert found
    url = urlsplit(found[1])
    method = "post" if re.search(r" (-F|-d|--data-binary) ", line) else "get"
    route = create_app(Settings()).openapi()["paths"][url.path][method]
    assert set(parse_qs(url.query)) <= {parameter["name"] for parameter in route.get("parameters", [])}


@pytest.mark.parametrize("page", [README, *DOCS], ids=named)
def test_every_route_that_a_page_names_is_there(page: Path) -> None:
    missing = {"/v1/video"}  # whose absence docs/video.md explains
    assert set(re.findall(r"/v1/[a-z-]+(?:/[a-z]+)?", text(page))) - missing <= set(
        create_app(Settings()).openapi()["paths"]
    )


def test_examples_read_files_that_exist_or_that_an_earlier_line_wrote() -> None:
    for page in (README, *DOCS):
        written: set[str] = set()
        for line in (line for block in blocks(page, "http") for line in block.splitlines()):
            read = {name.rstrip("'") for name in re.findall(r"@(\S+)", line)}
            assert all((ROOT / name).is_file() or name in written for name in read), line
            written |= set(re.findall(r" -o (\S+)", line))


@pytest.mark.parametrize("page", EVERY_PAGE, ids=named)
def test_links_lead_somewhere(page: Path) -> None:
    for link in links(page):
        target, _, fragment = link.partition("#")
        file = page.parent / target if target else page
        assert target.startswith("https://") or file.exists(), link
        assert not fragment or file.suffix != ".md" or fragment in anchors(file), link


@pytest.mark.parametrize("page", EVERY_PAGE, ids=named)
def test_files_that_a_page_names_are_there(page: Path) -> None:
    rooms = "|".join(path.name for path in ROOT.iterdir() if path.is_dir())
    for name in re.findall(rf"`((?:{rooms})/[\w./]+)`", page.read_text(encoding="utf-8")):
        assert (ROOT / name).exists(), name


def test_the_index_leads_to_every_page_and_readme_to_the_index() -> None:
    index = ROOT / "docs" / "README.md"
    assert {page.relative_to(index.parent).as_posix() for page in DOCS if page != index} <= set(links(index))
    assert "docs/README.md" in links(README)


def test_the_extras_that_the_pages_name_exist() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert set(re.findall(r"\.\[(\w+)\]", text())) <= set(project["optional-dependencies"])


def test_the_public_face_is_small_and_there() -> None:
    assert len(lighting.__all__) <= 10
    assert all(getattr(lighting, name) is not None for name in lighting.__all__)
    with pytest.raises(AttributeError, match="nothing"):
        _ = lighting.nothing  # type: ignore[attr-defined]


def test_the_page_on_metadata_states_the_compass_as_the_code_does() -> None:
    page = text(ROOT / "docs" / "metadata.md")
    assert f"right to {COMPASS_STD:g}° (one standard deviation)" in page
    assert f"to {USER_HEADING_STD:g}°. A magnetic" in page
    assert f"is unknown, {DECLINATION_STD:g}° (its root" in page
    assert COMPASS_OUTLIER_RATE == 0.1
    assert "one in ten worth nothing" in page


def test_the_changes_name_the_version_of_the_package() -> None:
    (newest, *_) = re.findall(r"^## Package (\S+)", text(ROOT / "CHANGELOG.md"), re.MULTILINE)
    assert newest == lighting.__version__
