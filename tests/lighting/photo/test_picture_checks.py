"""Pictures that are no photo of one view."""

import cv2
import numpy as np
import pytest

from lighting.envmap.render import render
from lighting.photo.picture_checks import is_blank, is_false_color, is_panorama, stereo_half, true_share
from lighting.photo.reader import read_photo
from lighting.records import Lighting
from tests.conftest import encode, scene
from tests.helpers.pages import ROOT


@pytest.mark.parametrize("grey", [0, 3, 128, 255])
@pytest.mark.parametrize("noise", [0.0, 6.0])
def test_a_frame_without_contrast_is_empty(grey: int, noise: float) -> None:
    pixels = np.random.default_rng(1).normal(grey, noise, (60, 90, 3))
    assert is_blank(np.clip(pixels, 0, 255).astype(np.uint8))
    assert is_blank(np.full((1, 1, 3), grey, np.uint8))


@pytest.mark.parametrize("height", [64, 200, 700])
def test_a_whole_panorama_is_known_by_its_shape_its_seam_and_its_zenith(height: int) -> None:
    whole = panorama(height)
    assert is_panorama(whole)
    assert is_panorama(np.roll(whole, height // 3, axis=1))
    assert not is_panorama(whole[:, : height + height // 2])  # another shape
    assert not is_panorama(np.rot90(whole))
    half = np.repeat(whole[:, : height + 1 - height % 2], 2, axis=1)[:, : 2 * height]
    slope = half * np.linspace(0.4, 1, 2 * height)[:, None]
    assert not is_panorama(slope.astype(np.uint8))  # a photo of that shape: its sides differ
    upside = np.ascontiguousarray(whole[::-1])
    assert not is_panorama(upside)  # the first row shows many directions


def test_fog_and_a_scene_are_not_empty() -> None:
    fog = np.linspace(150, 200, 90).astype(np.uint8)[None, :, None].repeat(60, axis=0).repeat(3, axis=2)
    assert not is_blank(fog)
    assert not is_blank(scene(90, 60))


def panorama(height: int) -> np.ndarray:
    """A lat-long map with things on the ground, as sRGB bytes."""
    image = render(Lighting(sun_azimuth=30.0, sun_elevation=30.0, turbidity=3.0, exposure=0.02), height, sun=False)
    grey = np.clip(255 * image.mean(axis=2) / image.max(), 0, 255)
    x = np.arange(2 * height) / height * np.pi
    houses = 90 + 40 * np.sin(5 * x)[None] + 40 * np.cos(2 * x)[None]
    below = np.arange(height)[:, None] > 0.45 * height
    return np.asarray(np.where(below, houses, 120 + grey / 3).astype(np.uint8)[..., None].repeat(3, axis=2))


EXAMPLES = [read_photo(path).pixels for path in sorted((ROOT / "examples").glob("*.jpg"))[::3]]


# What thermal cameras show cold to hot: colors at equal steps, as makers publish them in pictures.
PALETTES = {
    "iron": "000000 000050 46008c 96009b cd1e6e eb5014 fa8c00 ffbe14 ffeb6e ffffff",
    "rainbow": "000000 3c006e 0000dc 0096dc 00c83c a0e600 ffdc00 ff6e00 e60000 ffffff",
    "high-contrast rainbow": "000000 ff00ff 3c00ff 00c8ff 00ff50 dcff00 ff7800 c80000 ffffff",
    "arctic": "050a3c 0a28c8 1e8cf0 6ebedc 78786e 966e32 dca01e ffdc50 ffffe6",
    "lava": "000014 143278 3c6e8c 6e466e aa1428 dc3c0a ff9600 fff078",
    "medical": "000000 00286e 008296 00a03c b4b400 f05a00 e6003c ff96ff ffffff",
    "hot metal": "000000 5a001e b40000 f05000 ffbe00 ffff5a ffffff",
    "cold and hot": "000082 0078ff e6e6e6 ffa000 8c0000",
}


def palette(name: str) -> np.ndarray:
    """(256, 3) bytes: one of PALETTES, or a color map of OpenCV."""
    if name not in PALETTES:
        levels = np.arange(256, dtype=np.uint8)[:, None]
        return np.asarray(cv2.applyColorMap(levels, getattr(cv2, f"COLORMAP_{name}"))[:, 0, ::-1])
    colors = np.array([list(bytes.fromhex(color)) for color in PALETTES[name].split()], dtype=float)
    steps = np.linspace(0, 255, len(colors))
    return np.stack([np.interp(np.arange(256), steps, channel) for channel in colors.T], axis=1).astype(np.uint8)


@pytest.mark.parametrize("is_annotated", [False, True])
@pytest.mark.parametrize(
    "name", [*PALETTES, "INFERNO", "PLASMA", "HOT", "JET", "RAINBOW", "TURBO", "VIRIDIS", "HSV", "CIVIDIS", "PARULA"]
)
def test_colors_on_one_line_of_a_palette_are_false(name: str, is_annotated: bool) -> None:
    found = 0
    for photo in EXAMPLES:
        gray = cv2.resize(cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY), (320, 240), interpolation=cv2.INTER_AREA)
        gray = cv2.normalize(gray, np.empty_like(gray), 0, 255, cv2.NORM_MINMAX)
        gray = cv2.resize(gray, (640, 480))  # few thermal pixels, enlarged
        shown = palette(name)[gray]
        if is_annotated:
            cv2.putText(shown, "24.5 C", (10, 40), cv2.FONT_HERSHEY_SIMPLEX, 1.0, (255, 255, 255), 2)
            shown[60:420, 600:625] = palette(name)[np.linspace(255, 0, 360).astype(int)][:, None]
        found += is_false_color(read_photo(encode(shown)).pixels)
    assert found >= len(EXAMPLES) - 1


def test_photos_and_gray_pictures_have_no_false_colors() -> None:
    for photo in EXAMPLES:
        assert not is_false_color(photo)
        gray = np.repeat(photo.mean(axis=2, keepdims=True), 3, axis=2)
        sepia = np.clip(gray * [1.1, 1.0, 0.75], 0, 255)
        assert not is_false_color(gray.astype(np.uint8))
        assert not is_false_color(sepia.astype(np.uint8))
    assert not is_false_color(np.zeros((4, 4, 3), np.uint8))


@pytest.mark.parametrize("axis", [0, 1])
def test_shares_of_truth_are_means(axis: int) -> None:
    values = np.random.default_rng(0).random((300, 41)) < 0.3
    assert np.array_equal(true_share(values, axis), values.mean(axis=axis))


@pytest.mark.parametrize("level", [3, 128, 255])
def test_a_plain_area_is_no_stereo_pair(level: int) -> None:
    assert stereo_half(np.full((120, 161), level, np.int16)) is None
