"""What files say of a camera: lenses by focal lengths and sensors, what crops leave of them, and tilts."""

import math
import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from lighting.geometry import camera_axes
from lighting.photo.camera import PhotoFrame, PhotoLens, read_lens, vertical_fov_from_focal_length
from lighting.photo.imu import _rotate_to_upright
from lighting.photo.metadata import PhotoMetadata, read_metadata
from lighting.photo.pixels import upright_pixels
from lighting.photo.reader import read_photo
from lighting.photo.tags import Tags, read_tags
from tests.conftest import encode, exif, munich, scene
from tests.helpers.photos import BASE, DJI, FRONT, PIX4D, apple_note, drone, note_of, packet, phone, with_note, with_xmp

CRS, GPANO, EXIF = (
    "http://ns.adobe.com/camera-raw-settings/1.0",
    "http://ns.google.com/photos/1.0/panorama",
    "http://ns.adobe.com/exif/1.0",
)
FRAME = PhotoFrame(448, 336, is_turned=False)
LYING, STANDING = scene(160, 120), scene(120, 160)
SIN_20, COS_20 = math.sin(math.radians(20)), math.cos(math.radians(20))
SIN_10, COS_10 = math.sin(math.radians(10)), math.cos(math.radians(10))
ABSENT = PhotoMetadata()
GOOD = apple_note(0.0, -1.0, 0.0)


def camera(width: int = 448, height: int = 336, **values: float) -> Tags:
    sizes: dict[int, float] = {BASE.ExifImageWidth: width, BASE.ExifImageHeight: height}
    return sizes | {int(getattr(BASE, name)): value for name, value in values.items()}


def cropped(left: float, top: float, right: float, bottom: float, **settings: str) -> dict[str, str]:
    sides = {"CropLeft": left, "CropTop": top, "CropRight": right, "CropBottom": bottom}
    values = {"HasCrop": "True", **{name: str(side) for name, side in sides.items()}, **settings}
    return {f"{CRS} {name}": value for name, value in values.items()}


def fov_of(lens: PhotoLens) -> float:
    (fov,) = lens.vertical_fovs
    return fov


def test_a_35_mm_value_by_exif_or_by_xmp() -> None:
    expected = vertical_fov_from_focal_length(26, 448, 336)
    assert fov_of(read_lens({}, camera(FocalLengthIn35mmFilm=26), {}, FRAME)) == expected
    assert fov_of(read_lens({}, camera(), {f"{EXIF} FocalLengthIn35mmFilm": "26"}, FRAME)) == expected


@pytest.mark.parametrize(("unit", "resolution"), [(2, 5904.646), (3, 2324.664), (4, 232.4664)])
def test_a_sensor_by_its_resolution_on_the_focal_plane(unit: int, resolution: float) -> None:
    """Canon's APS-C sensor, 22.3 mm wide, at 10 mm."""
    values = {
        "FocalPlaneXResolution": resolution,
        "FocalPlaneYResolution": resolution,
        "FocalPlaneResolutionUnit": unit,
    }
    lens = read_lens({}, camera(5184, 2916, FocalLength=10.0, **values), {}, PhotoFrame(448, 252, is_turned=False))
    assert fov_of(lens) == pytest.approx(2 * math.degrees(math.atan(0.5 * 22.3 * 9 / 16 / 10.0)), abs=0.05)
    assert lens.is_consistent


def test_a_sensor_that_no_camera_has_is_none() -> None:
    values = {"FocalPlaneXResolution": 5904.646, "FocalPlaneResolutionUnit": 2}
    assert read_lens({}, camera(448, 252, FocalLength=10.0, **values), {}, FRAME).vertical_fovs == ()


@pytest.mark.parametrize(
    ("values", "is_consistent"),
    [
        ({"FocalLengthIn35mmFilm": 26, "FocalLength": 4.25}, True),
        ({"FocalLengthIn35mmFilm": 177}, False),
        ({"FocalLengthIn35mmFilm": 177, "FocalLength": 4.25}, False),  # a crop factor of 42
        ({"FocalLengthIn35mmFilm": 177, "FocalLength": 4.25, "DigitalZoomRatio": 5.0}, True),
    ],
)
def test_whether_a_file_agrees_with_itself(values: dict[str, float], is_consistent: bool) -> None:
    assert read_lens({}, camera(448, 336, **values), {}, FRAME).is_consistent == is_consistent


def test_a_crop_of_lightroom_has_a_longer_lens() -> None:
    """And, off the middle, no tilt; one that is not applied has none of both."""
    values = camera(FocalLengthIn35mmFilm=19)
    half = read_lens({}, values, cropped(0.25, 0.25, 0.75, 0.75), FRAME)
    assert fov_of(half) == pytest.approx(vertical_fov_from_focal_length(38, 448, 336))
    assert half.is_whole
    corner = read_lens({}, values, cropped(0.0, 0.0, 0.5, 0.5), FRAME)
    assert fov_of(corner) == pytest.approx(fov_of(half))
    assert not corner.is_whole
    later = read_lens({}, values, cropped(0.25, 0.25, 0.75, 0.75, AlreadyApplied="False"), FRAME)
    assert fov_of(later) == pytest.approx(vertical_fov_from_focal_length(19, 448, 336))


def test_a_crop_of_another_shape_counts_by_the_whole_s_diagonal() -> None:
    """The middle square of 4:3 at full height keeps the vertical field of view."""
    square = PhotoFrame(336, 336, is_turned=False)
    lens = read_lens({}, camera(336, 336, FocalLengthIn35mmFilm=19), cropped(0.125, 0.0, 0.875, 1.0), square)
    assert fov_of(lens) == pytest.approx(vertical_fov_from_focal_length(19, 448, 336))


@pytest.mark.parametrize(
    ("size", "sides"),
    [
        ((336, 252), (0.21875, 0.0, 0.78125, 1.0)),  # of 336 x 448
        ((336, 420), (0.03125, 0.0, 0.96875, 1.0)),  # 4:5 of 3:4
        ((252, 336), (0.125, 0.125, 0.875, 0.875)),
    ],
)
def test_the_sides_of_a_crop_may_be_those_of_the_sensor_of_a_turned_photo(
    size: tuple[int, int], sides: tuple[float, float, float, float]
) -> None:
    """Turned is what makes the whole 3:4."""
    settings = camera(*size, FocalLengthIn35mmFilm=26)
    lens = read_lens({}, settings, cropped(*sides), PhotoFrame(*size, is_turned=False))
    share = sides[2] - sides[0]  # of the sensor's width, which is the photo's height
    whole = vertical_fov_from_focal_length(26, 336, 448)
    expected = 2 * math.degrees(math.atan(share * math.tan(math.radians(whole) / 2)))
    assert fov_of(lens) == pytest.approx(expected)


def test_a_turn_of_lightroom_turns_the_roll() -> None:
    lens = read_lens({}, camera(FocalLengthIn35mmFilm=19), cropped(0.1, 0.1, 0.9, 0.9, CropAngle="-7"), FRAME)
    assert lens.turn == 7.0


@pytest.mark.parametrize("turn", [6.0, -11.0])
def test_a_turned_crop_may_state_two_corners_of_its_rectangle(turn: float) -> None:
    """Its whole is the sensor's shape, which sides along the rows would not give."""
    width, height, share = 4000, 2250, 0.7
    cosine, sine = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    across, along = share * (cosine * width - sine * height), share * (sine * width + cosine * height)
    sides = ((1 - across / width) / 2, (1 - along / height) / 2, (1 + across / width) / 2, (1 + along / height) / 2)
    settings = cropped(*sides, CropAngle=f"{-turn:g}")
    frame = PhotoFrame(round(share * width), round(share * height), is_turned=False)
    lens = read_lens({}, camera(frame.width, frame.height, FocalLengthIn35mmFilm=19), settings, frame)
    assert fov_of(lens) == pytest.approx(vertical_fov_from_focal_length(19 / share, width, height), abs=0.05)


def test_digital_zoom_is_open_but_of_apple_s_cameras() -> None:
    values = camera(FocalLengthIn35mmFilm=17, DigitalZoomRatio=2.0)
    once, twice = (vertical_fov_from_focal_length(length, 448, 336) for length in (17, 34))
    assert read_lens({}, values, {}, FRAME).vertical_fovs == (once, twice)
    in_xmp = {f"{EXIF} DigitalZoomRatio": "20/10"}
    assert read_lens({}, camera(FocalLengthIn35mmFilm=17), in_xmp, FRAME).vertical_fovs == (once, twice)
    assert read_lens({BASE.Make: "Apple"}, values, {}, FRAME).vertical_fovs == (once,)


def test_upright_pictures_of_level_frames() -> None:
    """Turned, cut at the full height, or, after resizing, either of the two."""
    turned, in_level = (vertical_fov_from_focal_length(19, *size) for size in ((480, 640), (640, 480)))
    values = camera(640, 480, FocalLengthIn35mmFilm=19)
    assert read_lens({}, values, {}, PhotoFrame(480, 640, is_turned=False)).vertical_fovs == (turned,)
    assert read_lens({}, values, {}, PhotoFrame(480, 640, is_turned=True)).vertical_fovs == (turned,)
    assert read_lens({}, values, {}, PhotoFrame(360, 480, is_turned=False)).vertical_fovs == pytest.approx((in_level,))
    both = read_lens({}, values, {}, PhotoFrame(336, 448, is_turned=False)).vertical_fovs
    assert both == pytest.approx((turned, in_level))


def test_other_crops() -> None:
    """A strip at the full width has the whole's focal length in pixels; of a resized one nothing is known."""
    values = camera(640, 480, FocalLengthIn35mmFilm=19)
    whole = math.tan(math.radians(vertical_fov_from_focal_length(19, 640, 480) / 2))
    (fov,) = read_lens({}, values, {}, PhotoFrame(640, 320, is_turned=False)).vertical_fovs
    assert math.tan(math.radians(fov / 2)) == pytest.approx(whole * 320 / 480)
    resized = read_lens({}, values, {}, PhotoFrame(500, 250, is_turned=False))
    assert resized.vertical_fovs == ()
    assert not resized.is_whole


def test_a_photo_inside_a_border_has_the_lens_of_its_own_shape() -> None:
    """Even where a program rewrote the size of the whole."""
    values = camera(448, 448, FocalLengthIn35mmFilm=26)
    inside = PhotoFrame(448, 336, is_turned=False, is_inside=True)
    assert fov_of(read_lens({}, values, {}, inside)) == vertical_fov_from_focal_length(26, 448, 336)


def panorama(width: int, height: int, whole: int, kind: str = "equirectangular") -> dict[str, str]:
    values = {"ProjectionType": kind, "FullPanoWidthPixels": whole, "CroppedAreaImageWidthPixels": width}
    values["CroppedAreaImageHeightPixels"] = height
    return {f"{GPANO} {name}": str(value) for name, value in values.items()}


def test_panoramas_have_no_lens_but_narrow_ones_have_that_of_their_part() -> None:
    wide = read_lens({}, camera(FocalLengthIn35mmFilm=26), panorama(640, 140, 640), FRAME)
    assert wide.is_panorama
    assert wide.vertical_fovs == ()
    narrow = read_lens({}, camera(FocalLengthIn35mmFilm=26), panorama(1000, 750, 6000), FRAME)
    assert not narrow.is_panorama
    assert fov_of(narrow) == 45.0
    strip = PhotoFrame(672, 173, is_turned=False)
    by_phone = read_lens({BASE.Make: "Apple"}, camera(672, 173, FocalLengthIn35mmFilm=26, CustomRendered=6), {}, strip)
    assert by_phone.is_panorama
    by_another = read_lens({}, camera(672, 173, FocalLengthIn35mmFilm=26), {}, strip)
    assert by_another.is_panorama
    assert by_another.vertical_fovs == ()
    assert not read_lens(
        {}, camera(672, 448, FocalLengthIn35mmFilm=26), {}, strip
    ).is_panorama  # but a strip of a photo
    assert read_lens({}, {}, {f"{GPANO} UsePanoramaViewer": "True"}, strip).is_panorama


@pytest.mark.parametrize("value", ["", "x", "1/0", "nan", "-0.5"])
def test_damaged_settings_raise_nothing(value: str) -> None:
    crop = cropped(0.1, 0.1, 0.9, 0.9) | {f"{CRS} CropLeft": value}
    assert not read_lens({}, camera(FocalLengthIn35mmFilm=26), crop, FRAME).is_whole
    read_lens({}, camera(FocalLengthIn35mmFilm=26), {f"{GPANO} FullPanoWidthPixels": value}, FRAME)


def metadata_of(
    block: Image.Exif | None = None, xmp: bytes = b"", picture: Any = LYING, kind: str = "JPEG"
) -> PhotoMetadata:
    options = {} if block is None else {"exif": block.tobytes()}
    return read_photo(encode(picture, kind, **options, **(with_xmp(xmp, kind) if xmp else {}))).metadata


def tilt(metadata: PhotoMetadata) -> Any:
    return metadata.camera_elevation, metadata.camera_roll


# The phone's axes: x to the right of its screen, y to its top, z out of the screen; the vector is that of gravity.


@pytest.mark.parametrize(
    ("vector", "orientation", "elevation", "roll"),
    [
        ((0.0, -1.0, 0.0), 6, 0.0, 0.0),  # upright
        ((-1.0, 0.0, 0.0), 1, 0.0, 0.0),  # lying, the home button on the right
        ((1.0, 0.0, 0.0), 3, 0.0, 0.0),  # lying, the home button on the left
        ((0.0, 1.0, 0.0), 8, 0.0, 0.0),  # upside down
        ((0.0, -COS_20, SIN_20), 6, 20.0, 0.0),  # upright, tilted up: the screen looks down
        ((-COS_20, 0.0, SIN_20), 1, 20.0, 0.0),
        ((0.0, -COS_20, -SIN_20), 6, -20.0, 0.0),
        ((SIN_10, -COS_10, 0.0), 6, 0.0, 10.0),  # turned clockwise, as seen from behind: its right side is the lower
        ((-COS_10, -SIN_10, 0.0), 1, 0.0, 10.0),  # lying: its foot, which is on the right, is the lower
        ((COS_10, SIN_10, 0.0), 3, 0.0, 10.0),
        ((-SIN_10, COS_10, 0.0), 8, 0.0, 10.0),
    ],
)
def test_how_a_phone_was_held(
    vector: tuple[float, float, float], orientation: int, elevation: float, roll: float
) -> None:
    metadata = metadata_of(phone(*vector, orientation))
    assert tilt(metadata) == pytest.approx((elevation, roll), abs=0.02)
    assert metadata.gravity_source == "accelerometer"
    assert metadata.gravity_spread == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(
    ("vector", "orientation", "elevation", "roll"),
    [
        # An iPhone 13 Pro, pug.heic of pillow-heif's tests: a door's edge leans to the right and inwards, upwards.
        ((-3797 / 4096, -16205 / 207173, 25066 / 67441), 1, 21.8, 4.8),
        # An iPhone 13 Pro, iPhone 15 Pro and iPhone 7 Plus, as exiftool and Apple's own tools print them.
        ((-0.04817617, -0.9013979, -0.4217527), 6, -25.0, -3.1),
        ((-0.998894095, -0.03494079414, 0.1559448392), 1, 8.9, 2.0),
        ((0.1813890762, -0.8817955112, -0.4300854701), 6, -25.5, 11.6),
    ],
)
def test_real_phones(vector: tuple[float, float, float], orientation: int, elevation: float, roll: float) -> None:
    assert tilt(metadata_of(phone(*vector, orientation))) == pytest.approx((elevation, roll), abs=0.1)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_up_turns_as_the_pixels_do(orientation: int) -> None:
    """The gradient of a picture's red and green is a vector in the picture too."""
    stored = Image.fromarray(LYING)  # red grows to the right, green downwards
    shown = upright_pixels(stored, 160, orientation).astype(float)
    for channel, vector in ((0, (1.0, 0.0, 0.5)), (1, (0.0, -1.0, 0.5))):
        right, down = np.diff(shown[..., channel], axis=1).mean(), np.diff(shown[..., channel], axis=0).mean()
        expected = np.array([right, -down]) / np.hypot(right, down)
        assert _rotate_to_upright(vector, orientation) == pytest.approx((*expected, 0.5), abs=0.01)


def test_pixels_that_a_program_turned_upright() -> None:
    """It writes orientation 1, or none, and keeps the note."""
    for orientation in (None, 1):
        upright = metadata_of(phone(SIN_10, -COS_10, 0.0, orientation), picture=STANDING)
        assert tilt(upright) == pytest.approx((0.0, 10.0), abs=0.02)
        half_turn = metadata_of(phone(COS_10, SIN_10, 0.0, orientation))
        assert tilt(half_turn) == pytest.approx((0.0, 10.0), abs=0.02)
    on_its_side = metadata_of(phone(0.0, -1.0, 0.0, 1))
    assert abs(on_its_side.camera_roll or 0.0) == pytest.approx(90.0)


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "WEBP", "TIFF", "HEIF", "AVIF"])
def test_a_phone_in_every_kind_of_file(kind: str) -> None:
    """Those of HEIF and AVIF turn the pixels as they decode and say orientation 1."""
    metadata = metadata_of(phone(0.0, -COS_20, SIN_20, 6), kind=kind)
    assert tilt(metadata) == pytest.approx((20.0, 0.0), abs=0.02)


@pytest.mark.parametrize(("z", "elevation"), [(-1.0, -90.0), (1.0, 90.0)])
def test_a_camera_that_looks_straight_down_or_up_has_no_roll(z: float, elevation: float) -> None:
    assert tilt(metadata_of(phone(0.02, -0.02, z, 6))) == (pytest.approx(elevation, abs=2.0), None)


def test_a_shaken_phone_is_less_sure_or_says_nothing() -> None:
    shaken = metadata_of(phone(0.0, -1.05, 0.0, 6))
    assert shaken.gravity_spread == pytest.approx(math.hypot(1.0, math.degrees(0.05)), abs=0.01)
    for size in (0.85, 1.15, 0.0, 100_000.0):
        assert metadata_of(phone(0.0, -size, 0.0, 6)) == metadata_of(phone(0.0, 0.0, 0.0))


def test_only_the_back_camera_counts() -> None:
    def known(**said: Any) -> bool:
        return metadata_of(phone(0.0, -1.0, 0.0, 6, **said)).camera_elevation is not None

    assert known()
    assert known(lens="iPhone X Rückkamera", front=0)
    assert not known(lens=FRONT)
    assert not known(lens=FRONT, front=0)
    assert not known(front=1)
    assert not known(lens="iPhone X Rückkamera")
    assert not known(lens="")


def test_a_crop_does_not_say_how_the_camera_was_held() -> None:
    for noted, known in (((4032, 3024), True), ((4032, 2268), False)):
        block = phone(-1.0, 0.0, 0.0, 1)
        block.get_ifd(0x8769).update({BASE.ExifImageWidth: noted[0], BASE.ExifImageHeight: noted[1]})
        assert (metadata_of(block).camera_elevation is not None) is known


# Drones


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "WEBP", "TIFF", "HEIF", "AVIF"])
@pytest.mark.parametrize("elements", [False, True])
def test_a_gimbal_in_every_kind_of_file(kind: str, elements: bool) -> None:
    metadata = metadata_of(xmp=drone("-20.40", "+10.00", "-90.50", elements), kind=kind)
    assert tilt(metadata) == pytest.approx((-20.4, 10.0))
    assert (metadata.gravity_source, metadata.gravity_spread) == ("gimbal", 1.0)
    assert (metadata.heading, metadata.heading_reference) == (269.5, "true")


@pytest.mark.parametrize(("pitch", "roll"), [(35.0, 0.0), (-60.0, 8.0), (5.0, -30.0)])
def test_a_gimbals_angles_are_those_of_the_camera(pitch: float, roll: float) -> None:
    metadata = metadata_of(xmp=drone(f"{pitch:+.2f}", f"{roll:+.2f}"))
    assert metadata.camera_elevation is not None
    assert metadata.camera_roll is not None
    found = camera_axes(0.0, metadata.camera_elevation, metadata.camera_roll)
    assert found == pytest.approx(camera_axes(0.0, pitch, roll), abs=1e-6)


def test_a_drone_that_looks_down() -> None:
    """Its heading is where the picture's upper edge lies; DJI's gimbals may say the same with a roll of 180 deg."""
    for pitch, roll, yaw in (
        ("-90.00", "+0.00", "+30.00"),
        ("-90.00", "+180.00", "-150.00"),
        ("-90.10", "+0.00", "+30.00"),
    ):
        metadata = metadata_of(xmp=drone(pitch, roll, yaw))
        assert tilt(metadata) == (pytest.approx(-90.0, abs=0.2), None)
        assert metadata.heading == pytest.approx(30.0)


def test_the_compass_of_exif_comes_first() -> None:
    metadata = metadata_of(munich(), drone("-20.00"))
    assert (metadata.heading, metadata.heading_reference) == (60.0, "magnetic")
    assert metadata.camera_elevation == pytest.approx(-20.0)


@pytest.mark.parametrize(
    ("pitch", "elevation"), [("90", 0.0), ("0", -90.0), ("60.5", -29.5), ("105", 15.0), ("-30", None), ("200", None)]
)
def test_pix4d_counts_pitch_from_straight_down(pitch: str, elevation: float | None) -> None:
    metadata = metadata_of(xmp=packet(PIX4D, {"Pitch": pitch, "Roll": "0", "Yaw": "12.5"}))
    assert metadata.camera_elevation == (None if elevation is None else pytest.approx(elevation))
    assert metadata.heading == 12.5


# EXIF


@pytest.mark.parametrize("angle", [-33.5, 0.0, 90.0])
def test_the_elevation_angle_of_exif(angle: float) -> None:
    metadata = metadata_of(exif({BASE.CameraElevationAngle: IFDRational(int(10 * angle), 10)}))
    assert tilt(metadata) == (pytest.approx(angle), None)
    assert metadata.gravity_source == "elevation angle"


def test_the_accelerometer_comes_first() -> None:
    block = phone(0.0, -COS_20, SIN_20, 6)
    block.get_ifd(0x8769)[BASE.CameraElevationAngle] = IFDRational(-5, 1)
    assert metadata_of(block, drone("-40.00")).camera_elevation == pytest.approx(20.0, abs=0.02)


# Hostile input


@pytest.mark.parametrize(
    "note",
    [
        b"",
        b"Apple iOS\0",
        GOOD[:14],
        GOOD[:30],
        GOOD[:-1],
        GOOD.replace(b"MM", b"II"),
        b"Apple iOS\0\0\x01MM\xff\xff",
        b"Apple iOS\0\0\x01MM\xff\xff" + bytes(100),
        GOOD[:14] + struct.pack(">HHHII", 1, 8, 10, 3, 0xFFFFFFFF),  # far outside
        GOOD[:14] + struct.pack(">HHHII", 1, 8, 10, 0xFFFFFFFF, 16),
        GOOD[:14] + struct.pack(">HHHII", 1, 8, 5, 3, 16) + bytes(40),
        note_of(struct.pack(">6i", 0, 0, 0, 0, 0, 0)),
        note_of(struct.pack(">6i", 0, 1, -1, 0, 0, 1)),
        note_of(struct.pack(">6i", -(2**31), 1, 2**31 - 1, 1, 0, 1)),
    ],
)
def test_a_damaged_note_counts_as_absent(note: bytes) -> None:
    assert metadata_of(with_note(note, 1)) == ABSENT


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "361", "1e400", "", "level", "-90.00 0"])
def test_impossible_gimbals_count_as_absent(value: str) -> None:
    for angles in ((value, "0.1", "0.1"), ("0.1", value, "0.1"), ("0.1", "0.1", value)):
        assert metadata_of(xmp=drone(*angles)) == ABSENT
    assert metadata_of(xmp=drone("+0.00", "+0.00", "+0.00")) == ABSENT  # nothing measured it


@pytest.mark.parametrize(
    "angle",
    [
        IFDRational(20, -1),
        IFDRational(0, 0),
        IFDRational(91, 1),
        IFDRational(-(2**31), 1),
        math.nan,
        "up",
        b"",
        (1, 2),
        None,
    ],
)
def test_an_impossible_elevation_angle_counts_as_absent(angle: object) -> None:
    image = Image.fromarray(LYING)
    block = exif({BASE.CameraElevationAngle: angle})
    image.getexif = lambda: block  # type: ignore[method-assign]  # what a file cannot hold as such
    assert read_metadata(read_tags(image), 160, 120) == ABSENT


@given(note=st.binary(max_size=120), orientation=st.integers(-3, 300) | st.none())
def test_no_note_whatever_raises(note: bytes, orientation: int | None) -> None:
    image = Image.fromarray(LYING)
    block = with_note(b"Apple iOS\0\0\x01MM" + note, orientation)
    image.getexif = lambda: block  # type: ignore[method-assign]
    metadata = read_metadata(read_tags(image), 160, 120)
    assert metadata.camera_elevation is None or -90.0 <= metadata.camera_elevation <= 90.0


@pytest.mark.parametrize(
    ("written", "height"),
    [("+63.10", 63.1), ("120", 120.0), ("+0.00", None), ("-3.2", None), ("nan", None), ("high", None), ("1e9", None)],
)
def test_a_drones_height_over_its_place_of_take_off_is_read(written: str, height: float | None) -> None:
    assert metadata_of(xmp=packet(DJI, {"RelativeAltitude": written})).camera_height == height
