"""The command line of export."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from export.__main__ import export_cli
from export.data.panoramas import INDEX, DataError
from export.evaluation.irradiance import light_report
from lighting.errors import LightingError


@pytest.mark.parametrize(
    ("words", "meant"), [(["evalute"], "evaluate"), (["report", "shadow"], "shadows"), (["stereo", "trian"], "train")]
)
def test_a_misspelt_command_is_answered_by_what_was_meant(words: list[str], meant: str) -> None:
    result = CliRunner().invoke(export_cli, words)
    assert (result.exit_code, f"Did you mean {meant}?" in result.output) == (2, True)


def test_settings_that_contradict_each_other_are_refused(data: Path, tmp_path: Path) -> None:
    arguments = ["train", "--data", str(data), "--out", str(tmp_path / "run")]
    result = CliRunner().invoke(export_cli, [*arguments, "--only-camera", "--teacher", str(tmp_path)])
    assert result.exit_code == 2
    assert "--teacher answers for all heads" in result.output
    result = CliRunner().invoke(export_cli, [*arguments, "--mirrored"])
    assert result.exit_code == 2
    assert "--mirrored needs --teacher or --only-camera" in result.output
    assert not (tmp_path / "run").exists()


def test_commands_say_what_is_missing_in_one_sentence(data: Path, tmp_path: Path) -> None:
    runner = CliRunner()
    for arguments in (
        ["label", "--data", str(tmp_path / "none"), "--out", str(tmp_path / "l.csv")],
        ["train", "--data", str(data), "--labels", str(tmp_path / "none.csv"), "--out", str(tmp_path / "run")],
        ["onnx", str(tmp_path / "none")],
        ["evaluate", "--data", str(data), "--labels", str(data / "labels.csv"), "--model", str(tmp_path / "none.onnx")],
    ):
        result = runner.invoke(export_cli, arguments)
        assert isinstance(result.exception, DataError | LightingError), (arguments, result.output)
        assert "\n" not in str(result.exception)


def test_commands_say_which_panoramas_are_missing_in_one_sentence(data: Path, network: Path, tmp_path: Path) -> None:
    (tmp_path / "panoramas").symlink_to(data / "panoramas")
    (tmp_path / INDEX).write_text((data / INDEX).read_text().replace(",val,", ",train,"))
    options = ["--labels", str(data / "labels.csv"), "--model", str(network)]
    for command, folder, message in (
        (["evaluate", *options, "--out", str(tmp_path / "out")], tmp_path, "is of the split val"),
        (["fit", "sky-color", *options], data, "The network states no light"),
        (["fit", "ground", *options], data, "The network states no light"),
        (["fit", "sun-color", *options], data, "has no HDR panorama in `train` that is sunny or overcast"),
    ):
        result = CliRunner().invoke(export_cli, [*command, "--data", str(folder)])
        assert isinstance(result.exception, DataError | LightingError), (command, result.output)
        assert message in str(result.exception)
    with pytest.raises(DataError, match="has no HDR panorama in `val` that is sunny or overcast"):
        light_report(data, data / "labels.csv", [network])


@pytest.mark.parametrize(
    "arguments",
    [["label", "--data", "none", "--out"], ["onnx", "run", "--out"]],
)
def test_a_folder_is_no_file_to_write_which_is_said_before_the_work(tmp_path: Path, arguments: list[str]) -> None:
    result = CliRunner().invoke(export_cli, [*arguments, str(tmp_path)])
    assert result.exit_code == 2
    assert "is a directory" in result.output


@pytest.mark.parametrize(
    "command", ["label", "prior", "train", "evaluate", "report shadows", "fit ground", "suitable x"]
)
def test_commands_without_data_say_so_in_one_sentence(command: str) -> None:
    result = CliRunner().invoke(export_cli, command.split())
    assert result.exit_code == 2
    assert result.output.splitlines()[-1] == "Error: Missing option '--data'."


def test_required_options_are_named(tmp_path: Path) -> None:
    result = CliRunner().invoke(export_cli, ["unpack", "x", "0", "--data", str(tmp_path)])
    assert result.exit_code == 2
    assert result.output.splitlines()[-1] == "Error: Missing option '--out'."
