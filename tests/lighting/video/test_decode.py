"""Clips read frame by frame: rotation, HDR, times, damage; and what files say of how they were taken."""

import os
import socket
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import av
import cv2
import numpy as np
import pytest
from av.video.reformatter import VideoReformatter
from PIL import Image

from lighting.color import DECODE_CURVES, Curve, luminance, srgb_decode, srgb_encode
from lighting.errors import VideoError, WarningCode
from lighting.video import decode
from lighting.video.decode import Clip, _readable, _to_srgb, _upright_pixels, local_address
from lighting.video.framing import ClipForm, looks_logarithmic
from tests.helpers.clips import Pixels, look, pan, write_clip
from tests.helpers.pages import ROOT

FOCAL_LENGTH = "com.apple.quicktime.camera.focal_length.35mm_equivalent"
TOP_RED = np.zeros((180, 320, 3), np.uint8)
TOP_RED[..., 1] = np.add.outer(np.arange(180) // 4, np.arange(320) // 8)  # no plain parts, which are borders
TOP_RED[:90] += np.array([200, 0, 0], np.uint8)


def first(path: Path) -> Pixels:
    with Clip(path) as clip:
        return next(clip.frames()).pixels


@pytest.mark.parametrize(("rotation", "top_goes"), [(90, "left"), (-90, "right"), (180, "bottom")])
def test_a_rotation_flag_turns_the_picture(tmp_path: Path, rotation: int, top_goes: str) -> None:
    pixels = first(write_clip(tmp_path / "a.mp4", [TOP_RED] * 3, rotation=rotation)).astype(int)
    assert pixels.shape == ((180, 320, 3) if rotation == 180 else (320, 180, 3))
    height, width = pixels.shape[:2]
    part = {"left": pixels[:, : width // 4], "right": pixels[:, -width // 4 :], "bottom": pixels[-height // 4 :]}
    assert part[top_goes][..., 0].mean() > 150
    assert pixels[..., 0].mean() == pytest.approx(100, abs=10)


def test_frames_are_no_longer_than_asked_for(tmp_path: Path) -> None:
    """640 / 1050 * 1050 is more than 640 in floating point."""
    path = write_clip(tmp_path / "a.mp4", [np.full((590, 1050, 3), 128, np.uint8)] * 2)
    assert first(path).shape == (360, 640, 3)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("rotation", [0, 90, -90, 180])
def test_flags_turn_and_mirror(tmp_path: Path, rotation: int, mirrored: bool) -> None:
    """Counter-clockwise, then left and right change places."""
    stored = np.zeros((180, 320, 3), np.uint8)
    stored[:90], stored[90:, :160] = 200, 90
    turned = np.rot90(stored, rotation // 90)
    path = write_clip(tmp_path / "a.mp4", [stored] * 3, rotation=rotation, mirrored=mirrored)
    pixels = first(path)
    expected = turned[:, ::-1] if mirrored else turned
    assert pixels.shape == expected.shape
    assert np.abs(pixels.astype(int) - expected).mean() < 3
    with Clip(path) as clip:
        assert (clip.info.height, clip.info.width) == expected.shape[:2]


@pytest.mark.parametrize(("curve", "number", "grey"), [("pq", 16, 179), ("hlg", 18, 153)])
def test_ten_bits_are_read_by_their_curve(tmp_path: Path, curve: str, number: int, grey: int) -> None:
    """A signal of 50 % is 92 of 203 cd/m2 of PQ; of HLG a twelfth of its peak, 31 % of white; then sRGB's curve."""
    half = np.full((64, 64, 3), 128, np.uint8)
    options = {"x265-params": "log-level=none", "crf": "10"}
    path = write_clip(
        tmp_path / "a.mp4", [half] * 3, codec="libx265", pix_fmt="yuv420p10le", colour=(number, 9, 9), options=options
    )
    with Clip(path) as clip:
        assert clip.info.curve == curve
        pixels = next(clip.frames()).pixels
    assert np.median(pixels) == pytest.approx(grey, abs=4)  # 128 of 255 is 50.2 %
    assert np.ptp(pixels) <= 3


def test_few_pictures_are_kept(tmp_path: Path) -> None:
    path = write_clip(tmp_path / "a.mp4", [np.full((64, 64, 3), 30 * n, np.uint8) for n in range(8)])
    with Clip(path) as clip:
        shown = {}
        for frame in clip.frames():
            clip.keep_picture(frame.index)
            shown[frame.index] = frame.pixels
        kept = {n: pixels for n in shown if (pixels := clip.kept_pixels(n)) is not None}
    assert list(kept) == [4, 5, 6, 7]
    assert all(np.array_equal(pixels, shown[n]) for n, pixels in kept.items())


@pytest.mark.parametrize("size", [(160, 90), (133, 75)])
def test_planes_have_the_levels_of_packed_pixels(size: tuple[int, int]) -> None:
    frame = av.VideoFrame.from_ndarray(pan(1, 0.0)[0], format="rgb24").reformat(format="yuv420p")
    planes, packed = (decode._resize_picture(frame, *size, name, VideoReformatter()) for name in ("gbrp", "rgb24"))
    np.testing.assert_array_equal(planes, packed)


def test_each_frame_has_its_own_time(tmp_path: Path) -> None:
    times = [0.0, 0.04, 0.2, 0.21, 0.5]
    path = write_clip(tmp_path / "a.mp4", pan(5), times=times)
    with Clip(path) as clip:
        np.testing.assert_allclose([frame.time for frame in clip.frames()], times, atol=1e-3)
        assert clip.damage == ""


def test_large_pictures_come_smaller(tmp_path: Path) -> None:
    path = write_clip(tmp_path / "a.mp4", [np.full((720, 1280, 3), 90, np.uint8)] * 2)
    assert first(path).shape == (360, 640, 3)
    with Clip(path) as clip:
        assert (clip.info.width, clip.info.height, clip.info.frame_rate) == (1280, 720, 30.0)


def test_metadata_are_facts(tmp_path: Path) -> None:
    path = write_clip(tmp_path / "a.mov", pan(2), metadata={"com.apple.quicktime.location.ISO6709": "+48.1+011.5/"})
    with Clip(path) as clip:
        assert clip.info.metadata.latitude == 48.1


def test_tags_that_are_no_utf8_hide_no_others(tmp_path: Path) -> None:
    metadata = {"title": "Sonne in Xanten", "com.apple.quicktime.location.ISO6709": "+48.1+011.5/"}
    path = write_clip(tmp_path / "a.mov", pan(2), metadata=metadata)
    path.write_bytes(path.read_bytes().replace(b"Xanten", b"\xffanten"))
    with Clip(path) as clip:
        assert (clip.info.metadata.latitude, clip.info.metadata.longitude) == (48.1, 11.5)


def test_tags_that_are_no_utf8_are_text() -> None:
    """PyAV 19 leaves lone surrogates, older ones what stands for unreadable bytes."""
    of_19, older = {"title": "in \udcffanten"}, {"title": "in \ufffdanten"}
    assert _readable(of_19) == _readable(older) == older


def test_half_of_a_fragmented_clip_is_read_and_told(tmp_path: Path) -> None:
    whole = write_clip(tmp_path / "a.mkv", pan(90))
    data = whole.read_bytes()
    cut = tmp_path / "cut.mkv"
    cut.write_bytes(data[: len(data) // 2])
    with Clip(cut) as clip:
        count = len(list(clip.frames()))
        assert 10 < count < 80
        assert "cut short" in clip.damage or "damaged" in clip.damage


def test_garbage_inside_is_left_out_and_told(tmp_path: Path) -> None:
    data = bytearray(write_clip(tmp_path / "a.mp4", pan(60)).read_bytes())
    middle = len(data) // 3
    data[middle : middle + 3000] = bytes(3000)
    broken = tmp_path / "b.mp4"
    broken.write_bytes(bytes(data))
    with Clip(broken) as clip:
        assert len(list(clip.frames())) >= 20


def mux_silence(film: Any, stream: Any, seconds: float, form: str = "s16") -> None:
    """Mono silence at the stream's rate, in a format of FFmpeg's."""
    samples = np.zeros((1, round(seconds * stream.rate)), {"s16": np.int16, "fltp": np.float32}[form])
    frame = av.AudioFrame.from_ndarray(samples, format=form, layout="mono")
    frame.rate = stream.rate
    film.mux(stream.encode(frame))
    film.mux(stream.encode())


def make_with_long_sound(path: Path) -> Path:
    """Half a second of pictures beside three of sound."""
    with av.open(str(path), "w") as film:
        pictures: Any = film.add_stream("libx264", rate=30, options={"preset": "veryfast"})
        sound: Any = film.add_stream("pcm_s16le", rate=8000)
        pictures.width, pictures.height, pictures.pix_fmt = 320, 180, "yuv420p"
        for picture in [TOP_RED] * 15:
            film.mux(pictures.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        film.mux(pictures.encode())
        mux_silence(film, sound, seconds=3.0)
    return path


def make_with_held_end(path: Path) -> Path:
    """Fifteen pictures, the last of which is shown for four seconds."""
    with av.open(str(path), "w") as film:
        stream: Any = film.add_stream("libx264", rate=30, options={"preset": "veryfast", "bf": "0"})
        stream.width, stream.height, stream.pix_fmt = 320, 180, "yuv420p"
        packets = [p for _ in range(15) for p in stream.encode(av.VideoFrame.from_ndarray(TOP_RED, format="rgb24"))]
        packets += stream.encode()
        packets[-1].duration = 120  # of 1/30 s
        film.mux(packets)
    return path


@pytest.mark.parametrize(
    ("make", "name", "lasts"), [(make_with_long_sound, "a.mkv", 0.5), (make_with_held_end, "a.mp4", 4.47)]
)
def test_a_whole_clip_is_not_called_cut_short(
    tmp_path: Path, make: Callable[[Path], Path], name: str, lasts: float
) -> None:
    with Clip(make(tmp_path / name)) as clip:
        assert clip.info.duration == pytest.approx(lasts, abs=0.01)
        assert len(list(clip.frames())) == 15
        assert clip.damage == ""


def test_joined_recordings_go_on(tmp_path: Path) -> None:
    """As `cat a.ts a.ts` joins them: the times of the second begin again."""
    part = write_clip(tmp_path / "a.ts", pan(12)).read_bytes()
    joined = tmp_path / "joined.ts"
    joined.write_bytes(2 * part)
    with Clip(joined) as clip:
        times = [frame.time for frame in clip.frames()]
        assert clip.damage == ""
    np.testing.assert_allclose(times, np.arange(24) / 30.0, atol=1e-3)


@pytest.mark.parametrize("damaged", [range(5, 6), range(4, 9)])
def test_damaged_times_shift_nothing_that_comes_after(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, damaged: range
) -> None:
    """The times of a few pictures jump back and return, as one damaged byte of a Matroska file makes them."""
    with Clip(write_clip(tmp_path / "a.mkv", pan(12), times=[2 + i / 10 for i in range(12)])) as clip:
        pictures = list(clip._pictures)
        for index in damaged:
            pictures[index].pts -= round(1.5 / pictures[index].time_base)
        monkeypatch.setattr(clip, "_pictures", iter(pictures))
        times = [frame.time for frame in clip.frames()]
    assert times[-1] == pytest.approx(1.1, abs=0.01)
    assert max(np.diff(times)) < 0.2 + 0.1 * len(damaged)


def test_times_that_cannot_be_are_damage(tmp_path: Path) -> None:
    path = write_clip(tmp_path / "a.mkv", pan(6), times=[0.0, 0.1, 0.2, 1e12, 1e12 + 0.1, 1e12 + 0.2])
    with Clip(path) as clip:
        assert [frame.index for frame in clip.frames()] == [0, 1, 2]
        assert clip.damage


def make_sound(path: Path) -> Path:
    with av.open(str(path), "w") as film:
        stream = film.add_stream("pcm_s16le", rate=8000)
        mux_silence(film, stream, seconds=0.1)
    return path


def make_song(path: Path, cover: Pixels) -> Path:
    with av.open(str(path), "w") as film:
        picture: Any = film.add_stream("mjpeg", rate=1)
        sound = film.add_stream("libmp3lame", rate=44100)
        picture.width, picture.height, picture.pix_fmt = cover.shape[1], cover.shape[0], "yuvj420p"
        picture.disposition = av.stream.Disposition.attached_pic.value
        film.mux(picture.encode(av.VideoFrame.from_ndarray(cover, format="rgb24")))
        film.mux(picture.encode())
        mux_silence(film, sound, seconds=1.0, form="fltp")
    return path


def test_a_songs_cover_is_no_clip(tmp_path: Path) -> None:
    song = make_song(tmp_path / "a.mp3", TOP_RED)
    with pytest.raises(VideoError, match="no moving picture"):
        Clip(song)


def test_frames_without_times_begin_at_0(tmp_path: Path) -> None:
    with Clip(write_clip(tmp_path / "a.h264", pan(6))) as clip:
        times = [frame.time for frame in clip.frames()]
    assert times[0] == 0.0
    np.testing.assert_allclose(np.diff(times), 1 / clip.info.frame_rate)


@pytest.mark.parametrize("kind", ["text", "empty", "truncated", "sound", "tiny"])
def test_what_is_no_clip_is_said_in_a_sentence(tmp_path: Path, kind: str) -> None:
    path = tmp_path / ("a.wav" if kind == "sound" else "a.mp4")
    if kind == "sound":
        make_sound(path)
    elif kind == "tiny":
        write_clip(path, [np.zeros((16, 16, 3), np.uint8)] * 2)
    elif kind == "truncated":
        data = write_clip(path, pan(10)).read_bytes()
        path.write_bytes(data[: len(data) // 2])
    else:
        path.write_bytes(b"" if kind == "empty" else b"not a clip " * 100)
    with pytest.raises(VideoError) as raised:
        Clip(path)
    assert str(raised.value).endswith(".")


@pytest.mark.parametrize(
    "name", ["http:127.0.0.1:{port}?.mp4", "tcp:127.0.0.1:{port}.mp4", "concat:a.mp4|b.mp4", "%d.mp4"]
)
def test_a_name_is_never_an_address(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """Nor a list of files or a pattern; the film's name is none either."""
    monkeypatch.chdir(tmp_path)
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(0.1)
        path = Path(name.format(port=server.getsockname()[1]))
        write_clip(tmp_path / "a.mp4", pan(3)).rename(path)
        with Clip(path) as clip:
            assert len(list(clip.frames())) == 3
        with av.open(local_address(path), "w", format="mp4") as film:
            film.add_stream("libx264", rate=30)
        with pytest.raises(TimeoutError):
            server.accept()
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("suffix", [".mp4", ".m3u8", ".ts"])
@pytest.mark.parametrize(
    "text",
    [
        "#EXTM3U\n#EXT-X-TARGETDURATION:9\n#EXTINF:9,\n{clip}\n#EXT-X-ENDLIST\n",
        "ffconcat version 1.0\nfile {clip}\n",
        "# a comment first\nfile {clip}\n",
        '<?xml version="1.0"?><MPD></MPD>',
    ],
)
def test_a_playlist_opens_no_other_file(tmp_path: Path, text: str, suffix: str) -> None:
    write_clip(tmp_path / "clip.ts", pan(3))
    playlist = tmp_path / f"a{suffix}"
    playlist.write_text(text.format(clip="clip.ts"))
    words = (
        "not a clip" if text.startswith("# a") and suffix != ".m3u8" else "This is a playlist, which names other files"
    )
    with pytest.raises(VideoError, match=words):
        Clip(playlist)


@pytest.mark.parametrize("name", ["a.mp4", "a.ts", "a.h264"])
def test_larger_pictures_than_8k_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    path = write_clip(tmp_path / name, pan(3))
    with monkeypatch.context() as context:
        context.setattr(decode, "MAX_CLIP_PIXELS", 320 * 180 - 1)
        with pytest.raises(VideoError, match=r"pictures of 320 x 180 pixels are larger than the limit"):
            Clip(path)
    monkeypatch.setattr(decode, "_DECODER_OPTIONS", {"max_pixels": "57599"})  # a file may announce less than it holds
    with pytest.raises(VideoError):
        Clip(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="POSIX")
def test_a_pipe_does_not_hang(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.mp4")
    with pytest.raises(VideoError, match="a pipe or a device"):
        Clip(tmp_path / "a.mp4")


def test_a_folder_of_frames_is_told_from_a_clip(tmp_path: Path) -> None:
    with pytest.raises(VideoError, match=r"This is a folder; a clip is one file\. Join frames to one first"):
        Clip(tmp_path)


def test_a_missing_file_is_an_oserror(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        Clip(tmp_path / "none.mp4")


CODED = (
    (16, 128, 128),
    (30, 128, 128),
    (126, 128, 128),
    (235, 128, 128),
    (110, 96, 184),
    (140, 102, 78),
    (92, 192, 112),
)
BT709, BT601 = (0.2126, 0.0722), (0.299, 0.114)  # weights of red and blue


def coded_by(frame: Any, curve: int, primaries: int) -> SimpleNamespace:
    """A codec's context of those numbers of H.273, which the frame has, too, where PyAV has them of frames."""
    if hasattr(frame, "color_trc"):
        frame.color_trc, frame.color_primaries = curve, primaries
    return SimpleNamespace(color_trc=curve, color_primaries=primaries)


def upright(frame: av.VideoFrame, coded: Any, side: int, stretch: float = 1.0) -> Pixels:
    return _upright_pixels(frame, coded, side, stretch, ClipForm(), VideoReformatter())


@pytest.mark.parametrize(("side", "off"), [(64, 1.1), (128, 2.1)])
@pytest.mark.parametrize(("matrix", "weights"), [(1, BT709), (5, BT601)])
@pytest.mark.parametrize("coded", CODED)
def test_colours_are_those_that_were_coded(
    coded: tuple[int, int, int], matrix: int, weights: tuple[float, float], side: int, off: float
) -> None:
    """Frames are reduced to a level; what is left as large goes through libswscale's own tables."""
    frame = av.VideoFrame(128, 128, "yuv420p")
    for plane, value in zip(frame.planes, coded, strict=True):
        plane.update(bytes([value]) * (plane.line_size * plane.height))
    frame.colorspace, frame.color_range = matrix, 1
    shown = upright(frame, coded_by(frame, 1, 1), side)
    assert shown.shape == (side, side, 3)
    np.testing.assert_allclose(shown.reshape(-1, 3).mean(axis=0), decoded(coded, weights), atol=off)


@pytest.mark.parametrize(("curve", "signal"), [(18, 0.75), (16, 0.5807)])
def test_diffuse_white_of_hdr_is_white(curve: int, signal: float) -> None:
    frame = av.VideoFrame(128, 128, "yuv420p10le")
    for plane, value in zip(frame.planes, (round(64 + 876 * signal), 512, 512), strict=True):
        plane.update(np.full(plane.buffer_size // 2, value, np.uint16).tobytes())
    frame.colorspace, frame.color_range = 9, 1
    assert upright(frame, coded_by(frame, curve, 9), 64).min() >= 254


@pytest.mark.parametrize(("side", "stretch"), [(64, 1.0), (128, 1.0), (128, 0.5)])
def test_colours_of_hdr_are_its_own_at_every_size(side: int, stretch: float) -> None:
    coded, frame = (500, 560, 470), av.VideoFrame(128, 128, "yuv420p10le")
    for plane, value in zip(frame.planes, coded, strict=True):
        plane.update(np.full(plane.buffer_size // 2, value, np.uint16).tobytes())
    frame.colorspace, frame.color_range = 9, 1
    signal = np.array(decoded((500 / 4, 560 / 4, 470 / 4), (0.2627, 0.0593))) / 255
    expected = _to_srgb(np.round(signal * 65280).astype(np.uint16), "hlg", 9)
    shown = upright(frame, coded_by(frame, 18, 9), side, stretch)
    np.testing.assert_allclose(shown.reshape(-1, 3).mean(axis=0), expected, atol=0.6)


def decoded(coded: tuple[float, float, float], weights: tuple[float, float]) -> list[float]:
    """Red, green and blue of luma and both color differences in the limited range of 8 bits."""
    luma, of_blue, of_red = (coded[0] - 16) / 219, (coded[1] - 128) / 224, (coded[2] - 128) / 224
    red, blue = luma + 2 * (1 - weights[0]) * of_red, luma + 2 * (1 - weights[1]) * of_blue
    green = (luma - weights[0] * red - weights[1] * blue) / (1 - sum(weights))
    return [float(np.clip(255 * value, 0, 255)) for value in (red, green, blue)]


def test_pq_reaches_the_levels_of_bt2408() -> None:
    """Table 1 of the report: 58 % is 203 cd/m2, 75 % 983 cd/m2, 38 % 26 cd/m2 (18 % gray)."""
    light = DECODE_CURVES["pq"]([0.38, 0.58, 0.75, 1.0]) * 203.0
    np.testing.assert_allclose(light, [26, 203, 983, 10000], rtol=0.03)  # signals are rounded to per cents


def test_hlg_is_one_at_diffuse_white_and_twelve_times_its_knee_at_the_top() -> None:
    assert DECODE_CURVES["hlg"](0.75) == pytest.approx(1.0)
    assert DECODE_CURVES["hlg"](1.0) / DECODE_CURVES["hlg"](0.5) == pytest.approx(12.0, rel=1e-4)
    assert DECODE_CURVES["hlg"](0.38) == pytest.approx(0.18, abs=0.01)  # BT.2408: 18 % gray


@pytest.mark.parametrize("curve", ["hlg", "pq"])
def test_grey_stays_grey_and_white_is_white(curve: Curve) -> None:
    signal = 0.75 if curve == "hlg" else 0.5807
    coded = np.full((2, 2, 3), round(signal * 65280), dtype=np.uint16)
    assert np.all(_to_srgb(coded, curve, 9) >= 254)
    darker = _to_srgb(coded // 2, curve, 9)
    assert np.ptp(darker) <= 1
    assert darker.max() < 200


def test_dark_greys_are_no_darker_than_their_light() -> None:
    coded = np.repeat(np.arange(200, 8000, dtype=np.uint16)[:, None], 3, axis=1)
    options = 255.0 * srgb_encode(DECODE_CURVES["hlg"](coded / 65280.0))
    assert np.mean(_to_srgb(coded, "hlg", 1) - options) == pytest.approx(0.0, abs=0.05)


def test_primaries_of_bt2020_are_more_saturated_than_those_of_bt709() -> None:
    coded = np.array([[[40000, 25000, 25000]]], dtype=np.uint16)
    wide, narrow = (_to_srgb(coded, "hlg", primaries)[0, 0].astype(int) for primaries in (9, 1))
    assert wide[0] > narrow[0]
    assert wide[1] < narrow[1]


# Cameras' logarithms.


def logarithmic(linear: np.ndarray, curve: Curve) -> np.ndarray:
    """The signals, as bytes, of linear values under a curve."""
    signal = np.linspace(0.0, 1.0, 4097)
    return np.asarray(np.round(255.0 * np.interp(linear, DECODE_CURVES[curve](signal), signal)), dtype=np.uint8)


@pytest.mark.parametrize("curve", ["d-log", "s-log3", "v-log", "apple-log", "logc4"])
def test_a_logarithm_is_undone(tmp_path: Path, curve: Curve) -> None:
    """Grays of 5 to 70 %, as code values of a file of full range."""
    grays = np.repeat(np.linspace(0.05, 0.7, 8), 40)
    coded = np.tile(logarithmic(grays, curve)[None, :, None], (180, 1, 3))
    path = write_clip(tmp_path / "a.mkv", [coded] * 3, codec="ffv1", pix_fmt="bgr0", options={})
    with Clip(path, form=ClipForm(curve)) as clip:
        frame = next(iter(clip.frames()))
    shown = srgb_decode(frame.pixels[90, 20::40, 1] / 255.0)
    np.testing.assert_allclose(shown, grays[20::40], rtol=0.06)


def test_limited_range_leaves_sonys_code_values_as_they_are(tmp_path: Path) -> None:
    """The code of 18 % gray is 420 of 1023, of which limited range makes 105 of 255."""
    path = write_clip(tmp_path / "a.mp4", [np.full((180, 320, 3), round(255 * (420 - 64) / 876), np.uint8)] * 3)
    with Clip(path, curve="s-log3") as clip:
        assert srgb_decode(next(iter(clip.frames())).pixels.mean() / 255.0) == pytest.approx(0.18, abs=0.006)


def street(count: int = 8) -> list[Pixels]:
    """A pan over an example photo, whose colors are those of the world."""
    with Image.open(ROOT / "examples" / "wide_street.jpg") as photo:
        small = np.asarray(photo.convert("RGB").resize((480, 320)))
    return [small[60:240, 16 * i : 16 * i + 320] for i in range(count)]


def test_the_curve_that_a_file_beside_names_is_undone_and_said(tmp_path: Path) -> None:
    plain = street()
    path = write_clip(tmp_path / "a.mp4", [logarithmic(srgb_decode(one / 255.0), "d-log") for one in plain])
    with Clip(path) as clip:
        assert clip.info.curve == "srgb"
        assert [warning.code for warning in clip.info.warnings] == [WarningCode.CURVE]
        assert "looks as if" in clip.info.warnings[0]
    path.with_suffix(".SRT").write_text("1\n00:00:00,000 --> 00:00:01,000\n[iso: 100] [color_md: dlog]\n")
    with Clip(path) as clip:
        frame = next(iter(clip.frames())).pixels
        assert clip.info.curve == "d-log"
        assert "D-Log, by its subtitles" in clip.info.warnings[0]
    assert float(luminance(frame).mean()) == pytest.approx(float(luminance(plain[0]).mean()), abs=6.0)
    with Clip(path, curve="srgb") as clip:
        assert clip.info.warnings == ()


@pytest.mark.parametrize("curve", ["s-log3", "f-log2", "v-log", "c-log3", "n-log"])
def test_every_logarithm_of_limited_range_looks_so(curve: Curve) -> None:
    for name in ("wide_street", "railway_field", "snow_field"):
        with Image.open(ROOT / "examples" / f"{name}.jpg") as photo:
            linear = srgb_decode(np.asarray(photo.convert("RGB").resize((320, 240))) / 255.0)
        wide = 0.85 * linear + 0.15 * linear.mean(axis=2, keepdims=True)  # primaries of a camera
        codes = 1023.0 / 255.0 * logarithmic(wide, curve).astype(float)
        assert looks_logarithmic([np.clip(255.0 * (codes - 64.0) / 876.0, 0.0, 255.0).astype(np.uint8)])
        assert not looks_logarithmic([np.asarray(255.0 * linear, dtype=np.uint8)])


def test_an_ordinary_clip_does_not_look_logarithmic(tmp_path: Path) -> None:
    with Clip(write_clip(tmp_path / "a.mp4", street())) as clip:
        assert clip.info.warnings == ()


# Borders and lettering.


def bordered(picture: Pixels, height: int = 320) -> Pixels:
    """The picture between black bars."""
    bars = np.zeros((height, picture.shape[1], 3), np.uint8)
    top = (height - picture.shape[0]) // 2
    bars[top : top + picture.shape[0]] = picture
    return bars


def test_a_clip_is_cut_to_the_picture_inside_its_border(tmp_path: Path) -> None:
    plain = pan(10)
    path = write_clip(tmp_path / "a.mp4", [bordered(one) for one in plain], metadata={FOCAL_LENGTH: "26"})
    bare = write_clip(tmp_path / "b.mp4", plain, metadata={FOCAL_LENGTH: "26"})
    with Clip(path) as clip, Clip(bare) as other:
        frames, expected = list(clip.frames()), list(other.frames())
        assert abs(clip.info.height - 180) <= 3
        assert [warning.code for warning in clip.info.warnings] == [WarningCode.BORDER]
        assert "Only the picture inside a border was used: 320 x" in clip.info.warnings[0]
        assert clip.info.metadata.vertical_fov == pytest.approx(other.info.metadata.vertical_fov, abs=1.0)
        assert other.info.warnings == ()
    assert len(frames) == len(expected) == 10
    with Clip(path, 120, form=clip.form) as again:
        assert next(iter(again.frames())).pixels.shape[1] == 120


@pytest.mark.parametrize("top", [123, 138])  # odd ones share their color with the border
def test_no_line_of_a_border_stays_where_frames_are_reduced(tmp_path: Path, top: int) -> None:
    picture = cv2.resize(look(0.0), (1600, 1080 - 2 * top))
    film = np.zeros((1080, 1600, 3), np.uint8)
    film[top : 1080 - top] = picture
    with Clip(write_clip(tmp_path / "a.mp4", [film] * 3)) as clip:
        frame = next(iter(clip.frames())).pixels.mean(axis=(1, 2))
    shown = cv2.resize(picture, (640, round(640 / 1600 * len(picture)))).mean(axis=(1, 2))
    assert len(shown) - 6 <= len(frame) < len(shown)
    assert np.abs(frame[[0, -1]] - shown[[2, -3]]).max() < 12


def test_a_dark_scene_between_bars_hides_none_of_the_picture(tmp_path: Path) -> None:
    dark = [bordered(np.asarray(one // 12, dtype=np.uint8)) for one in pan(10)[:3]]
    path = write_clip(tmp_path / "a.mp4", [*dark, *(bordered(one) for one in pan(10)[3:])])
    with Clip(path) as clip:
        assert abs(clip.info.height - 180) <= 3


def test_bars_of_some_frames_are_told(tmp_path: Path) -> None:
    plain = street(10)
    barred = [np.concatenate([np.zeros_like(one[:25]), one[25:-25], np.zeros_like(one[:25])]) for one in plain]
    with Clip(write_clip(tmp_path / "a.mp4", [*barred[:5], *plain[5:]])) as clip:
        assert clip.info.height == 180
        assert "Some frames have a border" in clip.info.warnings[0]


def lettered(picture: Pixels, opacity: float = 1.0) -> Pixels:
    """The picture under lines of letters."""
    letters = np.zeros(picture.shape, np.uint8)
    for row in range(20, 180, 28):
        cv2.putText(letters, "ALT 20 SPD 14 BAT", (4, row), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255,) * 3, 1, cv2.LINE_AA)
    share = opacity * (letters / 255.0)
    return np.asarray(picture * (1.0 - share) + 255.0 * share, dtype=np.uint8)


@pytest.mark.parametrize("opacity", [1.0, 0.6])
def test_lettering_that_stands_still_is_left_out(tmp_path: Path, opacity: float) -> None:
    path = write_clip(tmp_path / "a.mp4", [lettered(one, opacity) for one in street(10)])
    with Clip(path) as clip:
        frames = [frame.pixels for frame in clip.frames()]
        assert [warning.code for warning in clip.info.warnings] == [WarningCode.OVERLAY]
        covered = clip.form.overlay
    assert covered is not None
    letters = lettered(np.zeros((180, 320, 3), np.uint8))[..., 0] > 128
    assert np.mean(covered[letters]) > 0.6
    assert np.mean(letters[:, :200]) < np.mean(covered) < 8 * np.mean(letters)
    with Clip(path, form=replace(clip.form, overlay=None)) as shown:
        seen = [frame.pixels for frame in shown.frames()]
    change = np.abs(frames[0].astype(float) - seen[0]).mean(axis=2)
    assert change[letters].mean() > 20.0
    assert change[~covered].max() == 0.0


def test_a_camera_that_stands_sees_no_lettering(tmp_path: Path) -> None:
    path = write_clip(tmp_path / "a.mp4", [lettered(pan(4)[0])] * 10)
    with Clip(path) as clip:
        assert clip.info.warnings == ()
