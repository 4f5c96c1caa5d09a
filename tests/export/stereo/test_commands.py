"""The group of commands."""

from click.testing import CliRunner

from export.stereo.normals_commands import stereo


def test_the_group_lists_its_commands() -> None:
    listed = CliRunner().invoke(stereo, ["--help"]).stdout
    for name in ("evaluate", "gain", "onnx", "speed", "train"):
        assert f"  {name} " in listed
