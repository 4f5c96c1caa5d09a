"""What a new user types first, and is told: one sentence that says what to type instead."""

import shlex
from pathlib import Path

import pytest

import lighting.cli.outputs as outputs
from tests.helpers.processes import error_of, invoke_command

USAGE = (
    ("envmap photo.jpg sky.exr", "To write sky.exr, type -o before its name."),
    ("envmap photo.jpg there.exr", "To write there.exr, type -o before its name."),
    ("preview photo.jpg p.png", "To write p.png, type -o before its name."),
    ("estimate photo.jpg light.json", "To write light.json, type -o before its name."),
    ("envmap there.exr", "there.exr is a map, not a photo: try `lighting info there.exr`."),
    ("envmap https://example.org/a.jpg", "https://example.org/a.jpg is an address; download it, and give the name of"),
    ("open http://example.org/a.jpg", "http://example.org/a.jpg is an address; download it, and give the name of"),
    ("https://example.org/a.jpg", "is an address: download the photo, then type `lighting envmap FILE`."),
    ("envmap photo.jpg --turbidity 3", "There is no option --turbidity. Did you mean --haze?"),
    ("envmap photo.jpg --resolution 2048", "There is no option --resolution. Did you mean --height?"),
    ("envmap photo.jpg --size=2048", "There is no option --size. Did you mean --height?"),
    ("envmap photo.jpg --format hdr", "The ending of -o says the format, such as -o sky.hdr."),
    ("envmap photo.jpg --out sky.exr", "There is no option --out. Did you mean --output?"),
    ("estimate photo.jpg --out-file a.json", "There is no option --out-file. Did you mean --output?"),
    ("envmap photo.jpg --sun-azimuth 40", "There is no option --sun-azimuth. Did you mean --sun?"),
    ("envmap photo.jpg --focal-length 24", "There is no option --focal-length. Did you mean --vertical-fov?"),
    ("envmap photo.jpg --timezone 2", "There is no option --timezone. Did you mean --utc-offset?"),
    ("scene photo.jpg --engine blender", "There is no option --engine. Did you mean --for?"),
    ("batch . out --threads 4", "There is no option --threads. Did you mean --workers?"),
    ("envmap -f photo.jpg", "There is no option -f. Did you mean --overwrite?"),
    ("envmap photo.jpg -height 64", "There is no option -height. Did you mean --height?"),
    ("envmap photo.jpg -output sky.exr", "There is no option -output. Did you mean --output?"),
    ("envmap --input photo.jpg", "A file needs no option: type its name alone."),
    ("envmap photo.jpg --gpu", "There is no option --gpu. It runs on the CPU."),
    ("envmap photo.jpg --hieght 64", "There is no option --hieght. Did you mean --height?"),
    ("envmap photo.jpg --for blender", "There is no option --for here; `lighting scene` has it."),
    ("estimate photo.jpg --height 64", "There is no option --height here; `lighting envmap` has it."),
    ("estimate '-?' photo.jpg", "There is no option -?. `--help` shows the help."),
    ("serve 8000", "`lighting serve` takes no file; '8000' is too much. Did you mean --port 8000?"),
    ("serve -p 8000", "There is no option -p. Did you mean --port?"),
    ("lighting envmap photo.jpg", "There is no command 'lighting'. Did you mean `lighting --help`?"),
    ("/help", "There is no command '/help'. Did you mean `lighting --help`?"),
    ("--sun 40,25 photo.jpg", "--sun goes behind a command: `lighting envmap PHOTO --sun`."),
    ("-V", "`lighting --version` shows the version."),
    ("--verbose envmap photo.jpg", "`lighting --debug` shows where an error arose."),
    ("blender photo.jpg", "There is no command 'blender'. Did you mean `lighting scene PHOTO --for blender`?"),
    ("gui", "There is no command 'gui'. Did you mean `lighting open`?"),
    ("ui", "There is no command 'ui'. Did you mean `lighting open`?"),
    ("version", "There is no command 'version'. Did you mean `lighting --version`?"),
    ("hdri photo.jpg", "There is no command 'hdri'. Did you mean `lighting envmap PHOTO`?"),
    ("train", "There is no command 'train'. Did you mean `python -m export train`?"),
    ("--help photo.jpg", "photo.jpg is a photo, not a command: try `lighting envmap photo.jpg`"),
    ("envmap photo.jpg -o maps", "There is no folder maps. -o maps/ makes it, and -o maps.exr writes a file."),
    ("scene photo.jpg --for gltf -o s.glb", "the results are a folder, and s.glb is a file's name; try s."),
    ("video clip.mp4 -o out.mp4", "the results are a folder, and out.mp4 is a file's name; try out."),
    ("batch . results.csv", "the results are a folder, and results.csv is a file's name; try results."),
    ("scene photo.jpg", "Missing option '--for'. Type --for and one of blender, usd, "),
    ("scene photo.jpg --for Blender", "Did you mean blender?"),
    ("envmap photo.jpg --sun 40 25", "needs AZIMUTH,ELEVATION in degrees: --sun 40,25."),
    ("video photo.jpg", "photo.jpg is a photo: try `lighting envmap photo.jpg`."),
)
FAILURES = (
    ("estimate clip.mp4", "clip.mp4: It is a clip: try `lighting video clip.mp4`."),
    ("envmap clip.MOV", "clip.MOV: It is a clip: try `lighting video clip.MOV`."),
    ("envmap .", ".: It is a folder: try `lighting batch .`."),
    ("scene . --for usd", ".: It is a folder: try `lighting batch .`."),
    ("open .", ".: It is a folder: try `lighting batch .`."),
    ("info .", ".: It is a folder: try `lighting batch .`."),
    ("video .", ".: It is a folder: try `lighting batch .`."),
    ("open note.txt", "note.txt: This is a text, not a photo."),
    ("open photo.jpg", "photo.jpg: The photo is empty."),
    ("envmap link.jpg", "link.jpg: No such file or directory: it is a link, and leads nowhere."),
    ("open none.jpg", "none.jpg: No such file or directory."),
    ("envmap foto.jpg", "foto.jpg: No such file or directory, but photo.jpg is there."),
    ("envmap PHOTO.JPG -o there.exr", "PHOTO.JPG: No such file or directory, but photo.jpg is there."),
    ("envmap my", "my: No such file or directory, but 'my holiday.jpg' is there."),
    ("render recrod.json", "recrod.json: No such file or directory, but record.json is there."),
    (r"envmap 'C:\Users\me\photo.jpg'", "it is a path of Windows, and here a path is like /home/me/photo.jpg."),
    ("envmap C:Usersmephoto.jpg", "it is a path of Windows, and here a path is like /home/me/photo.jpg."),
    ("envmap '~/photo.jpg'", "~/photo.jpg: No such file or directory: type ~ without quotes, or the whole path."),
    ("envmap 'x*.jpg'", "x*.jpg: No file matches this pattern."),
    ("envmap file:///tmp/photo.jpg", "file:///tmp/photo.jpg: Type its path, without file://."),
    ("envmap nowhere/photo.jpg", "nowhere/photo.jpg: There is no folder nowhere."),
    ("video nowhere/shot.mp4", "nowhere/shot.mp4: There is no folder nowhere."),
)


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("photo.jpg", "my holiday.jpg", "there.exr", "clip.mp4", "clip.MOV", "record.json"):
        Path(name).touch()
    Path("note.txt").write_text("hello")
    Path("link.jpg").symlink_to("nowhere.jpg")


@pytest.mark.parametrize(("line", "sentence"), USAGE, ids=[line for line, _ in USAGE])
def test_wrong_usage_is_told_what_to_type(line: str, sentence: str) -> None:
    there = sorted(Path().iterdir())
    assert sentence in error_of(invoke_command(*shlex.split(line)), 2)
    assert sorted(Path().iterdir()) == there


@pytest.mark.parametrize(("line", "sentence"), FAILURES, ids=[line for line, _ in FAILURES])
def test_a_file_that_cannot_be_read_is_told_what_was_meant(line: str, sentence: str) -> None:
    assert error_of(invoke_command(*shlex.split(line))).endswith(sentence)


@pytest.mark.parametrize("flag", ["-h", "--help"])
def test_help_may_stand_before_the_command(flag: str) -> None:
    assert invoke_command(flag, "envmap").output == invoke_command("envmap", "--help").output


def test_a_program_that_opens_files_is_named_only_where_it_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    for found, hint in (("/usr/bin/xdg-open", " Open it: xdg-open a.png"), (None, "")):
        monkeypatch.setattr("shutil.which", lambda _, found=found: found)
        outputs.report_written(["a.png"])
        assert capsys.readouterr().out == f"Wrote a.png.{hint}\n"
