"""Brackets from files and folders."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import ExifTags

from lighting.color import srgb_encode
from lighting.errors import EnvironmentMapError, PhotoError, ProbeError
from lighting.files.exr import write_exr
from lighting.fusion.user_input import UserInput
from lighting.photo.linear import LinearPhoto
from lighting.probe.bracket import (
    TIME_ATTRIBUTE,
    Bracket,
    BracketFiles,
    _dilate,
    _ExposureRatio,
    _max_terraced_value,
    _measure_ratio,
    _noise_variance,
    _smooth_within_rounding,
    dequantize,
    group_brackets,
    list_pictures,
    make_bracket,
    measure_ratios,
    merge_exposures,
    probe_path,
    probes_in,
    read_bracket,
    read_bracket_files,
)
from tests.helpers.photos import taken, write_png16

PIXELS = np.full((40, 40, 3), 1000, np.uint16)

TIMES = np.array([0.001, 0.01, 0.1, 1.0])


def put(folder: Path, name: str, camera: dict[int, Any] | None = None) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return write_png16(folder / name, PIXELS, camera)


def when(shot: BracketFiles, **stated: Any) -> datetime:
    instant = shot.instants(UserInput(**stated)).likeliest
    assert instant is not None
    return instant.utc_time


def test_files_are_split_where_their_times_leave_a_gap(tmp_path: Path) -> None:
    names = {"d": "11:02:03", "a": "11:00:00", "b": "11:00:02", "c": "11:02:00"}
    files = [put(tmp_path, f"{name}.png", taken(0.1, f"2024:06:01 {time}")) for name, time in names.items()]
    shots = group_brackets(files)
    assert [[file.stem for file in shot.files] for shot in shots] == [["a", "b"], ["c", "d"]]
    assert when(shots[1]) == datetime(2024, 6, 1, 9, 2, tzinfo=UTC)


def test_each_folder_is_a_bracket_and_may_be_named_by_its_time(tmp_path: Path) -> None:
    put(tmp_path / "20240601" / "113000", "a.png")
    put(tmp_path / "20240601" / "113200", "a.png")
    shots = group_brackets([tmp_path / "20240601" / "113000", tmp_path / "20240601" / "113200"])
    assert shots[1].metadata.local_time == datetime(2024, 6, 1, 11, 32)
    assert when(shots[1], utc_offset=2.0) == datetime(2024, 6, 1, 9, 32, tzinfo=UTC)
    with pytest.raises(ProbeError, match="no known zone"):
        when(shots[1])
    assert when(shots[1], latitude=48.14, longitude=11.58) == datetime(2024, 6, 1, 9, 32, tzinfo=UTC)


def test_a_time_that_is_nowhere_is_asked_for(tmp_path: Path) -> None:
    shot = read_bracket_files([put(tmp_path, "a.png")])
    with pytest.raises(ProbeError, match="does not say when"):
        when(shot, utc_offset=0.0)
    with pytest.raises(ProbeError, match="folder of its own"):
        group_brackets([tmp_path / "a.png"])


def test_the_place_is_read_as_well(tmp_path: Path) -> None:
    from PIL import Image

    from tests.conftest import munich

    Image.fromarray((PIXELS >> 8).astype(np.uint8)).save(tmp_path / "a.jpg", exif=munich())
    shot = read_bracket_files([tmp_path / "a.jpg"])
    assert shot.metadata.latitude == pytest.approx(48.1375, abs=1e-3)
    assert when(shot) == datetime(2024, 6, 1, 7, 10, tzinfo=UTC)


def test_a_folder_without_pictures_is_said(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("none")
    with pytest.raises(ProbeError, match="no pictures"):
        list_pictures(tmp_path)


def photo(value: float, size: int = 40, exposure: float | None = None) -> LinearPhoto:
    return LinearPhoto(np.full((size, size, 3), value, np.float32), 0.98, 1 / 255, exposure)


def test_exposures_are_ordered_by_exif_where_all_have_it() -> None:
    bracket = make_bracket([photo(0.1, exposure=1.0), photo(0.9, exposure=0.1)], ["a", "b"])
    assert bracket.names == ("b", "a")


def test_exposures_are_ordered_by_brightness_where_one_has_no_exif() -> None:
    bracket = make_bracket([photo(0.9, exposure=0.1), photo(0.1)], ["a", "b"])
    assert bracket.names == ("b", "a")


def test_one_exposure_is_no_bracket(tmp_path: Path) -> None:
    with pytest.raises(ProbeError, match="only one"):
        read_bracket([tmp_path / "a.png"])
    with pytest.raises(ProbeError, match="there are none"):
        read_bracket([])
    with pytest.raises(ProbeError, match="at least one"):
        make_bracket([])


def test_an_exposure_that_is_given_twice_is_refused(tmp_path: Path) -> None:
    twice = tmp_path / ".." / tmp_path.name / "a.png"
    with pytest.raises(ProbeError, match="is given twice"):
        read_bracket([tmp_path / "a.png", tmp_path / "b.png", twice])


def test_exposures_of_different_sizes_are_refused() -> None:
    with pytest.raises(ProbeError, match="differ in size: 40 x 40, 50 x 50 pixels"):
        make_bracket([photo(0.1), photo(0.2, size=50)])


def test_warnings_of_the_files_come_once() -> None:
    warned = replace(photo(0.1), warnings=("rough",))
    assert make_bracket([warned, warned]).warnings == ("rough",)


def test_files_of_several_kinds_are_read(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", np.full((32, 64, 3), 0.25, np.float32))
    write_png16(tmp_path / "b.png", np.full((32, 64, 3), 40000, np.uint16), taken(0.5))
    bracket = read_bracket([tmp_path / "b.png", tmp_path / "a.exr"])
    assert bracket.names == ("a.exr", "b.png")
    assert bracket.photos[1].pixels.mean() == pytest.approx(40000 / 65535)
    assert bracket.photos[1].exposure == pytest.approx(0.5)
    with pytest.raises(PhotoError, match="linear"):
        read_bracket([tmp_path / "b.png", tmp_path / "a.exr"], "srgb")


MAP = np.ones((16, 32, 3), np.float32)
NOON = datetime(2024, 6, 1, 12, 0, 30, tzinfo=UTC)


def put_folder(folder: Path, name: str, time: str | None = None) -> Path:
    path = folder / name / "envmap.exr"
    path.parent.mkdir(parents=True)
    write_exr(path, MAP, attributes={} if time is None else {TIME_ATTRIBUTE: time})
    return path


def test_folders_are_named_by_utc() -> None:
    local = NOON.astimezone(timezone(timedelta(hours=2)))
    assert probe_path("sky", local) == Path("sky/20240601/120030/envmap.exr")


def test_probes_come_by_time_and_their_header_wins_over_names(tmp_path: Path) -> None:
    late = put_folder(tmp_path, "20240601/090000", NOON.isoformat())
    early = put_folder(tmp_path, "20240601/110000")
    (tmp_path / "notes").mkdir()
    probes = probes_in(tmp_path)
    assert [probe.path for probe in probes] == [early, late]
    assert probes[1].time == NOON
    assert probes[0].time == datetime(2024, 6, 1, 11, tzinfo=UTC)


def test_names_may_be_in_another_zone(tmp_path: Path) -> None:
    put_folder(tmp_path, "20240601/140000")
    assert probes_in(tmp_path, timezone(timedelta(hours=2)))[0].time == datetime(2024, 6, 1, 12, tzinfo=UTC)


def test_what_holds_no_probes_is_said(tmp_path: Path) -> None:
    with pytest.raises(ProbeError, match="no folder"):
        probes_in(tmp_path / "none")
    with pytest.raises(ProbeError, match="holds no probe"):
        probes_in(tmp_path)
    put_folder(tmp_path, "20241399/000000")
    with pytest.raises(ProbeError, match="not named by a time"):
        probes_in(tmp_path)


def test_a_header_without_a_time_in_it_is_named(tmp_path: Path) -> None:
    path = put_folder(tmp_path, "20240601/140000", "noon")
    with pytest.raises(ProbeError) as refused:
        probes_in(tmp_path)
    assert str(refused.value) == f"{path}: lighting.time is 'noon', which is no time."


def test_a_damaged_probe_is_said(tmp_path: Path) -> None:
    put_folder(tmp_path, "20240601/140000").write_bytes(b"nothing")
    with pytest.raises(EnvironmentMapError, match="not an OpenEXR"):
        probes_in(tmp_path)


def test_files_with_and_without_an_offset_are_compared_by_the_cameras_clock(tmp_path: Path) -> None:
    """The offset was read as a gap of two hours."""
    seconds = {"a": 0, "b": 2, "c": 4, "d": 120, "e": 122}
    files = []
    for index, (name, after) in enumerate(seconds.items()):
        camera = taken(0.1, f"2024:06:01 11:{after // 60:02d}:{after % 60:02d}")
        if index % 2:
            del camera[ExifTags.Base.OffsetTimeOriginal]
        files.append(put(tmp_path, f"{name}.png", camera))
    shots = group_brackets(files)
    assert [[file.stem for file in shot.files] for shot in shots] == [["a", "b", "c"], ["d", "e"]]
    assert [when(shot) for shot in shots] == [datetime(2024, 6, 1, 9, minute, tzinfo=UTC) for minute in (0, 2)]


def test_a_stated_offset_wins_over_the_files_and_says_so(tmp_path: Path) -> None:
    shot = read_bracket_files([put(tmp_path, "a.png", taken(0.1))])
    found = shot.instants(UserInput(utc_offset=5.0))
    assert found.likeliest is not None
    assert found.likeliest.utc_time == datetime(2024, 6, 1, 6, 0, tzinfo=UTC)
    assert "+05:00, replaced the file's, +02:00" in found.warnings[0]


def bracket(radiance: NDArray[np.floating[Any]], electrons: float = 1e12, full: int = 2**14 - 1) -> Bracket:
    """Exposures with the noise of light, so many electrons at full scale."""
    rng = np.random.default_rng(2)
    photos = []
    for time in TIMES:
        value = rng.normal(radiance * time, np.sqrt(radiance * time / electrons))
        counts = np.clip(np.rint(value * full), 0, full)
        photos.append(LinearPhoto((counts / full).astype(np.float32), 0.98, 1 / full, time))
    return make_bracket(photos)


def test_radiance_over_six_decades_comes_back() -> None:
    radiance = np.repeat(np.geomspace(1e-3, 900, 400).reshape(20, 20, 1), 3, axis=-1)
    merged = merge_exposures(bracket(radiance), TIMES)
    assert merged.radiance == pytest.approx(radiance, rel=0.03)  # rounding at the darkest end
    assert merged.radiance[10:] == pytest.approx(radiance[10:], rel=0.005)
    assert not merged.clipped.any()


def test_what_is_clipped_in_every_exposure_stays_the_brightest_and_is_marked() -> None:
    radiance = np.full((9, 9, 3), 100.0)
    radiance[4, 3], radiance[4, 4] = 900.0, 10_000.0  # the weights of cv2.MergeDebevec put this one below its neighbour
    merged = merge_exposures(bracket(radiance), TIMES)
    assert merged.clipped.sum() == 1
    assert merged.clipped[4, 4]
    assert merged.radiance[4, 4].min() >= 0.98 / TIMES[0]
    assert merged.radiance[4, 3] == pytest.approx(900, rel=0.01)


def test_a_channel_alone_may_clip() -> None:
    radiance = np.full((9, 9, 3), 0.5)
    radiance[4, 4] = (0.5, 0.5, 5000.0)
    merged = merge_exposures(bracket(radiance), TIMES)
    assert merged.clipped[4, 4]
    # The other channels of such a pixel count in the shortest exposure alone, for demosaicing shares their errors.
    assert merged.radiance[4, 4, 0] == pytest.approx(0.5, rel=0.05)


def test_noise_is_less_than_in_the_best_exposure_alone() -> None:
    radiance = np.full((100, 100, 3), 0.3)
    photos = bracket(radiance, electrons=20_000)
    assert merge_exposures(photos, TIMES).radiance.std() < 0.97 * photos.photos[-1].pixels.std()
    assert merge_exposures(photos, TIMES).radiance.mean() == pytest.approx(0.3, rel=0.002)


def test_nothing_to_measure_is_said() -> None:
    with pytest.raises(ProbeError, match="clipped in the shortest"):
        merge_exposures(bracket(np.full((9, 9, 3), 1e5)), TIMES)
    with pytest.raises(ProbeError, match="black"):
        merge_exposures(bracket(np.zeros((9, 9, 3))), TIMES)


@pytest.mark.parametrize("value", [0.1, 0.5])
@pytest.mark.parametrize("step", [1e-6, 1 / 255])
def test_the_variance_is_that_of_rounded_values_of_20000_electrons(value: float, step: float) -> None:
    random = np.random.default_rng(0)
    light = value + random.uniform(0, step, 200_000)  # all phases of a step
    read = random.normal(random.poisson(light * 20_000) / 20_000, 2e-4)
    assert np.var(step * np.rint(read / step) - light) == pytest.approx(_noise_variance(value, step), rel=0.05)


def test_noise_is_half_a_step_at_the_value_told() -> None:
    step = 1 / 255
    assert _noise_variance(_max_terraced_value(step), 0.0) == pytest.approx(step**2 / 4)
    assert _max_terraced_value(1 / 4095) < 0


RANDOM = np.random.default_rng(11)
SCENE = np.exp(RANDOM.normal(-2.0, 1.0, (120, 120, 3)))


def exposed(
    scene: NDArray[np.floating[Any]], length: float, bits: int = 14, black: float = 0.0, told: bool = False
) -> LinearPhoto:
    full = 2**bits - 1
    value = np.random.default_rng(round(1000 * length)).normal(scene * length + black, 0.002)
    counts = np.clip(np.rint(value * full), 0, full) / full
    return LinearPhoto(counts.astype(np.float32), 0.98, 1 / full, length if told else None)


@pytest.mark.parametrize(("bits", "tolerance"), [(8, 0.01), (12, 0.005), (14, 0.005)])
@pytest.mark.parametrize("ratio", [2.0, 8.0])
def test_ratios_are_measured_from_the_pixels(ratio: float, bits: int, tolerance: float) -> None:
    got = _measure_ratio(exposed(SCENE, 1 / ratio, bits), exposed(SCENE, 1.0, bits))
    assert got is not None
    assert got.value == pytest.approx(ratio, rel=tolerance)
    assert got.error < 0.01


def test_black_that_is_not_zero_does_not_change_the_ratio() -> None:
    got = _measure_ratio(exposed(SCENE, 0.25, black=0.01), exposed(SCENE, 1.0, black=0.01))
    assert got is not None
    assert got.value == pytest.approx(4, rel=0.01)


def test_what_moves_is_outweighed() -> None:
    moved = SCENE.copy()
    moved[:30] = RANDOM.permutation(moved[:30])  # a quarter of the picture
    got = _measure_ratio(exposed(moved, 0.25), exposed(SCENE, 1.0))
    assert got is not None
    assert got.value == pytest.approx(4, rel=0.02)


def test_without_exif_the_longest_exposure_is_one() -> None:
    lengths = measure_ratios(make_bracket([exposed(SCENE, length) for length in (0.1, 0.4, 1.0)]))
    assert not lengths.from_exif
    assert lengths.relative == pytest.approx([0.1, 0.4, 1.0], rel=0.01)


def test_exif_is_believed_and_its_contradiction_said() -> None:
    right = measure_ratios(make_bracket([exposed(SCENE, length, told=True) for length in (0.1, 0.5)]))
    assert right.from_exif
    assert right.relative == pytest.approx([0.1, 0.5])
    assert not right.warnings
    liar = LinearPhoto(exposed(SCENE, 0.1).pixels, 0.98, 2**-14, 0.08)
    wrong = measure_ratios(make_bracket([liar, exposed(SCENE, 0.5, told=True)]))
    assert "the pixels say 5" in wrong.warnings[0]


def test_pixels_coded_by_a_curve_are_refused() -> None:
    coded = [
        LinearPhoto(srgb_encode(exposed(SCENE, length).pixels).astype(np.float32), 0.98, 1 / 255, length)
        for length in (0.02, 0.1, 0.5)
    ]
    with pytest.raises(ProbeError, match=r"coded by a curve.*--curve srgb"):
        measure_ratios(make_bracket(coded))


def test_exposures_that_share_nothing_are_refused() -> None:
    with pytest.raises(ProbeError, match="share too few pixels"):
        measure_ratios(make_bracket([exposed(SCENE * 0, 0.1), exposed(SCENE * 0 + 5, 1.0)]))


def test_a_mask_grows_by_one_pixel_each_way() -> None:
    mask = np.zeros((5, 5), bool)
    mask[2, 2] = True
    assert _dilate(mask).sum() == 9
    mask[:] = False
    mask[0, 0] = True
    assert _dilate(mask).sum() == 4


@pytest.mark.parametrize("bits", [12, 14])
def test_values_that_hardly_differ_tell_the_ratio_of_their_means(bits: int) -> None:
    random = np.random.default_rng(3)
    even = random.uniform(0.05, 0.053, (60, 60, 3))  # the noise of such values is as large as their spread
    even[0, 0] = 0.9
    full = 2**bits - 1

    def shot(length: float) -> LinearPhoto:
        electrons = random.normal(even * length * 20_000, np.sqrt(even * length * 20_000))
        return LinearPhoto((np.rint(electrons / 20_000 * full) / full).astype(np.float32), 0.98, 1 / full, length)

    got = _measure_ratio(shot(0.2), shot(1.0))
    assert got is not None
    assert got.value == pytest.approx(5, rel=0.03)


@pytest.mark.parametrize(("level", "told"), [(0.3, True), (10 / 255, False)])
def test_values_that_are_all_the_same_tell_a_ratio_where_they_are_many_steps(level: float, told: bool) -> None:
    even = np.full((40, 40, 3), level, dtype=np.float32)
    even[0, 0] = 0.9
    got = _measure_ratio(LinearPhoto(even * np.float32(0.2), 0.98, 1 / 255), LinearPhoto(even, 0.98, 1 / 255))
    assert (got is not None) == told
    assert got is None or got.value == pytest.approx(5)


def test_a_ratio_of_few_or_scattered_values_is_not_sure() -> None:
    assert _ExposureRatio(4.0, 0.01, 2000).is_sure
    assert not _ExposureRatio(4.0, 0.01, 200).is_sure
    assert not _ExposureRatio(7.6, 0.11, 8000).is_sure


STEP = 1 / 255
REACH = 6.0  # pixels
Y, X = np.mgrid[:90, :120]
SKY = STEP * (1.6 + 15 * ((X - 50) / 90.0) ** 2 + 10 * ((Y - 30) / 90.0) ** 2)  # from 1.6 to 15 steps


def rounded(values: NDArray[np.floating], step: float = STEP) -> NDArray[np.float32]:
    return np.asarray(step * np.rint(values / step), dtype=np.float32)


def filled(recorded: NDArray[np.float32]) -> NDArray[np.float32]:
    half = np.where(recorded > 0, STEP / 2, 0).astype(np.float32)
    return _smooth_within_rounding(recorded, recorded, half, REACH)


def coarse_bracket(values: NDArray[np.floating], step: float) -> Bracket:
    """Two exposures, of a fifth and of the whole."""
    three = np.repeat(values[..., None], 3, axis=-1)
    photos = [LinearPhoto(rounded(three * time, step), 0.98, step, time) for time in (0.2, 1.0)]
    return Bracket((photos[0], photos[1]), ("short", "long"))


def test_a_sky_of_a_few_steps_comes_back() -> None:
    recorded = rounded(SKY)
    before, after = (np.sqrt(np.mean((values / SKY - 1) ** 2)) for values in (recorded, filled(recorded)))
    assert before > 0.05
    assert after < 0.5 * before


def test_no_value_leaves_the_interval_that_rounding_allows() -> None:
    recorded = rounded(SKY + np.random.default_rng(0).normal(0, 0.4 * STEP, SKY.shape))
    assert np.abs(filled(recorded) - recorded).max() <= STEP / 2 * 1.001


def test_an_edge_stays() -> None:
    recorded = np.full((60, 80), 3 * STEP, dtype=np.float32)
    recorded[:, 40:] = 6 * STEP
    recorded[30:, :20] = 0
    np.testing.assert_allclose(filled(recorded), recorded, rtol=1e-5)


def test_both_sides_of_an_edge_are_smoothed_apart() -> None:
    roof = STEP * (7 + X / 40)
    sky, house = SKY[:, :60], roof[:, 60:]
    together = filled(rounded(np.hstack([sky, house])))
    np.testing.assert_allclose(together[:, :60], filled(rounded(sky)), rtol=1e-4)
    np.testing.assert_allclose(together[:, 60:], filled(rounded(house)), rtol=1e-4)


def test_the_dark_of_a_bracket_comes_nearer_and_its_well_exposed_values_do_not_change() -> None:
    values = SKY.copy()
    values[:, 90:] = 0.3 + 0.002 * X[:, 90:]
    shots = coarse_bracket(values, STEP)
    merged = merge_exposures(shots, np.array([0.2, 1.0]))
    found = dequantize(merged, shots, np.array([0.2, 1.0]), REACH)
    np.testing.assert_array_equal(found.radiance[:, 90:], merged.radiance[:, 90:])
    dark = np.s_[:, :90, 0]
    before, after = (np.abs(picture.radiance[dark] / values[:, :90] - 1).mean() for picture in (merged, found))
    assert after < 0.5 * before


@pytest.mark.parametrize("bits", [12, 14])
def test_fine_bits_are_left_alone(bits: int) -> None:
    shots = coarse_bracket(SKY, 1 / (2**bits - 1))
    merged = merge_exposures(shots, np.array([0.2, 1.0]))
    assert dequantize(merged, shots, np.array([0.2, 1.0]), REACH) is merged
