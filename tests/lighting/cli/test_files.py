"""What commands read and write."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from lighting.files.exr import read_exr
from tests.conftest import encode, scene
from tests.lighting.cli.runners import LIGHTING, error_of, run


@pytest.mark.parametrize(("name", "magic"), [("a.exr", b"v/1\x01"), ("a.HDR", b"#?RADIANCE"), ("a.png", b"\x89PNG")])
def test_envmap_writes_by_suffix(network: Path, photo_path: Path, tmp_path: Path, name: str, magic: bytes) -> None:
    result = run("envmap", photo_path, "-o", tmp_path / name, "--height", "64", "--model", network)
    assert (result.exit_code, result.stderr) == (0, "")
    assert (tmp_path / name).read_bytes().startswith(magic)
    assert result.stdout == run("estimate", photo_path, "--model", network).stdout
    assert {p.name for p in tmp_path.iterdir()} == {"photo.jpg", name}


@pytest.mark.parametrize("command", [["estimate"], ["info"], ["render", "-o", "a.exr"], ["preview", "-o", "a.png"]])
def test_an_input_without_a_name_is_refused(command: list[str]) -> None:
    """It would be the current folder."""
    assert error_of(run(*command, "")).endswith("The name of the file is empty.")


def test_render_takes_a_record_or_a_line_of_estimate(record_path: Path, tmp_path: Path) -> None:
    line = json.dumps({"file": "photo.jpg", "lighting": LIGHTING.to_dict()}).encode()
    run("render", record_path, "-o", tmp_path / "a.exr", "--height", "32")
    run("render", "-", "-o", tmp_path / "b.exr", "--height", "32", stdin=line)
    run("render", "-", "-o", tmp_path / "c.exr", "--height", "32", stdin=b"\xef\xbb\xbf" + line)
    run("render", "-", "-o", tmp_path / "d.exr", "--height", "32", stdin=line.decode().encode("utf-16"))  # PowerShell's
    maps = [read_exr(tmp_path / f"{name}.exr") for name in "abcd"]
    assert all((image == maps[0][0]).all() and lighting == LIGHTING for image, lighting in maps)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "stdin does not hold one JSON record: Expecting value: line 1 column 1 (char 0)."),
        ("{}\n{}", "stdin holds more than one record, and one is read at a time."),
        ("[" * 100_000, "stdin does not hold one JSON record: maximum recursion depth exceeded"),
        ("\xff", "stdin does not hold a JSON record: it is not text in UTF-8."),
        ("NaN", "stdin: A lighting record must be an object, not nan."),
        ("[]", "stdin: A lighting record must be an object, not []."),
        ('{"lighting": null}', "stdin: A lighting record must be an object, not None."),
        ("{}", "stdin: The lighting record needs an object 'sun'."),
        ('{"file": "x.jpg", "error": "Gone."}', "stdin: The JSON holds an error in place of a lighting record."),
        ('{"lightings": [{}, {}]}', "stdin: The JSON holds the records of several photos, and one is read at a time."),
        (
            '{"sun": {"azimuth": NaN, "elevation": 3}, "sky": {"turbidity": 3, "exposure": 1}}',
            "stdin: sun.azimuth must",
        ),
        (
            '{"sun": {"azimuth": 3, "elevation": 3}, "sky": {"turbidity": 11, "exposure": 1}}',
            "stdin: sky.turbidity is 11; it must",
        ),
        (
            '{"sun": {"azimuth": 3, "elevation": -3}, "sky": {"turbidity": 3, "exposure": 1}}',
            "stdin: sun.elevation is -3",
        ),
        ('{"sun": {"azimuth": 1' + "0" * 5000 + "}}", "stdin does not hold one JSON record: Exceeds the limit"),
        ('{"sun": {"azimuth": 3, "azimuth": 4}}', "stdin: The key 'azimuth' stands twice."),
        (" " * 1_000_001, "stdin is larger than a lighting record, which has at most 1 MB."),
    ],
    ids=range(16),
)
def test_a_bad_record_is_one_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    result = run("render", "-", "-o", tmp_path / "a.exr", stdin=text.encode("latin-1"))
    assert error_of(result).startswith(sentence)
    assert list(tmp_path.iterdir()) == []


def test_a_record_out_of_range_is_named(photo_path: Path, tmp_path: Path) -> None:
    path = tmp_path / "mine.json"
    record = LIGHTING.to_dict()
    path.write_text(json.dumps({**record, "sky": {**record["sky"], "turbidity": 11}}), encoding="utf-8-sig")
    out = tmp_path / "out"
    commands: list[list[str | Path]] = [
        ["render", path, "-o", tmp_path / "a.exr"],
        ["info", path],
        ["scene", photo_path, "--for", "usd", "--lighting", path, "-o", out],
    ]
    for command in commands:
        assert error_of(run(*command)) == f"{path}: sky.turbidity is 11; it must lie in 1 to 10."
    assert not out.exists()


def test_inputs_are_never_overwritten(network: Path, tmp_path: Path) -> None:
    photo = tmp_path / "photo.png"
    photo.write_bytes(encode(scene(96, 64), "PNG"))
    (tmp_path / "link.png").symlink_to(photo)
    for output in (photo, tmp_path / "link.png", tmp_path / ".." / tmp_path.name / "photo.png"):
        for command in ("envmap", "preview"):
            text = error_of(run(command, photo, "-o", output, "--model", network), 2)
            assert text == "The input and the outputs must be different files."
    same = tmp_path / "a.png"
    error_of(run("envmap", photo, "-o", same, "--preview", same, "--model", network), 2)
    error_of(run("envmap", photo, "-o", "-", "--preview", "-", "--model", network), 2)
    assert photo.read_bytes() == encode(scene(96, 64), "PNG")


def test_a_bad_photo_leaves_an_older_output_alone(network: Path, tmp_path: Path) -> None:
    (tmp_path / "a.exr").write_bytes(b"older")
    text = error_of(run("envmap", "-", "-o", tmp_path / "a.exr", "--model", network, stdin=b"bad"))
    assert text == "stdin: The file is not a JPEG, PNG, WebP, TIFF, AVIF or HEIC photo that can be read."
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == {"a.exr": b"older"}


def test_a_write_that_fails_is_one_sentence_and_leaves_nothing(
    record_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device", "a.exr")

    monkeypatch.setattr(Path, "replace", full)
    assert "No space left on device" in error_of(run("render", record_path, "-o", tmp_path / "a.exr", "--height", "16"))
    assert [p.name for p in tmp_path.iterdir()] == ["lighting.json"]


def test_a_map_needs_no_masked_arrays(network: Path, photo_path: Path, tmp_path: Path) -> None:
    """numpy imports them with some functions, which a process of its own waits for."""
    code = "import sys; from lighting.cli import cli; cli(sys.argv[1:], standalone_mode=False)"
    code += "; print('numpy.ma' in sys.modules)"
    command = [sys.executable, "-c", code, "envmap", photo_path, "-o", tmp_path / "a.exr", "-q", "--model", network]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == "False"
