"""The pages of reference are what the code says."""

import re

import click
import pytest

import lighting
from lighting.cli import Command
from lighting.errors import ErrorCode, WarningCode
from lighting.scene import EXPORTERS
from scripts.markdown import link_terms
from scripts.reference import (
    FOLDER,
    PAGES,
    write_command_line,
    write_exceptions,
    write_page,
    write_problems,
    write_settings,
)
from scripts.reference_http import write_http
from scripts.reference_python import write_python
from server.app import create_app
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
    assert "| `--height ROWS` | 512 | Rows of the map, even; columns are twice that. |" in sections["lighting envmap"]
    assert "| `--lens-fov DEG` | 180 |" in sections["lighting probe merge"]
    assert "| `--port INTEGER RANGE` | 8000, or the next that is free |" in sections["lighting serve"]
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


def test_every_route_has_its_parameters_and_an_example_that_it_takes() -> None:
    document, sections = create_app(Settings()).openapi(), write_http().split("\n## ")[1:]
    told = dict(section.split("\n", 1) for section in sections)
    routes = {f"{method.upper()} {path}": route for path, m in document["paths"].items() for method, route in m.items()}
    assert list(told) == list(routes)
    for name, route in routes.items():
        parameters = {parameter["name"]: parameter for parameter in route.get("parameters", [])}
        assert all(f"\n| `{parameter}` | " in told[name] for parameter in parameters)
        (example,) = re.findall(r"^curl .*$", told[name], re.MULTILINE)
        assert f"http://127.0.0.1:8000{name.split()[1].split('{')[0]}" in example
        given = {*re.findall(r"-F (\w+)=", example), *re.findall(r"[?&](\w+)=", example)}
        assert given - {"photo", "file"} <= set(parameters)
        needed = {n for n, parameter in parameters.items() if parameter["required"] and parameter["in"] == "query"}
        assert needed <= given
    assert "| `height` | `512` | 16 to 2048 | rows of the map, even; columns are twice that |" in told["GET /v1/envmap"]


def test_every_public_name_has_its_parameters_and_errors() -> None:
    page = write_python()
    for name in set(lighting.__all__) - {"__version__"}:
        assert f"\n## lighting.{name}\n" in page
    replace = page.partition("### Estimate.replace")[2].partition("### ")[0]
    assert "| `exposure` | `0.0` | `float` | EV, -20 to 20, of map and photo: +1 is twice as bright. |" in replace
    assert "| `ParameterError` | a value is out of range. |" in replace
    assert "estimator(photo, user_input=UserInput())" in page


def test_a_generated_page_links_the_first_use_of_a_term() -> None:
    page = "# Roll\n\n`roll` of a camera; [its roll](x.md).\n\n```sh\nroll\n```\nThe roll, and a roll.\n"
    assert link_terms(page, "words.md") == page.replace("`roll`", "[`roll`](words.md#roll)")
    assert "\nThe [roll](words.md#roll), and a roll." in link_terms(page.replace("`roll`", "That"), "words.md")
