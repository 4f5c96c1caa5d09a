"""Borders and collages: what lies inside is found, and photos without a border are left alone."""

from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import ExifTags, Image, ImageDraw, ImageFilter

from lighting.errors import warning_code
from lighting.photo.borders import Rectangle, find_layout
from lighting.photo.camera import vertical_fov_from_focal_length
from lighting.photo.metadata import PhotoMetadata
from lighting.photo.reader import PhotoCrop, photo_from_array, read_photo
from tests.conftest import encode, exif

EXAMPLES = Path(__file__).parents[3] / "examples"
NAMES = ("wide_street", "railway_field", "park_evening", "snow_field", "garden_noon")

Corners = tuple[float, float, float, float]
Framed = tuple[Image.Image, Corners]


def example(name: str = "wide_street", width: int = 480) -> Image.Image:
    with Image.open(EXAMPLES / f"{name}.jpg") as image:
        return image.convert("RGB").resize((width, width * image.height // image.width))


def as_jpeg(image: Image.Image, quality: int) -> np.ndarray:
    stream = BytesIO()
    image.save(stream, "JPEG", quality=quality)
    return np.asarray(Image.open(stream))


def framed(photo: Image.Image, color: tuple[int, int, int], left: int, top: int, right: int, bottom: int) -> Framed:
    """The photo with margins of one color."""
    whole = Image.new("RGB", (photo.width + left + right, photo.height + top + bottom), color)
    whole.paste(photo, (left, top))
    return whole, (left, top, left + photo.width, top + photo.height)


def story(photo: Image.Image, background: Image.Image) -> Framed:
    """The photo in the middle of an upright picture."""
    top = (background.height - photo.height) // 2
    background.paste(photo, (0, top))
    return background, (0, top, photo.width, top + photo.height)


def blurred(photo: Image.Image, brightness: float = 1.0) -> Framed:
    """Between blurred copies of itself, perhaps darker ones."""
    height = photo.width * 16 // 9
    enlarged = photo.resize((photo.width * height // photo.height, height)).filter(ImageFilter.GaussianBlur(15))
    left = (enlarged.width - photo.width) // 2
    background = enlarged.crop((left, 0, left + photo.width, height))
    return story(photo, Image.eval(background, lambda value: int(brightness * value)))


def on_gradient(photo: Image.Image) -> Framed:
    rows = np.linspace((40, 90, 200), (230, 120, 60), photo.width * 16 // 9)
    return story(photo, Image.fromarray(np.tile(rows[:, None], (1, photo.width, 1)).astype(np.uint8)))


def story_with_texts(photo: Image.Image) -> Framed:
    """On a gradient, with a title above and a name below."""
    whole, corners = on_gradient(photo)
    draw = ImageDraw.Draw(whole)
    draw.text((80, 120), "Summer in town", fill=WHITE, font_size=36)
    draw.text((80, whole.height - 140), "@someone", fill=WHITE, font_size=28)
    return whole, corners


def film(photo: Image.Image) -> Framed:
    """With the perforation of a film above and below, which is the same in both halves."""
    whole, corners = framed(photo, (20, 20, 20), 0, 60, 0, 60)
    draw = ImageDraw.Draw(whole)
    for left in range(10, whole.width, 40):
        for top in (15, whole.height - 45):
            draw.rounded_rectangle((left, top, left + 24, top + 30), 6, fill=(240, 240, 235))
    return whole, corners


def screenshot(photo: Image.Image, color: tuple[int, int, int], ink: tuple[int, int, int], rounded: bool) -> Framed:
    """A phone's gallery with its clock and buttons."""
    height = photo.width * 19 // 9
    whole = Image.new("RGB", (photo.width + 40 * rounded, height), color)
    draw = ImageDraw.Draw(whole)
    draw.text((30, 15), "18:49", fill=ink, font_size=20)
    draw.text((photo.width // 2 - 50, 60), "Saturday 18:49", fill=ink, font_size=18)
    for k in range(5):
        draw.ellipse((30 + 90 * k, height - 90, 60 + 90 * k, height - 60), outline=ink, width=3)
    left, top = 20 * rounded, (height - photo.height) // 2 - 30
    mask = Image.new("L", photo.size, 0)
    ImageDraw.Draw(mask).rounded_rectangle((0, 0, photo.width - 1, photo.height - 1), 20 * rounded, fill=255)
    whole.paste(photo, (left, top), mask)
    return whole, (left, top, left + photo.width, top + photo.height)


def window(photo: Image.Image) -> Framed:
    """A viewer's window with a title above and the desktop's buttons below."""
    whole, corners = framed(photo, (32, 33, 36), 120, 50, 120, 60)
    draw = ImageDraw.Draw(whole)
    draw.rectangle((0, 0, whole.width, 24), fill=(222, 225, 230))
    draw.text((30, 5), "photo.jpg - Photos", fill=(60, 60, 60))
    draw.rectangle((0, whole.height - 30, whole.width, whole.height), fill=(16, 16, 20))
    for k in range(6):
        left, top = whole.width // 3 + 30 * k, whole.height - 24
        draw.rectangle((left, top, left + 18, top + 18), fill=(80 + 20 * k, 120, 200 - 20 * k))
    return whole, corners


def foot(photo: Image.Image) -> Framed:
    """With a white foot that names the phone."""
    whole, corners = framed(photo, (255, 255, 255), 0, 0, 0, 50)
    ImageDraw.Draw(whole).text((15, photo.height + 15), "PHONE 12   26mm f/1.8 1/1200s", fill=(0, 0, 0), font_size=16)
    return whole, corners


def stereo(photo: Image.Image, *, over: bool) -> Framed:
    """Two views, the second one shifted."""
    size = (photo.width, 2 * photo.height) if over else (2 * photo.width, photo.height)
    whole = Image.new("RGB", size)
    whole.paste(photo, (0, 0))
    second = photo.crop((8, 0, photo.width, photo.height)).resize(photo.size)
    whole.paste(second, (0, photo.height) if over else (photo.width, 0))
    return whole, (0, 0, photo.width, photo.height)


BLACK, WHITE, PAPER = (0, 0, 0), (255, 255, 255), (247, 246, 241)
BORDERS: dict[str, Callable[[Image.Image], Framed]] = {
    "letterbox": lambda photo: framed(photo, BLACK, 0, 45, 0, 45),
    "unequal bars": lambda photo: framed(photo, BLACK, 0, 90, 0, 30),
    "thin bars": lambda photo: framed(photo, BLACK, 0, 5, 0, 5),
    "pillarbox": lambda photo: framed(photo, BLACK, 80, 0, 80, 0),
    "bars of a color": lambda photo: framed(photo, (60, 110, 170), 0, 60, 0, 60),
    "white frame": lambda photo: framed(photo, WHITE, 20, 20, 20, 20),
    "instant film": lambda photo: framed(photo, PAPER, 20, 20, 20, 90),
    "dark screenshot": lambda photo: screenshot(photo, (12, 12, 14), (230, 230, 230), rounded=False),
    "light screenshot, round corners": lambda photo: screenshot(photo, (250, 250, 252), (30, 30, 30), rounded=True),
    "window of a desktop": window,
    "blurred copies": blurred,
    "gradient": on_gradient,
    "foot": foot,
    "side by side": lambda photo: stereo(photo, over=False),
    "over and under": lambda photo: stereo(photo, over=True),
}


@pytest.mark.parametrize("kind", BORDERS)
@pytest.mark.parametrize(("name", "quality"), [("wide_street", 60), ("snow_field", 90)])
def test_what_lies_inside_a_border_is_found(kind: str, name: str, quality: int) -> None:
    whole, corners = BORDERS[kind](example(name))
    layout = find_layout(as_jpeg(whole, quality))
    assert layout.photo is not None
    assert not layout.is_collage
    assert layout.photo.pixels(*whole.size) == pytest.approx(corners, abs=0.012 * max(whole.size))


@pytest.mark.parametrize(
    ("draw", "name"), [(story_with_texts, "wide_street"), (story_with_texts, "railway_field"), (film, "park_evening")]
)
def test_texts_and_perforations_lie_outside(draw: Callable[[Image.Image], Framed], name: str) -> None:
    whole, corners = draw(example(name))
    layout = find_layout(as_jpeg(whole, 85))
    assert layout.photo is not None
    assert layout.photo.pixels(*whole.size) == pytest.approx(corners, abs=0.012 * max(whole.size))


def test_a_collage_may_have_one_large_photo() -> None:
    whole = Image.new("RGB", (620, 420), WHITE)
    for name, box in zip(NAMES, ((10, 10, 400, 400), (420, 10, 190, 195), (420, 215, 190, 195)), strict=False):
        whole.paste(example(name).resize(box[2:]), box[:2])
    assert find_layout(as_jpeg(whole, 80)).is_collage


@pytest.mark.parametrize("name", ["railway_field", "garden_noon"])
def test_of_dark_blurred_copies_one_may_be_plain(name: str) -> None:
    whole, corners = blurred(example(name), 0.5)
    layout = find_layout(as_jpeg(whole, 85))
    assert layout.photo is not None
    assert layout.photo.pixels(*whole.size) == pytest.approx(corners, abs=0.012 * max(whole.size))


@pytest.mark.parametrize("name", ["wide_street", "railway_field"])
def test_a_band_below_leaves_the_sky_above(name: str) -> None:
    photo = example(name)
    whole = Image.new("RGB", (photo.width, photo.height * 8 // 7), (20, 30, 120))  # of news, or of a dashboard's camera
    whole.paste(photo)
    layout = find_layout(as_jpeg(whole, 85))
    assert layout.photo is not None
    corners = (0, 0, photo.width, photo.height)
    assert layout.photo.pixels(*whole.size) == pytest.approx(corners, abs=0.012 * max(whole.size))


@pytest.mark.parametrize(("columns", "rows"), [(2, 1), (1, 2), (3, 1), (2, 2), (3, 2)])
@pytest.mark.parametrize("gap", [0, 8])
def test_a_collage_is_none_of_its_photos(columns: int, rows: int, gap: int) -> None:
    width, height = (600 - gap * (columns - 1)) // columns, (600 - gap * (rows - 1)) // rows
    whole = Image.new("RGB", (columns * (width + gap) - gap, rows * (height + gap) - gap), WHITE)
    for cell in range(columns * rows):
        column, row = cell % columns, cell // columns
        part = example(NAMES[cell % len(NAMES)], 700).resize((width, height))
        whole.paste(part, (column * (width + gap), row * (height + gap)))
    assert find_layout(as_jpeg(whole, 80)).is_collage


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.jpg")), ids=lambda path: path.stem)
def test_a_photo_without_a_border_is_left_alone(path: Path) -> None:
    photo = read_photo(path)
    assert photo.crop is None
    assert not photo.is_collage
    assert not photo.warnings


def test_skies_of_one_color_are_no_bars() -> None:
    """White skies and nights end at a skyline, which is not as straight as a bar."""
    street = np.asarray(example(width=512)).copy()
    skyline = (90 + 12 * np.sin(np.arange(512) / 25.0)).astype(int)
    for level in (255, 0):
        street[np.arange(len(street))[:, None] < skyline] = level
        assert find_layout(as_jpeg(Image.fromarray(street), 80)).photo is None


def test_the_photo_inside_has_its_own_size_pixels_lens_and_a_warning() -> None:
    whole, corners = framed(example(), BLACK, 0, 45, 0, 45)
    pixels = np.asarray(whole)
    photo = photo_from_array(pixels, PhotoMetadata(vertical_fov=60.0))
    left, top, right, bottom = map(int, corners)
    assert (photo.width, photo.height) == (right - left, bottom - top)
    assert photo.crop == PhotoCrop(left, top, right - left, bottom - top, whole.width, whole.height)
    np.testing.assert_array_equal(photo.pixels, pixels[top:bottom, left:right])
    share = (bottom - top) / len(pixels)
    expected = 2 * np.degrees(np.arctan(share * np.tan(np.radians(30.0))))
    assert photo.metadata.vertical_fov == pytest.approx(expected)
    (warning,) = photo.warnings
    assert warning_code(warning) == "border"
    assert f"{photo.width} x {photo.height} pixels" in warning


def test_a_rectangle_in_pixels_lies_within_its_shares() -> None:
    assert Rectangle(0.1, 0.0, 0.95, 1.0).pixels(101, 50) == (11, 0, 95, 50)


def test_bars_beside_a_photo_do_not_make_it_a_stereo_pair() -> None:
    """They are the same above and below."""
    whole, corners = framed(example("railway_field"), BLACK, 150, 0, 150, 0)
    layout = find_layout(as_jpeg(whole, 75))
    assert not layout.is_stereo_pair
    assert layout.photo is not None
    assert layout.photo.pixels(*whole.size) == pytest.approx(corners, abs=6)


@pytest.mark.parametrize("recorded", [(480, 270), (480, 360)])
def test_a_lens_in_the_file_is_that_of_the_photo_inside(recorded: tuple[int, int]) -> None:
    """Whether the file has the camera's own size or that of the picture with its bars."""
    whole, corners = framed(example(), BLACK, 0, 45, 0, 45)
    base = ExifTags.Base
    tags: dict[int, int] = {
        base.FocalLengthIn35mmFilm: 26,
        base.ExifImageWidth: recorded[0],
        base.ExifImageHeight: recorded[1],
    }
    photo = read_photo(encode(whole, exif=exif(tags).tobytes(), quality=90))
    assert photo.crop is not None
    width, height = corners[2] - corners[0], corners[3] - corners[1]
    assert photo.metadata.vertical_fov == pytest.approx(vertical_fov_from_focal_length(26.0, width, height), abs=0.5)


def test_a_collage_is_told_and_a_read_photo_says_so() -> None:
    whole = Image.new("RGB", (610, 300), WHITE)
    for column, name in enumerate(("garden_noon", "snow_field")):
        whole.paste(example(name).resize((300, 300)), (310 * column, 0))
    photo = read_photo(encode(whole, quality=85))
    assert photo.is_collage
    assert photo.crop is None
    assert [warning_code(warning) for warning in photo.warnings] == ["collage"]
