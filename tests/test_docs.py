"""README says what the code does: commands, names, ranges, links; and its Python runs."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import click
import pytest

import lighting
from lighting.cli import cli
from lighting.evidence.declination import TYPICAL_DECLINATION
from lighting.evidence.fusion import COMPASS_SPREAD, GROSS_ERRORS
from lighting.evidence.metadata import GIVEN_HEADING_SPREAD
from lighting.records import OPTIONAL_RANGES, RANGES

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = sorted(p for p in ROOT.glob("**/*.md") if not {".venv", "node_modules", "runs"} & set(p.parts))


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


def test_every_command_is_in_readme_and_has_help() -> None:
    for name, command in cli.commands.items():
        assert f"lighting {name} " in README, name
        assert command.help, name
        assert all(option.help for option in command.params if isinstance(option, click.Option)), name


def test_every_parameter_is_in_the_table_with_its_range() -> None:
    rows = {name: row for row in README.splitlines() if row.startswith("| `") for name in re.findall(r"`(\w+)`", row)}
    assert set(RANGES) | set(OPTIONAL_RANGES) <= set(rows)
    for name in ("sun_azimuth", "sun_elevation", "sun_visibility", "turbidity", "ground_albedo"):
        low, high = RANGES[name]
        assert f"{low:g} to {high:g}" in rows[name]


def test_there_are_two_commands_to_begin_with() -> None:
    """`.ci/run` takes them from here."""
    setup, tests = blocks("sh")
    assert "lighting envmap examples/" in setup
    assert "pytest" in tests


def test_the_python_of_readme_runs(tmp_path: Path) -> None:
    (code,) = blocks("python")
    code = code.replace('"examples/', f'r"{ROOT}/examples/')
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("sun ")
    assert lighting.read_exr(tmp_path / "sky.exr")[0].shape == (512, 1024, 3)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8")):
        assert target.startswith("https://") or (page.parent / target).exists(), target


def test_the_extras_that_readme_names_exist() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert set(re.findall(r"\.\[(\w+)\]", README)) <= set(project["optional-dependencies"])


def test_the_public_face_is_small_and_there() -> None:
    assert len(lighting.__all__) < 10
    assert all(getattr(lighting, name) is not None for name in lighting.__all__)
    with pytest.raises(AttributeError, match="nothing"):
        lighting.nothing  # noqa: B018


def test_the_page_on_metadata_states_the_compass_as_the_code_does() -> None:
    page = (ROOT / "docs" / "metadata.md").read_text(encoding="utf-8")
    assert f"right to {COMPASS_SPREAD:g}° (one standard deviation)" in page
    assert f"to {GIVEN_HEADING_SPREAD:g}°. A magnetic" in page
    assert f"is unknown, {TYPICAL_DECLINATION:g}° (the root" in page
    assert GROSS_ERRORS == 0.1
    assert "one in ten worth nothing" in page
