"""What `lighting video` writes of whole clips, and the words in its film."""

import json
import os
import re
import shutil
import sys
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest
from click.testing import CliRunner, Result
from numpy.typing import NDArray
from PIL import Image

import lighting.envmap.latlong as latlong
import lighting.photo_estimate as photo_estimate
from lighting.cli import cli
from lighting.color import SRGB_LINEAR
from lighting.envmap.relighting import rotate_envmap
from lighting.errors import ParameterError, VideoError
from lighting.files import write_envmap
from lighting.files.exr import read_exr, read_exr_attributes
from lighting.geometry import Pinhole, camera_axes, camera_directions, latlong_pixel
from lighting.light_probe import compute_light_probe, main_light, project_latlong
from lighting.map_options import MapOptions
from lighting.model import Model
from lighting.preview.drawing import text_width
from lighting.records import Lighting, LightProbe
from lighting.video import output
from lighting.video.decode import Clip
from lighting.video.observation import estimate_frame
from lighting.video.output import _draw_overlay, _fit_layout
from lighting.video.shot import FrameLight
from tests.conftest import LIT, write_network
from tests.helpers.cameras import poles
from tests.helpers.clips import SIZE, Pixels, pan, write_clip


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_clip(tmp_path_factory.mktemp("clip") / "pan.mp4", pan(30, 20.0))


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, ["video", *map(str, arguments)])


def records(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "lighting.jsonl").read_text().splitlines()]


def test_a_clip_takes_no_map_that_is_made_by_strips() -> None:
    with pytest.raises(ParameterError, match="height is 4098; it must be an even number from 16 to 4096"):
        output.OutputOptions(MapOptions(4098))


def test_a_record_a_frame_and_a_map_a_shot(clip: Path, network: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = run(clip, "-o", out, "--model", network, "--height", 32, "--every", 0.5)
    assert done.exit_code == 0, done.output
    assert "shot 1, 0.0 to 1.0 s, 30 frames" in done.output
    lines = records(out)
    assert [line["frame"] for line in lines] == list(range(30))
    lights = [Lighting.from_dict(line["lighting"]) for line in lines]
    turned = np.unwrap([light.relative_heading or 0.0 for light in lights], period=360)
    suns = np.unwrap([light.sun_azimuth for light in lights], period=360)
    np.testing.assert_allclose(turned + suns, turned[0] + suns[0], atol=1e-3)  # one sun in the world
    assert turned[-1] - turned[0] == pytest.approx(20.0, abs=1.5)
    for line, seen in [*zip(lines, lights, strict=True)][::10]:
        expected = compute_light_probe(seen).to_dict()
        told = line["lighting"]["light_probe"]
        assert told["main_light"] == expected["main_light"]
        np.testing.assert_allclose(told["coefficients"], expected["coefficients"], rtol=0.01, atol=2e-3)
    header = read_exr_attributes(out / "shot-1.exr")
    assert np.reshape(header["light_probe.coefficients"], (9, 3))[0] == pytest.approx(
        lines[0]["lighting"]["light_probe"]["coefficients"][0], rel=0.01
    )
    image, light = read_exr(out / "shot-1.exr")
    assert image.shape == (32, 64, 3)
    assert light is not None
    assert light.evidence == ("pixels", "turns", "other photos")
    assert sorted(p.name for p in out.iterdir()) == ["lighting.jsonl", "shot-1.exr"]


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="names of files are Unicode there")
def test_records_escape_a_name_that_is_not_utf8(clip: Path, network: Path, tmp_path: Path) -> None:
    source = shutil.copy(clip, tmp_path / os.fsdecode(b"caf\xe9.mp4"))
    out = tmp_path / "out"
    done = run(source, "-o", out, "--model", network, "--height", 32, "--every", 0.5)
    assert done.exit_code == 0, done.output
    assert {line["file"] for line in records(out)} == {str(tmp_path / r"caf\xe9.mp4")}


def test_shot_and_frames_stand_on_the_ground_that_they_show(lit_network: Path, tmp_path: Path) -> None:
    clip = write_clip(tmp_path / "green.mp4", [green(frame) for frame in pan(6, 3.0)])
    assert run(clip, "-o", tmp_path / "out", "--model", lit_network, "--height", 32).exit_code == 0
    grounds = {tuple(line["lighting"]["ground"]["color"]) for line in records(tmp_path / "out")}
    assert len(grounds) == 1
    red, greenish, blue = grounds.pop()
    assert greenish > 1.5 * red > 1.5 * blue
    _, light = read_exr(tmp_path / "out" / "shot-1.exr")
    assert light is not None
    assert light.ground_color == (red, greenish, blue)


def test_a_clip_that_is_no_ordinary_one_is_told(tmp_path: Path) -> None:
    doubtful = np.array([*LIT["light"][:-1], 0.02])
    model = write_network(tmp_path / "doubtful.onnx", more={**LIT, "light": doubtful})
    clip = write_clip(tmp_path / "pan.mp4", pan(6, 3.0))
    done = run(clip, "-o", tmp_path / "out", "--model", model, "--height", 32)
    assert f"Warning: {clip}: Probably not an outdoor daylight clip" in done.output
    assert len(records(tmp_path / "out")[0]["lighting"]["warnings"]) == done.output.count("Warning: ") == 1


def test_a_lens_that_is_given_tells_how_the_camera_was_held(network: Path, tmp_path: Path) -> None:
    pixels = poles(20.0, 0.0, 60.0, (320, 180))
    clip = write_clip(tmp_path / "poles.mp4", [pixels] * 3)
    assert run(clip, "-o", tmp_path / "out", "--model", network, "--height", 32, "--fov", 60).exit_code == 0
    seen = estimate_frame(Model.load(network), pixels, 60.0)
    assert seen.by_lens is not None
    alone, known = (said.prediction.camera_elevation for said in (seen, seen.by_lens))
    assert abs(records(tmp_path / "out")[0]["lighting"]["camera"]["elevation"] - known) < 0.3 * abs(known - alone)


def test_warnings_speak_of_the_clip(network: Path, tmp_path: Path) -> None:
    clip = write_clip(tmp_path / "pan.mp4", pan(6, 3.0))
    said = ("--time", "2024-06-01T12:00:00Z", "--fov", 150)
    done = run(clip, "-o", tmp_path / "out", "--model", network, "--height", 32, *said)
    assert done.exit_code == 0, done.output
    assert "The time was not used, because the clip does not say where it was taken." in done.output
    assert "°: it may be cropped." in done.output
    assert "photo" not in done.output


def green(frame: Pixels) -> Pixels:
    """The frame with its lower half tinted."""
    tinted = frame.copy()
    half = len(frame) // 2
    tinted[half:] = tinted[half:] * np.array([0.5, 0.8, 0.25])
    return tinted


def test_a_map_a_frame_and_a_film(network: Path, tmp_path: Path) -> None:
    short = write_clip(tmp_path / "short.mp4", pan(4, 3.0))
    done = run(short, "-o", tmp_path / "out", "--model", network, "--height", 32, "--frames-exr", "--preview")
    assert done.exit_code == 0, done.output
    maps = sorted((tmp_path / "out" / "frames").iterdir())
    assert [m.name for m in maps] == [f"{i:06d}.exr" for i in range(4)]
    with av.open(str(tmp_path / "out" / "preview.mp4")) as film:
        drawn = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert len(drawn) == 4
    assert np.abs(drawn[0].astype(int) - pan(4, 3.0)[0]).max() > 60  # something is drawn in


def test_a_heading_makes_the_map_look_north(network: Path, tmp_path: Path) -> None:
    clip = write_clip(tmp_path / "short.mp4", pan(8, 3.0))
    for name, more in (("a", []), ("b", ["--heading", 90])):
        assert run(clip, "-o", tmp_path / name, "--model", network, "--height", 32, *more).exit_code == 0
    (_, plain), (_, north) = (read_exr(tmp_path / name / "shot-1.exr") for name in "ab")
    assert plain is not None
    assert north is not None
    assert (north.sun_azimuth - plain.sun_azimuth) % 360.0 == pytest.approx(90.0, abs=0.1)
    assert records(tmp_path / "b")[0]["lighting"]["camera"]["heading"] == pytest.approx(90.0, abs=0.1)


def test_a_map_whose_centre_is_north_says_so_without_time_and_place(network: Path, tmp_path: Path) -> None:
    clip = write_clip(tmp_path / "pan.mp4", pan(6, 3.0))
    assert run(clip, "-o", tmp_path / "out", "--model", network, "--height", 32, "--heading", 120).exit_code == 0
    _, light = read_exr(tmp_path / "out" / "shot-1.exr")
    first = records(tmp_path / "out")[0]["lighting"]
    assert light is not None
    assert light.camera_heading == pytest.approx(0.0, abs=1e-6)
    assert light.camera_elevation == pytest.approx(first["camera"]["elevation"], abs=1e-3)
    assert (first["sun"]["azimuth"] + 120 - light.sun_azimuth + 180) % 360 == pytest.approx(180, abs=0.01)


def test_usd_has_a_camera_with_time_samples(clip: Path, network: Path, tmp_path: Path) -> None:
    from pxr import Usd, UsdGeom

    done = run(clip, "-o", tmp_path / "out", "--model", network, "--height", 32, "--for", "usd")
    assert done.exit_code == 0, done.output
    stage = Usd.Stage.Open(str(tmp_path / "out" / "shot-1-usd" / "shot.usda"))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode(), stage.GetFramesPerSecond()) == (0, 29, 30)
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/World/Camera"))
    for line in records(tmp_path / "out")[::7]:
        own = line["lighting"]["camera"]
        matrix = np.array(camera.ComputeLocalToWorldTransform(line["frame"]))
        right, up, forward = camera_axes(own["relative_heading"], own["elevation"], own["roll"])
        np.testing.assert_allclose(matrix[:3, :3], [right, up, -forward], atol=1e-5)
    assert stage.GetPrimAtPath("/World/Sun").IsValid()


def test_blender_gets_key_frames(network: Path, tmp_path: Path) -> None:
    clip = write_clip(tmp_path / "short.mp4", pan(10, 4.0))
    assert run(clip, "-o", tmp_path / "o", "--model", network, "--height", 32, "--for", "blender").exit_code == 0
    folder = tmp_path / "o" / "shot-1-blender"
    numbers = json.loads((folder / "shot.json").read_text())
    still = json.loads((folder / "scene.json").read_text())
    assert numbers["frames"] == [float(i) for i in range(1, 11)]
    np.testing.assert_allclose(numbers["matrices"][0], still["camera"]["matrix"], atol=2e-3)
    compile((folder / "shot.py").read_text(), "shot.py", "exec")
    assert (folder / numbers["clip"]).resolve() == clip.resolve()
    with Image.open(folder / still["lit_ground"]) as mask:  # the first frame's shade would not move with the camera
        assert mask.getextrema() == (255, 255)


@pytest.mark.parametrize("tool", ["blender", "usd"])
def test_a_scene_s_spot_out_of_the_picture_is_told(network: Path, tmp_path: Path, tool: str) -> None:
    clip = write_clip(tmp_path / "far.mp4", pan(3, 0.1))
    arguments = (clip, "-o", tmp_path / "out", "--model", network, "--height", 32, "--fov", 5, "--overwrite")
    assert "no ground" not in run(*arguments).output
    done = run(*arguments, "--for", tool)
    assert done.exit_code == 0, done.output
    assert done.output.count(f"Warning: {clip}: The object would stand") == 1
    assert (
        done.output.count("Warning: ") == len(set(done.output.splitlines())) - 2
    )  # each once, beside the shot's line and the last
    assert "no ground" not in run(*arguments, "--for", tool, "--quiet").output


def test_a_cut_is_told(network: Path, tmp_path: Path) -> None:
    path = write_clip(tmp_path / "cut.mp4", [*pan(25, 10.0), *pan(25, 10.0, seed=5)])
    done = run(path, "-o", tmp_path / "out", "--model", network, "--height", 32)
    assert done.exit_code == 0
    assert "2 shots; the clip has cuts" in done.output
    assert {line["shot"] for line in records(tmp_path / "out")} == {1, 2}
    assert (tmp_path / "out" / "shot-2.exr").is_file()


def test_a_scene_that_cannot_be_written_loses_no_record(clip: Path, network: Path, tmp_path: Path) -> None:
    folder = tmp_path / "o"
    folder.mkdir()
    (folder / "shot-1-usd").write_text("mine")
    result = run(clip, "-o", folder, "--model", network, "--for", "usd", "--overwrite")
    assert result.exit_code == 1
    assert "shot-1-usd" in result.stderr
    assert (folder / "shot-1-usd").read_text() == "mine"
    assert (folder / "shot-1.exr").is_file()
    assert records(folder)


def test_a_plate_that_cannot_be_read_loses_no_record(
    clip: Path, network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read(_index: int) -> None:
        raise VideoError("The clip is gone.")

    monkeypatch.setattr(output, "_read_frames", lambda *_: nullcontext(read))
    result = run(clip, "-o", tmp_path / "o", "--model", network, "--for", "usd")
    assert result.exit_code == 1
    assert "The clip is gone." in result.stderr
    assert records(tmp_path / "o")


def test_overwriting_removes_the_maps_of_the_clip_before_and_nothing_of_the_users(
    network: Path, tmp_path: Path
) -> None:
    cut = write_clip(tmp_path / "cut.mp4", [*pan(25, 10.0), *pan(25, 10.0, seed=5)])
    out = tmp_path / "out"
    assert run(cut, "-o", out, "--model", network, "--height", 32, "--for", "usd", "--frames-exr").exit_code == 0
    write_clip(out / "preview.mp4", pan(6, 3.0))
    write_envmap(out / "frames" / "000099.exr", np.zeros((4, 8, 3), np.float32))
    write_envmap(out / "shot-7.exr", np.zeros((4, 8, 3), np.float32))
    (out / "shot-8.exr").symlink_to(out / "shot-2.exr")
    done = run(out / "preview.mp4", "-o", out, "--model", network, "--height", 32, "--overwrite")
    assert done.exit_code == 0
    assert re.search(r"removed maps of an earlier run: frames/000000\.exr, .* and \d+ more\.", done.output)
    kept = [
        "frames",
        "lighting.jsonl",
        "preview.mp4",
        "shot-1-usd",
        "shot-1.exr",
        "shot-2-usd",
        "shot-7.exr",
        "shot-8.exr",
    ]
    assert sorted(p.name for p in out.iterdir()) == kept
    assert [p.name for p in (out / "frames").iterdir()] == ["000099.exr"]


def test_a_clip_is_not_replaced_by_its_own_preview(network: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    clip = write_clip(tmp_path / "out" / "preview.mp4", pan(6, 3.0))
    before = clip.read_bytes()
    done = run(clip, "-o", tmp_path / "out", "--model", network, "--overwrite", "--preview")
    assert done.exit_code == 2
    assert "must be different files" in done.output
    assert clip.read_bytes() == before


def test_night_that_falls_in_a_clip_does_not_lose_it(network: Path, tmp_path: Path) -> None:
    """Civil twilight ends at 19:47:48 UTC, 18 s after the first of 12 frames."""
    clip = write_clip(tmp_path / "lapse.mp4", pan(12, 12.0), times=[4.0 * i for i in range(12)])
    dusk = ["--time", "2024-06-01T19:47:30Z", "--lat", 48, "--lon", 11]
    done = run(clip, "-o", tmp_path / "out", "--model", network, "--height", 32, *dusk)
    assert done.exit_code == 0, done.output
    assert "it is night at 20.0 s" in done.output
    assert len(records(tmp_path / "out")) == 12


def test_in_twilight_the_words_are_those_of_the_record(network: Path, tmp_path: Path) -> None:
    clip = write_clip(tmp_path / "pan.mp4", pan(6, 3.0))
    dusk = ["--time", "2024-03-01T18:25+01:00", "--lat", 48, "--lon", 11]
    done = run(clip, "-o", tmp_path / "out", "--model", network, "--height", 32, *dusk)
    assert "direct sunlight 0 %" in done.output


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["-", "-o", "out"], 2, "not from stdin"),
        (["CLIP", "-o", "-"], 2, "a folder, which stdout cannot be"),
        (["CLIP", "-o", "out", "--every", "nan"], 2, "not a finite number"),
        (["JUNK", "-o", "out"], 1, "junk.mp4: The file is not a clip"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, arguments: list[str], status: int, words: str) -> None:
    (tmp_path / "junk.mp4").write_bytes(b"junk")
    names = {"CLIP": tmp_path / "clip.mp4", "JUNK": tmp_path / "junk.mp4", "out": tmp_path / "out"}
    done = run(*(names.get(argument, argument) for argument in arguments))
    assert done.exit_code == status
    assert words in " ".join(done.output.split())
    assert not Path("-").exists()


def test_what_can_be_read_of_a_damaged_clip_is_kept(network: Path, tmp_path: Path) -> None:
    data = write_clip(tmp_path / "a.mkv", pan(70, 30.0)).read_bytes()
    (tmp_path / "b.mkv").write_bytes(data[: len(data) // 2])
    done = run(tmp_path / "b.mkv", "-o", tmp_path / "out", "--model", network, "--height", 32)
    assert done.exit_code == 1
    assert "Error" in done.output
    assert "Traceback" not in done.output
    assert len(records(tmp_path / "out")) > 10


def test_a_dark_clip_fails_in_a_sentence(network: Path, tmp_path: Path) -> None:
    path = write_clip(tmp_path / "dark.mp4", [np.zeros((180, 320, 3), np.uint8)] * 10)
    done = run(path, "-o", tmp_path / "out", "--model", network)
    assert done.exit_code == 1
    assert "bright enough" in done.output
    assert records(tmp_path / "out")[0]["shot"] == 1


def test_a_folder_with_results_is_not_overwritten(clip: Path, network: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("mine")
    done = run(clip, "-o", tmp_path / "out", "--model", network)
    assert done.exit_code == 1
    assert "--overwrite" in done.output
    assert run(clip, "-o", tmp_path / "out", "--model", network, "--height", 32, "--overwrite").exit_code == 0
    assert (tmp_path / "out" / "mine.txt").read_text() == "mine"


def test_a_photo_of_night_by_its_own_time_is_refused(clip: Path, network: Path, tmp_path: Path) -> None:
    night = ["--time", "2024-06-01T23:00Z", "--lat", 48, "--lon", 11]
    done = run(clip, "-o", tmp_path / "out", "--model", network, *night)
    assert done.exit_code == 1
    assert "below the horizon" in done.output
    assert not (tmp_path / "out").exists()


def test_what_is_no_clip_leaves_nothing_behind(network: Path, tmp_path: Path) -> None:
    (tmp_path / "a.mp4").write_bytes(b"not a clip" * 100)
    done = run(tmp_path / "a.mp4", "-o", tmp_path / "out", "--model", network)
    assert done.exit_code == 1
    assert "not a clip that can be read" in done.output
    assert not (tmp_path / "out").exists()


def test_what_was_done_before_an_interruption_stays(
    network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second shot's map cannot be written: the first one's records are there."""
    path = write_clip(tmp_path / "cut.mp4", [*pan(25, 10.0), *pan(25, 10.0, seed=5)])

    def fail(target: Path, *rest: Any, **options: Any) -> None:
        if target.name == "shot-2.exr":
            raise KeyboardInterrupt
        write_envmap(target, *rest, **options)

    monkeypatch.setattr(photo_estimate, "write_envmap", fail)
    with pytest.raises(KeyboardInterrupt):
        output.process_video(
            output.VideoJob(path, tmp_path / "out", options=output.OutputOptions(MapOptions(32))), Model.load(network)
        )
    lines = (tmp_path / "out" / "lighting.jsonl.part").read_text().splitlines()
    assert len(lines) >= 25
    assert not (tmp_path / "out" / "lighting.jsonl").exists()


def test_an_interrupted_shot_is_answered_as_far_as_it_was_read(clip: Path, network: Path, tmp_path: Path) -> None:
    def stop(time: float) -> None:
        if time > 0.4:
            raise KeyboardInterrupt

    job = output.VideoJob(clip, tmp_path / "out", options=output.OutputOptions(MapOptions(32)))
    with pytest.raises(KeyboardInterrupt):
        output.process_video(job, Model.load(network), stop)
    times = [json.loads(line)["time"] for line in (tmp_path / "out" / "lighting.jsonl.part").read_text().splitlines()]
    assert times == sorted(times)
    assert 0.4 < times[-1] < 0.5
    assert (tmp_path / "out" / "shot-1.exr").exists()


def test_an_interruption_says_where_the_records_are(
    clip: Path, network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(time: float) -> None:
        if time > 0.4:
            raise KeyboardInterrupt

    monkeypatch.setattr("lighting.cli.video._progress", lambda *_: nullcontext(stop))
    done = run(clip, "-o", tmp_path / "out", "--model", network, "--height", 32)
    assert done.exit_code == 1
    assert f"what was read so far is in {tmp_path / 'out' / 'lighting.jsonl.part'}" in done.output
    assert (tmp_path / "out" / "lighting.jsonl.part").stat().st_size > 0


def test_metadata_tell_time_and_place_unless_told_not_to(network: Path, tmp_path: Path) -> None:
    noted = {
        "com.apple.quicktime.location.ISO6709": "+48.1375+011.5750/",
        "com.apple.quicktime.creationdate": "2024-06-01T12:00:00+0200",
    }
    clip = write_clip(tmp_path / "phone.mov", pan(8, 3.0), metadata=noted)
    for name, more in (("a", []), ("b", ["--no-exif"])):
        assert run(clip, "-o", tmp_path / name, "--model", network, "--height", 32, *more).exit_code == 0
    told, untold = (records(tmp_path / name)[0]["lighting"] for name in "ab")
    assert "time+place" in told["evidence"]
    assert told["sun"]["elevation"] == pytest.approx(60.34, abs=0.05)  # by pvlib's SPA
    assert "heading" in told["camera"]
    assert "time+place" not in untold["evidence"]
    assert "place" not in told  # only with --keep-location


def test_the_light_of_a_clip_is_adjusted_by_hand(clip: Path, network: Path, tmp_path: Path) -> None:
    """As the first frame shows it, and for the other frames as they are turned."""
    out = tmp_path / "out"
    options = ["--model", network, "--height", 16, "--every", 0.5, "--sun", "40,25", "--exposure", 1, "--for", "usd"]
    done = run(clip, "-o", out, *options, "--json")
    assert done.exit_code == 0, done.output
    (line,) = done.stdout.splitlines()
    result = json.loads(line)
    assert (result["output"], len(result["shots"]), result["shots"][0]["frames"]) == (str(out), 1, 30)
    first, *_, last = [Lighting.from_dict(line["lighting"]) for line in records(out)]
    assert first.sun_azimuth == pytest.approx(40.0, abs=0.01)
    assert first.sun_elevation == 25.0
    assert last.sun_azimuth == pytest.approx(40.0 - (last.relative_heading or 0.0), abs=0.01)
    plain = run(clip, "-o", tmp_path / "plain", *options[:6])
    assert plain.stdout.splitlines()[-1].startswith(f"Wrote {tmp_path / 'plain'}/. Open it: ")
    before = Lighting.from_dict(records(tmp_path / "plain")[0]["lighting"])
    assert first.exposure == pytest.approx(2 * before.exposure, rel=1e-4)
    scene = json.loads((out / "shot-1-usd" / "lighting.json").read_text())
    assert scene["sun"]["elevation"] == 25.0


@pytest.fixture(scope="module")
def results(lit_network: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the answers to a clip whose third frame alone is sharp, with detail and without."""
    folder, frames = tmp_path_factory.mktemp("maps"), pan(6, 5.0)
    blurred = [np.asarray(cv2.blur(frame, (3, 3)), dtype=np.uint8) for frame in frames]
    clip = write_clip(folder / "pan.mp4", [*blurred[:2], frames[2], *blurred[3:]])
    options = (
        "--model",
        lit_network,
        "--height",
        128,
        "--every",
        0.04,
        "--no-sun",
        "--frames-exr",
        "--fov",
        45,
        "--preview",
    )
    for name, more in (("detail", ("--for", "blender")), ("plain", ("--no-detail",))):
        arguments = map(str, ("video", clip, "-o", folder / name, *options, *more))
        done = CliRunner().invoke(cli, list(arguments))
        assert done.exit_code == 0, done.output
    return folder


def test_the_map_shows_the_sharpest_frame_where_its_camera_saw_it(results: Path) -> None:
    lines = (results / "detail" / "lighting.jsonl").read_text().splitlines()
    assert [json.loads(line)["in_map"] for line in lines] == [False, False, True, False, False, False]
    assert '"in_map": true' not in (results / "plain" / "lighting.jsonl").read_text()
    camera = json.loads(lines[2])["lighting"]["camera"]
    pose = camera["vertical_fov"], camera["relative_heading"], camera["elevation"], camera["roll"]
    pixel = latlong_pixel(camera_directions(Pinhole(*SIZE, *pose)), 128)
    column, row = np.moveaxis(np.floor(pixel).astype(int), -1, 0)
    shown, plain = (read_exr(results / name / "shot-1.exr")[0][row, column % 256, 1] for name in ("detail", "plain"))
    photo = SRGB_LINEAR[pan(6, 5.0)[2][..., 1]]
    inside = np.s_[30:-30, 30:-30]
    assert np.corrcoef(shown[inside].ravel(), photo[inside].ravel())[0, 1] > 0.8
    assert np.corrcoef(plain[inside].ravel(), photo[inside].ravel())[0, 1] < 0.7


def test_a_frame_that_was_kept_is_the_one_that_is_read_again(
    lit_network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clip = write_clip(tmp_path / "cut.mp4", [*pan(24, 5.0), *pan(24, 5.0, seed=3)])
    options = ("--model", lit_network, "--height", 64, "--every", 0.1)
    with monkeypatch.context() as patches:
        patches.setattr(output, "_read_frames", lambda *_: nullcontext())
        assert run(clip, "-o", tmp_path / "kept", *options).exit_code == 0
    monkeypatch.setattr(Clip, "kept_pixels", lambda _clip, _index: None)
    assert run(clip, "-o", tmp_path / "again", *options).exit_code == 0
    for name in ("lighting.jsonl", "shot-1.exr", "shot-2.exr"):
        assert (tmp_path / "kept" / name).read_bytes() == (tmp_path / "again" / name).read_bytes()


def test_maps_of_frames_and_scene_show_the_same_place(results: Path) -> None:
    world, _ = read_exr(results / "detail" / "shot-1.exr")
    scene, _ = read_exr(results / "detail" / "shot-1-blender" / "environment.exr")
    assert _difference(scene, world) < 0.01
    for line in map(json.loads, (results / "detail" / "lighting.jsonl").read_text().splitlines()):
        seen, _ = read_exr(results / "detail" / "frames" / f"{line['frame']:06d}.exr")
        turned = rotate_envmap(world, -line["lighting"]["camera"]["relative_heading"]) * np.float32(line["gain"])
        assert _difference(seen, turned) < 0.1  # a map that is turned once more is a little softer


def test_light_probes_of_frames_are_those_of_their_maps(results: Path) -> None:
    for line in map(json.loads, (results / "detail" / "lighting.jsonl").read_text().splitlines()):
        probe = np.reshape(line["lighting"]["light_probe"]["coefficients"], (9, 3))
        bare, place = (
            project_latlong(read_exr(results / name / "frames" / f"{line['frame']:06d}.exr")[0])
            for name in ("plain", "detail")
        )
        assert np.abs(probe - place).max() < 0.1 * place.max()
        assert np.abs(probe - place).mean() < 0.5 * np.abs(probe - bare).mean()


def test_the_balls_of_the_film_show_the_place(results: Path) -> None:
    drawn = []
    for name in ("detail", "plain"):
        with av.open(str(results / name / "preview.mp4")) as film:
            drawn.append(next(film.decode(video=0)).to_ndarray(format="rgb24").astype(int))
    change = np.abs(drawn[0] - drawn[1]).max(axis=-1)
    panel = np.zeros(change.shape, np.bool_)
    panel[80:124, 12:114] = True
    assert np.quantile(change[panel], 0.9) > 40
    assert np.quantile(change[~panel], 0.9) < 20  # the codec's


def _difference(image: latlong.Image, other: latlong.Image) -> float:
    return float(np.abs(image - other).mean() / other.mean())


# The film.

BEHIND = Lighting(sun_azimuth=-149.9, sun_elevation=68.3, turbidity=3.0, exposure=0.1, vertical_fov=50.0)


def words_of(width: int, height: int, balls: NDArray[np.float32]) -> Pixels:
    """Where (height, width) the words of a frame in a hurry differ from those of a slow one."""
    grey = np.full((height, width, 3), 110, np.uint8)
    probe = LightProbe(np.zeros((9, 3)), main_light(BEHIND))
    slow = FrameLight(1, 0, 0.4, replace(BEHIND, relative_heading=5.0), (1.0, 1.0, 1.0), False, probe)
    far = FrameLight(1, 0, 8888.8, replace(BEHIND, relative_heading=200.0), (1.0, 1.0, 1.0), True, probe)
    return np.asarray(np.any(_draw_overlay(grey, slow, balls) != _draw_overlay(grey, far, balls), axis=-1))


@pytest.mark.parametrize(("width", "height"), [(432, 768), (360, 640), (640, 360), (320, 180), (100, 200)])
def test_words_stand_inside_the_picture_and_beside_the_balls(width: int, height: int) -> None:
    balls = np.ones((round(0.25 * width), round(0.6 * width), 3), np.float32)
    rows, columns = np.nonzero(words_of(width, height, balls))
    assert columns.min() >= 4
    assert columns.max() <= width - 10
    below = _fit_layout(width, balls.shape[1]).below
    over_balls = (rows < height - below) & (rows >= height - below - balls.shape[0]) & (columns < 12 + balls.shape[1])
    assert not over_balls.any()
    assert rows.min() >= height - below  # all words are under the balls


def test_where_there_is_room_words_and_balls_share_a_line() -> None:
    layout = _fit_layout(768, 246)
    assert layout.lines == ((0, 1, 2),)
    assert layout.below == 12
    assert text_width("8888.8 s   sun -149.9°, 68.3° high   turned -160.0° (bridged)", layout.size) < 768 - 246 - 40
