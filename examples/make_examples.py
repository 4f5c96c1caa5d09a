"""Make the example photos: perspective crops of CC0 panoramas, exposed like photos from a phone.

    python examples/make_examples.py FOLDER

FOLDER holds `panoramas.csv` and the panoramas it names, as README of `export/` describes. Writes the JPEGs and
`examples.csv` beside this script.
"""

import argparse
import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR
from PIL import Image, ImageFilter

from lighting.color import luminance, srgb_encode
from lighting.geometry import Floats, Pinhole, camera_directions, sample_latlong, wrap_azimuth

HERE = Path(__file__).parent
LICENCES = ("Poly Haven CC0", "CC0 (Poly Haven)")  # the only ones whose crops may be published here
MIDDLE_GREY = 0.2  # linear value of the crop's median luminance before the curve
WHITE = 5.0  # linear value that the curve takes to white
UPSAMPLING = 4  # of the tone-mapped panorama by Lanczos, so that bilinear sampling shows no steps
SUPERSAMPLING = 2
GRAIN = 1.2  # standard deviation of the sensor noise, 8-bit steps
COLUMNS = (
    "file",
    "panorama",
    "sun_azimuth",
    "sun_elevation",
    "direct",
    "camera_elevation",
    "camera_roll",
    "vertical_fov",
)


@dataclass(frozen=True)
class Example:
    """One photo: its panorama and its camera; angles in deg, `stops` is added to the metered exposure.

    `direct` is what the crop shows by eye of direct sunlight, where that is not what its panorama's row says.
    """

    file: str
    panorama: str
    azimuth: float
    elevation: float
    roll: float
    vertical_fov: float
    width: int
    height: int
    stops: float = 0.0
    direct: str = ""


EXAMPLES = (
    Example("railway_field.jpg", "h_railway_bridge_02", 10.0, 4.0, 1.0, 70.0, 640, 480, 0.4),
    Example("wide_street.jpg", "h_wide_street_02", -22.0, 3.0, 0.0, 64.0, 800, 450),
    Example("venice_alley.jpg", "h_venetian_crossroads", -140.0, 8.0, -1.5, 80.0, 480, 640),
    Example("park_evening.jpg", "h_rooitou_park", -75.0, -4.0, 2.0, 70.0, 640, 480),
    Example("garden_noon.jpg", "suburban_garden", 170.0, 0.0, 0.5, 75.0, 640, 480),
    Example("snow_field.jpg", "passendorf_snow", 105.0, -6.0, 0.5, 66.0, 640, 480, 0.5),
)


def main() -> None:
    """Write every example photo and the table of true values."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="the folder that holds panoramas.csv")
    parser.add_argument("--output", type=Path, default=HERE)
    arguments = parser.parse_args()
    rows = read_rows(arguments.folder / "panoramas.csv")
    for seed, example in enumerate(EXAMPLES):
        row = rows[example.panorama]
        picture = crop(read_panorama(arguments.folder / row["file"]), example, seed)
        picture.save(arguments.output / example.file, quality=92, subsampling=0, optimize=True)
    write_truth(arguments.output / "examples.csv", rows)


def read_rows(table: Path) -> dict[str, dict[str, str]]:
    """The rows of the panoramas whose crops may be published, by name."""
    with table.open(newline="", encoding="utf-8") as lines:
        return {row["name"]: row for row in csv.DictReader(lines) if row["licence"] in LICENCES}


def read_panorama(path: Path) -> Floats:
    """Linear Rec.709 (H, 2H, 3)."""
    with OpenEXR.File(str(path)) as file:
        return np.array(file.channels()["RGB"].pixels, dtype=np.float32)


def crop(panorama: Floats, example: Example, seed: int) -> Image.Image:
    """The photo a phone would take there."""
    rays = camera_directions(
        Pinhole(
            example.width * SUPERSAMPLING,
            example.height * SUPERSAMPLING,
            example.vertical_fov,
            example.azimuth,
            example.elevation,
            example.roll,
        )
    )
    median = float(np.median(luminance(sample_latlong(panorama, rays[::8, ::8]))))
    developed = develop(panorama * (MIDDLE_GREY / median * 2.0**example.stops))
    large = sample_latlong(enlarge(developed), rays)
    picture = Image.fromarray(np.round(np.clip(large, 0, 255)).astype(np.uint8))
    small = picture.resize((example.width, example.height), Image.Resampling.LANCZOS)
    return add_grain(small.filter(ImageFilter.UnsharpMask(radius=1.6, percent=110, threshold=1)), seed)


def develop(linear: Floats) -> Floats:
    """Display values 0 to 255 of exposed linear light: a shoulder up to WHITE, then sRGB with a little contrast."""
    curved = linear * (1.0 + linear / WHITE**2) / (1.0 + linear)
    encoded = srgb_encode(curved * 1.25)
    return (encoded + 0.35 * (encoded - 0.5) * encoded * (1.0 - encoded) * 4.0) * 255.0


def enlarge(image: Floats) -> Floats:
    """The panorama UPSAMPLING times larger, by Lanczos, wrapped at the seam."""
    height, width = image.shape[:2]
    wrapped = np.concatenate([image[:, -16:], image, image[:, :16]], axis=1)
    size = (wrapped.shape[1] * UPSAMPLING, height * UPSAMPLING)
    planes = [Image.fromarray(wrapped[..., c].astype(np.float32)) for c in range(3)]
    layers = [np.asarray(plane.resize(size, Image.Resampling.LANCZOS)) for plane in planes]
    return np.stack(layers, axis=-1)[:, 16 * UPSAMPLING : (16 + width) * UPSAMPLING]


def add_grain(picture: Image.Image, seed: int) -> Image.Image:
    """Add faint luminance noise, as small sensors have."""
    pixels = np.asarray(picture, dtype=np.float32)
    noise = np.random.default_rng(seed).normal(0.0, GRAIN, pixels.shape[:2])[..., None]
    return Image.fromarray(np.round(np.clip(pixels + noise, 0, 255)).astype(np.uint8))


def write_truth(target: Path, rows: dict[str, dict[str, str]]) -> None:
    """The sun relative to each camera [deg], empty where the panorama does not show it, and the camera's angles."""
    with target.open("w", newline="", encoding="utf-8") as lines:
        writer = csv.writer(lines, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(truth(example, rows[example.panorama]) for example in EXAMPLES)


def truth(example: Example, row: dict[str, str]) -> tuple[object, ...]:
    """One row of COLUMNS."""
    azimuth = row["sun_azimuth"] and round(float(wrap_azimuth(float(row["sun_azimuth"]) - example.azimuth)), 1)
    return (
        example.file,
        example.panorama.removeprefix("h_"),
        azimuth,
        row["sun_elevation"],
        example.direct or row["direct"],
        example.elevation,
        example.roll,
        example.vertical_fov,
    )


if __name__ == "__main__":
    main()
