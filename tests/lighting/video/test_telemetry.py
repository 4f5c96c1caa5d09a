"""What phones and drones write about a clip."""

from datetime import datetime

import numpy as np
import pytest

from lighting.video.telemetry import Gimbal, container_metadata, merge_metadata, subtitle_metadata

DJI = """1
00:00:00,000 --> 00:00:00,033
<font size="28">FrameCnt: 1, DiffTime: 33ms
2024-06-01 09:10:00.123
[iso: 100] [shutter: 1/1000.0] [fnum: 2.8] [focal_len: 24.00] [latitude: 48.1375] [longitude: 11.575]
[rel_alt: 10.0 abs_alt: 530.0] [gb_yaw: 350.0 gb_pitch: -10.0 gb_roll: 0.5] </font>

2
00:00:02,000 --> 00:00:02,033
<font size="28">FrameCnt: 61, DiffTime: 33ms
2024-06-01 09:10:02.123
[iso: 100] [focal_len: 24.00] [latitude: 48.1375] [longitude: 11.575]
[gb_yaw: 10.0 gb_pitch: -20.0 gb_roll: 0.5] </font>
"""


def test_a_phone_from_apple_tells_time_zone_place_and_lens() -> None:
    facts = container_metadata(
        {
            "com.apple.quicktime.location.ISO6709": "+48.1375+011.5750+520.000/",
            "com.apple.quicktime.creationdate": "2024-06-01T09:10:00+0200",
            "com.apple.quicktime.camera.focal_length.35mm_equivalent": "26",
            "creation_time": "2024-06-01T09:00:00.000000Z",
        },
        1920,
        1080,
    )
    assert facts.local_time == datetime(2024, 6, 1, 9, 10)
    assert facts.utc_offset == 2.0
    assert (facts.latitude, facts.longitude) == (48.1375, 11.575)
    assert facts.vertical_fov == pytest.approx(44.4, abs=0.3)  # a diagonal of 43.27 mm at 26 mm, on 16:9


def test_a_phone_with_android_tells_utc_and_a_western_place() -> None:
    noted = {"location": "+40.7128-074.0060/", "creation_time": "2024-06-01T12:00:00.000000Z"}
    facts = container_metadata(noted, 640, 360)
    assert (facts.local_time, facts.utc_offset) == (datetime(2024, 6, 1, 12), 0.0)
    assert facts.longitude == -74.006


@pytest.mark.parametrize(
    "metadata",
    [
        {"location": "+95.0+011.0/"},
        {"location": "+00.0000+000.0000/"},
        {"location": "somewhere"},
        {"creation_time": "1904-01-01T00:00:00.000000Z"},
        {"creation_time": "yesterday"},
        {"com.apple.quicktime.camera.focal_length.35mm_equivalent": "nan"},
    ],
)
def test_what_cannot_be_true_is_absent(metadata: dict[str, str]) -> None:
    facts = container_metadata(metadata, 640, 360)
    assert [facts.latitude, facts.local_time, facts.vertical_fov] == [None] * 3


def test_subtitles_of_a_drone_tell_place_lens_clock_and_gimbal() -> None:
    facts, gimbal = subtitle_metadata(DJI, 1920, 1080)
    assert facts.local_time == datetime(2024, 6, 1, 9, 10)
    assert facts.latitude == 48.1375
    assert facts.focal_length == 24.0
    assert gimbal.at(1.0) == pytest.approx((0.0, -15.0, 0.5))  # half-way from 350 to 10 deg, over north
    assert gimbal.at(60.0) is None


def test_a_gimbal_on_its_head_points_where_the_upper_edge_of_its_picture_does() -> None:
    """DJI's may count straight down in two ways, half a turn of yaw and roll apart, and change between them."""
    down = DJI.replace("gb_yaw: 350.0 gb_pitch: -10.0 gb_roll: 0.5", "gb_yaw: 100.0 gb_pitch: -90.0 gb_roll: 0.0")
    down = down.replace("gb_yaw: 10.0 gb_pitch: -20.0 gb_roll: 0.5", "gb_yaw: -80.0 gb_pitch: -90.0 gb_roll: 180.0")
    _, gimbal = subtitle_metadata(down, 1920, 1080)
    assert [gimbal.at(time)[0] for time in (0.0, 1.0, 2.0)] == pytest.approx([100.0] * 3)  # type: ignore[index]


def test_a_roll_is_read_over_half_a_turn() -> None:
    turned = Gimbal(np.array([0.0, 2.0]), np.zeros(2), np.zeros(2), np.array([179.0, -179.0]))
    assert turned.at(1.0) == pytest.approx((0.0, 0.0, 180.0))


@pytest.mark.parametrize(
    ("said", "length"), [("24.00", 24.0), ("24", 24.0), ("240", 24.0), ("166.00", 166.0), ("2400", None), ("0", None)]
)
def test_a_drone_counts_its_focal_length_in_millimetres_or_tenths(said: str, length: float | None) -> None:
    facts, _ = subtitle_metadata(DJI.replace("24.00", said), 1920, 1080)
    assert facts.focal_length == pytest.approx(length)
    assert (facts.vertical_fov is None) == (length is None)


@pytest.mark.parametrize(
    ("ratio", "length"), [("10000, delta:0", 24.0), ("1.00", 24.0), ("20000, delta:0", None), ("1.50", None)]
)
def test_a_picture_that_is_zoomed_digitally_tells_no_lens(ratio: str, length: float | None) -> None:
    facts, _ = subtitle_metadata(DJI.replace("24.00]", f"24.00] [dzoom_ratio: {ratio}]"), 1920, 1080)
    assert facts.focal_length == length
    assert (facts.vertical_fov is None) == (length is None)


@pytest.mark.parametrize(
    "said",
    [
        "F/2.8, SS 1000, ISO 100, EV 0, GPS (-74.006, 40.7128, 15), D 10.2m, H 10.0m, H.S 0.0m/s",
        "HOME(-74.01,40.71) 2017.05.04 09:10:11\nGPS(-74.006,40.7128,15) BAROMETER:9.1\nISO:100 Shutter:60 Fnum:2.2",
    ],
)
def test_older_drones_write_the_longitude_first(said: str) -> None:
    facts, gimbal = subtitle_metadata(f"1\n00:00:00,000 --> 00:00:01,000\n{said}\n", 1920, 1080)
    assert (facts.latitude, facts.longitude) == (40.7128, -74.006)
    assert facts.local_time == (datetime(2017, 5, 4, 9, 10, 11) if "HOME" in said else None)
    assert (facts.focal_length, len(gimbal.time)) == (None, 0)


def test_subtitles_for_viewers_say_nothing() -> None:
    facts, gimbal = subtitle_metadata("1\n00:00:00,000 --> 00:00:02,000\nHello: 3 friends\n", 640, 360)
    assert facts.latitude is None
    assert len(gimbal.time) == 0


def test_gimbal_angles_out_of_order_are_not_believed() -> None:
    first, second = DJI.split("\n\n")
    _, gimbal = subtitle_metadata(f"{second}\n\n{first}", 640, 360)
    assert len(gimbal.time) == 0
    np.testing.assert_equal(gimbal.at(1.0), None)


def test_facts_are_merged_whole() -> None:
    drone, _ = subtitle_metadata(DJI, 1920, 1080)
    box = container_metadata({"location": "+10+010/", "creation_time": "2020-01-01T00:00:00Z"}, 1920, 1080)
    merged = merge_metadata(drone, box)
    assert merged.latitude == 48.1375
    assert merged.utc_offset is None  # the drone's clock, not half of each
