"""Lenses by focal lengths and sensors, and what crops leave of them."""

import math

import pytest
from PIL import ExifTags

from lighting.photo.lens import PhotoFrame, PhotoLens, read_lens, vertical_fov_from_focal_length
from lighting.photo.tags import Tags

BASE = ExifTags.Base
CRS, GPANO, EXIF = (
    "http://ns.adobe.com/camera-raw-settings/1.0",
    "http://ns.google.com/photos/1.0/panorama",
    "http://ns.adobe.com/exif/1.0",
)
FRAME = PhotoFrame(448, 336, is_turned=False)


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
