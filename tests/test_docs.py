"""README and docs/ lead somewhere: links, files, pictures, routes, extras; and every command has help."""

import re
import tomllib
from functools import cache
from pathlib import Path

import click
import pytest

import lighting
from server.app import create_app
from server.settings import Settings
from tests.helpers.pages import DOCS, README, ROOT, anchors, blocks, links, text
from tests.helpers.processes import list_commands

MOST_CHANGES = 1550  # words of a release in CHANGELOG.md
EVERY_PAGE = sorted(p for p in ROOT.glob("**/*.md") if not {".venv", "node_modules", "runs"} & set(p.parts))
COMMANDS = sorted(
    (f"{name} {part}".strip(), leaf)
    for name, command in list_commands().items()
    for part, leaf in (command.commands.items() if isinstance(command, click.Group) else [("", command)])
)


def named(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("command", [command for _, command in COMMANDS], ids=[name for name, _ in COMMANDS])
def test_every_command_and_option_has_help(command: click.Command) -> None:
    assert command.help
    assert all(option.help for option in command.params if isinstance(option, click.Option))


def test_readme_marks_what_the_check_runs() -> None:
    """`.ci/run` takes the blocks from README by these marks."""
    marks = re.findall(r"\breadme (\w+)\)", text(ROOT / ".ci" / "run"))
    assert set(marks) == {"try", "test", "uv"}
    (setup,), (tests,), (with_uv,) = (blocks(README, mark) for mark in ("try", "test", "uv"))
    for block, lines in ((setup, 1), (tests, 1), (with_uv, 2)):  # one line sets up and does it, with Python or with uv
        assert block.count("\n") == lines
    assert "lighting envmap examples/" in setup
    assert "lighting envmap examples/" in with_uv
    assert "pytest" in tests
    assert tests.partition("-m pytest")[2] == with_uv.partition("pytest")[2]
    assert len(re.findall(r"`git clone --depth 1 ADDRESS \w+ && cd \w+`", text(README))) == 1


@cache
def routes() -> set[str]:
    return set(create_app(Settings()).openapi()["paths"])


@pytest.mark.parametrize("page", [README, *DOCS], ids=named)
def test_every_route_that_a_page_names_is_there(page: Path) -> None:
    assert set(re.findall(r"/v1/[a-z-]+(?:/[a-z-]+)?", text(page))) <= routes()


@pytest.mark.parametrize("page", EVERY_PAGE, ids=named)
def test_links_lead_somewhere(page: Path) -> None:
    for link in links(page):
        target, _, fragment = link.partition("#")
        file = page.parent / target if target else page
        assert target.startswith("https://") or file.exists(), link
        assert not fragment or file.suffix != ".md" or fragment in anchors(file), link


def test_the_index_of_the_laboratory_leads_to_all_of_its_pages() -> None:
    index = ROOT / "docs" / "lab" / "README.md"
    assert {page.name for page in index.parent.glob("*.md")} <= {index.name, *links(index)}


@pytest.mark.parametrize("page", EVERY_PAGE, ids=named)
def test_files_that_a_page_names_are_there(page: Path) -> None:
    rooms = "|".join(path.name for path in ROOT.iterdir() if path.is_dir())
    for name in re.findall(rf"`((?:{rooms})/[\w./]+)`", page.read_text(encoding="utf-8")):
        assert (ROOT / name).exists(), name


def test_the_index_leads_to_every_page_and_readme_to_the_index() -> None:
    index = ROOT / "docs" / "README.md"
    pages = {page.relative_to(index.parent).as_posix() for page in DOCS if page != index}
    assert {page for page in pages if not page.startswith("reference/")} <= set(links(index))
    assert "docs/README.md" in links(README)


def test_one_page_for_users_leads_to_the_laboratory() -> None:
    pages = {named(page) for page in (README, *DOCS) if any("lab/" in link for link in links(page))}
    assert pages == {"docs/README.md"}


def test_the_extras_that_the_pages_name_exist() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert set(re.findall(r"\.\[(\w+)\]", text())) <= set(project["optional-dependencies"])


def test_the_public_face_is_small_and_there() -> None:
    assert len(lighting.__all__) <= 11
    assert all(getattr(lighting, name) is not None for name in lighting.__all__)
    with pytest.raises(AttributeError, match="nothing"):
        _ = lighting.nothing  # type: ignore[attr-defined]


def test_the_changes_name_the_version_of_the_package_and_are_short() -> None:
    _, *releases = re.split(r"^## ", text(ROOT / "CHANGELOG.md"), flags=re.MULTILINE)
    dated = [release for release in releases if not release.startswith("Unreleased")]
    assert dated[0].startswith(f"{lighting.__version__} (20")
    words = {release.partition("\n")[0]: len(release.split()) for release in releases}
    assert {heading: count for heading, count in words.items() if count > MOST_CHANGES} == {}, f"{MOST_CHANGES} at most"
