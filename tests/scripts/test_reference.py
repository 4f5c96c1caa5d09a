"""The pages of reference are what the code says."""

import click
import pytest

from lighting.cli.commands import Command
from lighting.errors import ErrorCode
from lighting.records import WarningCode
from lighting.scene import EXPORTERS
from scripts.reference import (
    FOLDER,
    PAGES,
    write_command_line,
    write_exceptions,
    write_page,
    write_problems,
    write_settings,
)
from server.problems import KINDS
from server.settings import PREFIX, Settings
from tests.helpers.processes import list_commands


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_what_the_code_says(name: str) -> None:
    """Where this fails, run `python -m scripts.reference`."""
    assert (FOLDER / name).read_text(encoding="utf-8") == write_page(name)


def test_no_other_page_is_there() -> None:
    assert {page.name for page in FOLDER.iterdir()} == set(PAGES)


def test_every_command_has_its_options_defaults_and_examples() -> None:
    sections = dict(section.split("\n", 1) for section in write_command_line().split("\n## ")[1:])
    for name, command in list_commands().items():
        for part, leaf in command.commands.items() if isinstance(command, click.Group) else [("", command)]:
            assert isinstance(leaf, Command)
            section = sections[f"lighting {name} {part}".strip()]
            shown = [p for p in leaf.params if isinstance(p, click.Option) and not p.hidden]
            assert all(f"`{name}" in section for p in shown for name in (*p.opts, *p.secondary_opts))
            assert all(line in section.splitlines() for line in leaf.examples)
    assert "| `--height INTEGER` | 512 | Rows of the map; columns are twice that. |" in sections["lighting envmap"]
    assert "| `--lens-fov DEG` | 180 |" in sections["lighting probe merge"]
    assert (
        "| `--port INTEGER RANGE` | 8000 | Port to listen on; 0 picks a free one. [0<=x<=65535] |"
        in sections["lighting serve"]
    )
    assert "`--no-exif` is `--no-metadata`" in sections["lighting envmap"]
    assert all(rf"\|{tool}" in sections["lighting scene"] for tool in [*EXPORTERS][1:])


def test_every_setting_has_its_default_and_range() -> None:
    page = write_settings()
    assert all(f"| `{PREFIX}{name.upper()}` | " in page for name in Settings.model_fields)
    assert f"| `{PREFIX}PORT` | `8000` | at least 0, at most 65535 | port to listen on" in page
    assert f"| `{PREFIX}UPLOAD_SECONDS` | `60.0` | over 0, at most 86400 |" in page


def test_every_problem_has_its_title_and_meaning() -> None:
    page = write_problems()
    assert all(kind.meaning for kind in KINDS)
    assert all(f"| {kind.status} | `{kind.name}` | {kind.title} | {kind.meaning} |" in page for kind in KINDS)


def test_every_code_has_its_meaning() -> None:
    page = write_exceptions()
    for code in (*ErrorCode, *WarningCode):
        assert f"\n| `{code}` | " in page
    assert (
        "| `PhotoTooLargeError` | `PhotoError` | `too-large` | The photo exceeds the limit on bytes or pixels. |"
        in page
    )
