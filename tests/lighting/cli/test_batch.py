"""`lighting batch`: wrong usage, help, imports."""

import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from lighting.cli import cli
from tests.helpers.processes import run_batch


@pytest.mark.parametrize(
    "options", [["--height", 64], ["--yaw", 0], ["--surroundings"], ["--no-detail"], ["--address", "auto"]]
)
def test_options_that_would_do_nothing_are_refused(tmp_path: Path, options: list[object]) -> None:
    result = run_batch(tmp_path, tmp_path / "out", *options)
    assert result.exit_code == 2
    assert "need" in result.stderr
    assert not (tmp_path / "out").exists()


def test_results_in_a_file_are_refused(photo_path: Path) -> None:
    result = run_batch(photo_path.parent, photo_path)
    assert (result.exit_code, result.stdout) == (1, "")
    assert result.stderr == f"Error: {photo_path} is a file; the results need a folder.\n"


@pytest.mark.parametrize("option", ["--parquet", "--overwrite"])
@pytest.mark.needs("pyarrow")
def test_a_folder_in_place_of_the_table_is_refused_first(photo_path: Path, tmp_path: Path, option: str) -> None:
    out = tmp_path / "out"
    (out / "lighting.parquet").mkdir(parents=True)
    result = run_batch(photo_path, out, option)
    assert (result.exit_code, result.stdout) == (1, "")
    assert result.stderr == (
        f"Error: {out}/lighting.parquet is a folder, as --engine ray writes it; choose another one for the results.\n"
    )
    assert [path.name for path in out.iterdir()] == ["lighting.parquet"]


@pytest.mark.needs("pyarrow")
def test_a_table_in_a_folder_that_does_not_exist_is_refused_first(photo_path: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "lighting.parquet").symlink_to(tmp_path / "none" / "table.parquet")
    result = run_batch(photo_path, out, "--parquet")
    assert (result.exit_code, result.stdout) == (1, "")
    assert result.stderr == (
        f"Error: {out}/lighting.parquet is a link to a file in {tmp_path}/none, which is no folder.\n"
    )
    assert [path.name for path in out.iterdir()] == ["lighting.parquet"]


def test_ray_and_pyarrow_are_not_imported_unless_asked() -> None:
    code = "import sys, lighting.cli.batch, lighting.batch.ray; print(*sys.modules)"
    modules = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert "lighting.batch.ray" in modules
    assert not {"ray", "pyarrow"} & set(modules)


def test_without_ray_nothing_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Settings of a batch that never began would refuse one by the pool in that folder."""
    (tmp_path / "a.jpg").touch()
    monkeypatch.setitem(sys.modules, "ray", None)
    result = CliRunner().invoke(cli, ["batch", "--engine", "ray", str(tmp_path), str(tmp_path / "out")])
    assert result.stderr == "Error: The engine ray needs Ray and pyarrow: pip install 'outdoor-lighting[ray]'.\n"
    assert not (tmp_path / "out").exists()


def test_ray_without_pyarrow_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.jpg").touch()
    monkeypatch.setitem(sys.modules, "pyarrow.fs", None)
    result = CliRunner().invoke(cli, ["batch", "--engine", "ray", str(tmp_path), str(tmp_path / "out")])
    assert (result.exit_code, result.stdout) == (1, "")
    assert result.stderr == "Error: The engine ray needs Ray and pyarrow: pip install 'outdoor-lighting[ray]'.\n"


def test_help_says_what_is_written() -> None:
    help_text = " ".join(run_batch("--help").stdout.split())
    assert "receives lighting.jsonl" in help_text
    assert "--engine [pool|ray]" in help_text
