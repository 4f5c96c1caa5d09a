"""Make lighting/data/detail.npy out of the panoramas of `train` that Poly Haven gives away (CC0).

    python -m export.data.detail_library --data DIR

Each is exposed like a photo. The sun and its glare are taken out, since a map has a sun of its own. It is kept as a
small WebP picture beside its kind and the features by which it is chosen. `python -m export kinds` then adds what
tells kinds of places apart, and `python -m export report map-detail --balance` what those cost that would be chosen too
often.
"""

import argparse
import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from export.data.panoramas import Panorama, read_index, read_linear_panorama
from lighting.color import SRGB_LINEAR, luminance, tone_map
from lighting.envmap.appearance import KIND_FEATURES, PLACE_KINDS
from lighting.envmap.detail_library import (
    FEATURE_CLASSES,
    FEATURE_RANGE,
    FEATURE_ROWS,
    FEATURES,
    LIBRARY_PATH,
    PICTURE_ROWS,
    cell_features,
    class_features,
)
from lighting.geometry import (
    Floats,
    Pinhole,
    angle_between,
    camera_directions,
    direction,
    latlong_directions,
    latlong_pixel,
    sample_latlong,
)
from lighting.model import Model
from lighting.photo.reader import Photo, photo_from_array
from lighting.prediction import photo_segments

_LICENCE = "poly haven"  # beside "cc0" in the field of a row whose panorama may ship
_LEFT_OUT = (
    *("mfecane_1189", "mfecane_1213"),  # others show the same
    *("mfecane_1193", "outdoor_umbrellas"),  # colored umbrellas all over the sky
    "industrial_sunset_02",  # no detail but rows of plants
    *("docklands_02_sceneview", "mfecane_1211", "mfecane_1227"),  # one knows the place: crane, ruin, domes
    "mfecane_1222",  # a wall so near that it fills half the map
    *("mfecane_1186", "mfecane_1200", "mfecane_1210", "modern_buildings_2"),  # a roof, a pool, a pavilion
    "horn_koppe_snow",  # the lens's glare stands beside its sun
)
_SATURATION = {"mfecane_1229": 0.3, "syferfontein_6d_clear": 0.4}  # of colors by a low sun
_LAWN_DEG = {"limpopo_golf_course": (-30.0, -35.5)}  # elevations of a lawn that is reflected over the pit under it
_KIND_OF = {  # the others are cities
    "waterfront": (*("mfecane_1172", "mfecane_1176", "mfecane_1225"), *("san_giuseppe_bridge", "venice_dawn_pmndrs")),
    "parking": ("learner_park",),
    "garden": ("suburban_garden",),
    "meadow": (
        *("mfecane_1183", "hochsal_field", "je_gray_park", "lilienstein"),
        *("rural_crossroads", "rural_landscape", "sunset_fairway", "wildflower_field"),
    ),
    "forest": ("mfecane_1167", "mfecane_1185", "mfecane_1209", "mfecane_1216", "mfecane_1224", "mossy_forest"),
    "shore": ("limpopo_golf_course", "mfecane_1180", "mfecane_1229", "small_harbor_01", "sundowner_overlook"),
    "desert": ("drakensberg_solitary_mountain", "kloofendal_overcast", "syferfontein_6d_clear"),
    "mountain": ("mfecane_1228",),
    "snow": ("snowy_forest_path_01", "stierberg_sunrise", "winter_lake_01"),
}
_QUALITY = 60  # of WebP, 0 to 100
_ROW = np.dtype(
    [
        *(("name", "U40"), ("size", "i8")),  # bytes of the picture
        ("features", "u1", (len(FEATURES), FEATURE_ROWS, 2 * FEATURE_ROWS)),  # FEATURE_RANGE in 255 steps
        *(("sun_azimuth", "f8"), ("sunlit", "?"), ("kind", "U10"), ("cost", "f4")),
        ("kinds", "f4", (len(PLACE_KINDS),)),  # probability of each
    ]
)

_BRIGHT, _BRIGHT_SHARE, _MEAN = 0.9, 0.95, 0.25  # exposure: most pixels darker than _BRIGHT, the mean under _MEAN
_GLARE_DEG = (12.0, 26.0)  # from the sun: the sky is smooth within the first, as it was beyond the second
_SKY_LUMINANCE = 0.3
_VIEW_STEP, _VIEW_FOV = 30, 60.0  # deg between the views in which classes are looked for; deg, vertical
_VIEW_SIZE = 384, 288  # of them, pixels
_MOST_USED = 0.08  # share of photos for which a panorama is chosen
_COST_STEP, _BALANCE_STEPS = 0.01, 5000
_MAX_COST = 3.0  # less than that of a town in the country: kinds count more than that places differ
_BROAD_DEG = 15.0  # standard deviation by which broad brightness is smoothed


def make_detail_library(data: Path) -> tuple[NDArray[np.void], bytes]:
    """The table and the pictures of the library's file.

    Args:
        data: folder of panoramas.
    """
    licences = ((p, p.licence.lower()) for p in read_index(data, "train") if p.name not in _LEFT_OUT)
    chosen = [panorama for panorama, licence in licences if _LICENCE in licence and "cc0" in licence]
    linear = [_prepare(p) for p in chosen]
    pictures = [_encode(one) for one in linear]
    low, high = FEATURE_RANGE
    model = Model.load()  # tells what views show
    features = np.stack([_features(one, model) for one in linear])
    table = np.zeros(len(chosen), _ROW)
    table["name"] = [p.name for p in chosen]
    table["size"] = [len(picture) for picture in pictures]
    table["features"] = np.round((np.clip(features, low, high) - low) * (255 / (high - low)))
    table["sun_azimuth"] = [np.nan if p.sun_azimuth is None else p.sun_azimuth for p in chosen]
    table["sunlit"] = [p.direct in ("yes", "partly") and p.sun_azimuth is not None for p in chosen]
    kinds = {name: kind for kind, names in _KIND_OF.items() for name in names}
    table["kind"] = [kinds.get(p.name, "city") for p in chosen]
    return table, b"".join(pictures)


def read_detail_library(file: Path) -> tuple[NDArray[np.void], NDArray[np.float32], bytes]:
    """The table of a library, the weights of its classifier of places, and its pictures, one after the other.

    Args:
        file: the library's.
    """
    with file.open("rb") as stream:
        return np.load(stream), np.load(stream), stream.read()


def balance_library(costs: NDArray[np.floating]) -> NDArray[np.float32]:
    """What each panorama of the library must cost (N,), so that none is chosen for more than a share of photos.

    Without it some, whose features are mean ones, suit too many photos (hubness [1]), and maps look alike.

    Args:
        costs: (V, N) of each panorama for each of V photos.

    References: [1] Radovanovic et al., Hubs in Space, JMLR 2010.
    """
    extra = np.zeros(costs.shape[1])
    for _ in range(_BALANCE_STEPS):
        used = np.bincount((costs + extra).argmin(axis=1), minlength=len(extra))
        often = (used > max(1, _MOST_USED * len(costs))) & (extra < _MAX_COST)
        if not often.any():
            break
        extra[often] += _COST_STEP
    return extra.astype(np.float32)


def write_detail_library(file: Path, table: NDArray[np.void], weights: NDArray[np.float32], pictures: bytes) -> None:
    """Write a library: NumPy's plain table and weights, and the pictures after them.

    Args:
        file: the library's.
        table: (N,) a row for each panorama.
        weights: (F + 1, K) of `appearance.kind_probability`.
        pictures: of all, one after the other.
    """
    with file.open("wb") as stream:
        np.save(stream, table, allow_pickle=False)
        np.save(stream, weights, allow_pickle=False)
        stream.write(pictures)


def _prepare(panorama: Panorama) -> NDArray[np.float32]:
    """A panorama (PICTURE_ROWS, 2 PICTURE_ROWS, 3), linear, 0 to 1, without its sun."""
    linear = read_linear_panorama(panorama, PICTURE_ROWS)
    if panorama.kind == "hdr":
        bright = luminance(linear[len(linear) // 4 : 3 * len(linear) // 4])  # the middle rows
        limit = float(np.quantile(bright, _BRIGHT_SHARE))
        linear = linear * np.float32(min(_BRIGHT / limit, _MEAN / float(np.minimum(bright, limit).mean())))
    linear = np.clip(linear, 0, 1)
    if panorama.sun == "visible" and panorama.sun_azimuth is not None and panorama.sun_elevation is not None:
        _remove_glare(linear, direction(panorama.sun_azimuth, panorama.sun_elevation))
    if panorama.name in _SATURATION:
        gray = luminance(linear)[..., None]
        linear = np.asarray(gray + np.float32(_SATURATION[panorama.name]) * (linear - gray), dtype=np.float32)
    if panorama.name in _LAWN_DEG:
        _continue_lawn(linear, *_LAWN_DEG[panorama.name])
    return linear


def _continue_lawn(linear: NDArray[np.float32], top: float, bottom: float) -> None:
    """Reflect the lawn between two elevations [deg] to and fro over all that is under it."""
    first, end = (round((90 - deg) / 180 * len(linear)) for deg in (top, bottom))
    whole = np.pad(linear[first:end], ((0, len(linear) - end), (0, 0), (0, 0)), mode="symmetric")
    linear[end:] = whole[end - first :]


def _remove_glare(linear: NDArray[np.float32], sun: NDArray[np.floating]) -> None:
    """Smooth the bright sky around the sun, so that no edge of its glare is left among the detail."""
    rows = len(linear) // 2
    sky = linear[:rows]
    distance = angle_between(latlong_directions(len(linear))[:rows], sun)
    share = np.clip((_GLARE_DEG[1] - distance) / (_GLARE_DEG[1] - _GLARE_DEG[0]), 0, 1)[..., None]
    bright = (luminance(sky)[..., None] > _SKY_LUMINANCE).astype(np.float32)  # trees before the sun stay
    sizes = rows, 2 * len(linear)
    vertical, horizontal = (_gaussian(n, len(linear), _GLARE_DEG[0]).astype(np.float32) for n in sizes)
    values = bright * sky, bright
    total, weight = (np.einsum("ij,jkc,kl->ilc", vertical, x, horizontal, optimize=True) for x in values)
    sky += (share * bright * (total / np.maximum(weight, 1e-3) - sky)).astype(np.float32)


def _gaussian(count: int, rows: int, std: float) -> Floats:
    """Weights (count, count) of a normal distribution [deg] between pixels of a map of some rows; columns wrap."""
    distance = np.abs(np.arange(count)[:, None] - np.arange(count))
    distance = np.minimum(distance, count - distance) if count == 2 * rows else distance
    return np.asarray(np.exp(-0.5 * (distance * (180.0 / rows) / std) ** 2))


def _encode(linear: NDArray[np.float32]) -> bytes:
    Image.fromarray(tone_map(linear)).save(stream := io.BytesIO(), "WEBP", quality=_QUALITY, method=6)
    return stream.getvalue()


def _features(linear: NDArray[np.float32], model: Model) -> NDArray[np.float32]:
    """The FEATURES (F, FEATURE_ROWS, 2 FEATURE_ROWS) of a panorama."""
    step = len(linear) / FEATURE_ROWS
    rows = np.arange(0, len(linear), 2)
    columns = np.arange(0, 2 * len(linear), 2)
    cell = (rows // step).astype(np.intp)[:, None] * 2 * FEATURE_ROWS + (columns // step).astype(np.intp)
    shown, _ = cell_features(linear[::2, ::2].reshape(-1, 3), cell.reshape(-1))
    return np.concatenate([shown, _smooth(shown[0])[None], _classes(linear, model)])


def level_views(linear: NDArray[np.float32]) -> Iterator[tuple[Floats, Photo]]:
    """Views all around in a panorama, each with the unit vectors (h, w, 3) of its pixels.

    Args:
        linear: (H, 2H, 3), 0 to 1.
    """
    for azimuth in range(0, 360, _VIEW_STEP):
        directions = camera_directions(Pinhole(*_VIEW_SIZE, _VIEW_FOV, azimuth=azimuth))
        yield directions, photo_from_array(tone_map(sample_latlong(linear, directions)))


def library_pictures(table: NDArray[np.void], pictures: bytes) -> Iterator[NDArray[np.float32]]:
    """Panoramas (PICTURE_ROWS, 2 PICTURE_ROWS, 3) of a library, linear.

    Args:
        table: (N,) of `read_detail_library`.
        pictures: likewise.
    """
    ends = np.cumsum(table["size"])
    for end, size in zip(ends.tolist(), table["size"].tolist(), strict=True):
        with Image.open(io.BytesIO(pictures[end - size : end])) as picture:
            yield SRGB_LINEAR[np.asarray(picture.convert("RGB"))]


def _classes(linear: NDArray[np.float32], model: Model) -> NDArray[np.float32]:
    """Probabilities of FEATURE_CLASSES (C, FEATURE_ROWS, 2 FEATURE_ROWS) by views all around.

    Rows above and below the views have those of the nearest row.
    """
    shape = FEATURE_ROWS, 2 * FEATURE_ROWS
    total, count = np.zeros((len(FEATURE_CLASSES), *shape)), np.zeros(shape)
    for directions, photo in level_views(linear):
        segments = photo_segments(model.predict_one(photo).segments, photo.width, photo.height)
        assert segments is not None
        x, y = np.moveaxis(latlong_pixel(directions, FEATURE_ROWS), -1, 0)
        cell = np.minimum(y, FEATURE_ROWS - 1).astype(np.intp) * shape[1] + x.astype(np.intp) % shape[1]
        seen = np.bincount(cell.reshape(-1), minlength=shape[0] * shape[1]).reshape(shape)
        total += class_features(segments, cell) * seen
        count += seen
    rows = np.flatnonzero((count > 0).all(axis=1))
    mean = total / np.maximum(count, 1)
    return np.asarray(mean[:, np.clip(np.arange(FEATURE_ROWS), rows[0], rows[-1])], dtype=np.float32)


def _smooth(cells: NDArray[np.float32]) -> NDArray[np.float32]:
    """Cells smoothed within each half; columns wrap."""
    rows, columns = cells.shape
    half = np.arange(rows) < rows // 2
    across, around = (_gaussian(count, rows, _BROAD_DEG) for count in (rows, columns))
    vertical, horizontal = (k / k.sum(axis=1, keepdims=True) for k in (across * (half[:, None] == half), around))
    return np.asarray(vertical @ cells @ horizontal.T, dtype=np.float32)


def _main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder with panoramas.csv and the pictures")
    table, pictures = make_detail_library(parser.parse_args().data)
    weights = np.zeros((KIND_FEATURES + 1, len(PLACE_KINDS)), np.float32)
    write_detail_library(LIBRARY_PATH, table, weights, pictures)
    print(f"{LIBRARY_PATH}: {len(table)} panoramas, {LIBRARY_PATH.stat().st_size} bytes")


if __name__ == "__main__":
    _main()
