"""The library of detail: small CC0 panoramas of real places, and which of them suits a photo.

A map takes from one of them what is finer than the network's cells. What the photo shows in each cell decides which:
brightness, contrast, colors; plants, buildings, water. So does what the network predicts around it, and how much
of plants, buildings and water its kind of place has all around, and which kind that probably is. Colors of ground and
leaves count: no lawn goes on as paving. Its sun counts too, so that shadows agree. Snow is for photos of snow alone,
shores for photos of water.

`python -m export.data.detail_library` and `python -m export kinds` made the file.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from lighting.checksum import DATA_FOLDER, verify_checksum
from lighting.color import LUMINANCE_WEIGHTS
from lighting.envmap.appearance import PLACE_KINDS, PhotoSamples, kind_features, kind_probability, shows_snow
from lighting.envmap.latlong import Image
from lighting.envmap.projection import cell_means, sample_cells
from lighting.geometry import Floats, latlong_angles, wrap_azimuth
from lighting.prediction import PASSING_THINGS, Segments, SurfaceClass
from lighting.records import Lighting

LIBRARY_PATH = DATA_FOLDER / "detail.npy"
PICTURE_ROWS = 512  # of the library's panoramas
FEATURE_ROWS = 24  # rows of cells by which they are chosen
FEATURE_CLASSES = (SurfaceClass.PLANTS, SurfaceClass.BUILDING, SurfaceClass.WATER)
# Of what a cell shows: logarithms of brightness, of how much it varies, of red and blue over green, and of how much red
# over green varies; the share that is orange less that which is green. Brightness smoothed over neighbors;
# probabilities of FEATURE_CLASSES.
FEATURES = (
    *("brightness", "contrast", "red", "blue", "tints", "autumn"),
    *("broad brightness", "plants", "building", "water"),
)
FEATURE_RANGE = (-6.0, 2.0)  # that 8 bits hold

LOG_OFFSET = np.float32(0.006)  # linear value added before a logarithm
DETAIL_ROWS = 48  # of the cells in which what is coarse is told from detail

_DARKEST = 1e-3  # linear value that counts in a logarithm
_LEAST_CONTRAST = 0.02
_ORANGE = (0.22, -0.4)  # logarithms of red and blue over green, above the first and under the second
_GREEN = (-0.05, -0.18)  # under both
_SEEN_WEIGHTS = (1.0, 2.0, 1.0, 1.0, 0.0, 1.0)  # of the first six features, where the photo shows them
_BROAD_WEIGHT = 1.0  # of the seventh, everywhere
_CLASS_WEIGHT = 3.0  # of each of the last, where the photo shows them
_BAND = slice(9, 13)  # rows of cells 22 deg above the horizon to 7 below
_SKYLINE = slice(8, 14)  # rows 30 deg above the horizon to 15 below
_CANOPY = slice(4, 9)  # rows above these
_WATER = slice(11, 16)  # rows around the horizon and below it
# What places have all around: buildings and plants in the band, water, plants and buildings above the band. A constant,
# and factors of what a photo of 60 deg shows of each; the first three were fitted to crops of `train` and `val`.
_EXPECTED = (
    (0.05, 0.6, 0.08, 0.0, 0.0, 0.0),
    (0.08, 0.1, 0.68, 0.0, 0.0, 0.0),
    (0.04, 0.0, 0.0, 0.35, 0.0, 0.0),
    (0.03, 0.1, 0.3, 0.0, 0.45, 0.0),
    (0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
)
_AROUND_WEIGHTS = (12.0, 6.0, 6.0, 12.0, 6.0)  # cost of squared differences from each
_WIDE_CELLS = 36, 45, 36  # cells of the band, of water's rows and of those above that a photo shows to count in full
_GROUND = slice(13, 20)  # rows of cells 7 to 60 deg below the horizon
# Of squares of what differs: its logarithms of green over red and blue, and of red over blue; its autumn.
_GROUND_WEIGHTS = (16.0, 1.4, 4.0)
_TINTS_WEIGHT = 5.0  # of tints that the place has and the photo has not
_LEAVES_WEIGHT = 8.0  # of squares of autumn, where there are plants
_CLOUDS = slice(3, 10)  # rows of cells 15 to 67 deg above the horizon
_CLOUDS_WEIGHT = 0.35  # of squared logarithms of the contrast in cells of open sky
_FEW_CELLS = 3.0  # of ground or leaves, by which their colors count half
_WATER_COST = 4.0  # of a shore without water in the photo, and of none with it
_WATER_SHARES = (0.05, 0.12)  # of water's rows up to which a photo is none of a shore, and from which it is one
_TOWN_COST = 4.0  # of a town without buildings in the photo, and of none with them
_TOWN_SHARES = (0.1, 0.3)  # of the cells near the horizon that most show a building, the same
_BARE_COST = 3.0  # of a bare place with plants or buildings in the photo
_BARE_SHARES = (0.03, 0.15)  # the same of plants and buildings in the band
_GARDEN_COST = 1.5  # of a garden without buildings in the photo
_GARDEN_SHARES = (0.01, 0.06)  # the same of buildings in the band
_TOWNS = ("city", "waterfront")
_HALF_TOWNS = ("parking",)  # which photos of towns and of none suit alike
_BARE = ("desert", "mountain")
_SHORES = ("shore", "waterfront")
_SUN_WEIGHT = 0.1  # cost of a sun 90 deg off, in squared logarithms
_SHADE_COST = 0.1  # of a sunlit panorama where there is no sun
_DULL_COST = 0.5  # of a panorama without sun where there is one
_LEAST_FREE = 0.1  # share of a cell without PASSING_THINGS, from which it counts
_SNOW = PLACE_KINDS.index("snow")
_KIND_WEIGHT = 3.0  # of the logarithm of how probably photo and panorama are of one kind of place
_LEAST_LIKELY = 0.05  # probability that counts in it
_MIN_SAMPLES = 8  # sampled pixels of the photo by which a cell counts as visible
_COLORFUL = 0.12  # spread of a photo's colors, in logarithms, from which the library's are shown in full


@dataclass(frozen=True, eq=False)
class DetailLibrary:
    """N panoramas of detail and their features."""

    names: tuple[str, ...]
    """Of the panoramas."""
    picture_ends: NDArray[np.int64]
    """(N,) where their pictures end in the file: WebP, sRGB, PICTURE_ROWS rows."""
    picture_sizes: NDArray[np.int64]
    """(N,) in bytes."""
    features: NDArray[np.float32]
    """(N, F, FEATURE_ROWS, 2 FEATURE_ROWS), as FEATURES."""
    sun_azimuth: Floats
    """(N,) deg, NaN where unknown."""
    sunlit: NDArray[np.bool_]
    """(N,) whether direct sunlight reaches the place."""
    kind: NDArray[np.str_]
    """(N,) of BACKDROPS."""
    cost: Floats
    """(N,) in squared logarithms, of what would be chosen too often."""
    kinds: Floats
    """(N, K) probabilities that a panorama is of each of PLACE_KINDS."""
    kind_weights: Floats
    """(F + 1, K) of `kind_probability`."""

    @cached_property
    def shares(self) -> Floats:
        """(N, 5) of `_class_shares`."""
        everywhere = np.ones(self.features.shape[2:], np.bool_)
        return np.stack(_class_shares(self.features, everywhere)[0], axis=-1)

    @cached_property
    def colors(self) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """Of `_mean_colors`, each (N, ...)."""
        return _mean_colors(self.features, np.ones(self.features.shape[2:], np.float32))

    @cached_property
    def clouds(self) -> Floats:
        """(N,) of `_cloud_contrast`."""
        return _cloud_contrast(self.features, np.ones(self.features.shape[2:], np.float32))[0]

    def read_picture(self, index: int) -> bytes:
        """Return a panorama's picture.

        Args:
            index: of the panorama, from 0.
        """
        size = int(self.picture_sizes[index])
        with LIBRARY_PATH.open("rb") as file:
            file.seek(int(self.picture_ends[index]) - size)
            return file.read(size)


@dataclass(frozen=True)
class DetailChoice:
    """A panorama of the library, perhaps flipped, and rotated afterwards, and how colorful it may be."""

    index: int
    """Of the panorama in the library, from 0."""
    flipped: bool
    """Whether left and right are swapped."""
    yaw: float
    """Deg; what was at azimuth a (-a if flipped) is at a + yaw."""
    saturation: float = 1.0
    """Factor, 0 or more, on its color."""


@dataclass(frozen=True, eq=False)
class PhotoFeatures:
    """By what the detail for a photo is chosen."""

    target: Image
    """(F, FEATURE_ROWS, 2 FEATURE_ROWS), as FEATURES."""
    weight: Image
    """As `target`."""
    sun_azimuth: float | None
    """deg; None: without a sun that shines."""
    saturation: float
    """0 for a gray photo to 1."""
    snow: bool = False
    """Whether the photo shows snow."""
    kinds: Floats | None = None
    """(K,) probabilities of PLACE_KINDS. None: unknown."""


@lru_cache(maxsize=1)
def load_detail_library() -> DetailLibrary:
    """The library in this package; ModelError where its file is damaged."""
    verify_checksum(LIBRARY_PATH)
    with LIBRARY_PATH.open("rb") as file:
        table, weights, begin = np.load(file), np.load(file), file.tell()
    ends = begin + np.cumsum(table["size"])
    low, high = FEATURE_RANGE
    return DetailLibrary(
        names=tuple(table["name"].tolist()),
        picture_ends=ends,
        picture_sizes=table["size"],
        features=table["features"] * np.float32((high - low) / 255) + np.float32(low),
        sun_azimuth=table["sun_azimuth"],
        sunlit=table["sunlit"],
        kind=table["kind"],
        cost=table["cost"],
        kinds=table["kinds"],
        kind_weights=weights,
    )


def cell_features(colors: Image, cell: NDArray[np.intp]) -> tuple[Image, NDArray[np.intp]]:
    """The first six FEATURES (6, FEATURE_ROWS, 2 FEATURE_ROWS) of samples, and how many lie in each cell.

    Args:
        colors: (P, 3) linear, 0 to 1.
        cell: (P,) row x 2 FEATURE_ROWS + column of each.
    """
    cells = 2 * FEATURE_ROWS**2
    count = np.bincount(cell, minlength=cells)
    share = 1 / np.maximum(count, 1)
    log = np.log(np.maximum(colors, np.float32(_DARKEST)))
    soft = np.log(colors + LOG_OFFSET)
    red, blue = soft[:, 0] - soft[:, 1], soft[:, 2] - soft[:, 1]
    varying = []
    for values in (log[:, 1], red):
        mean, squares = (np.bincount(cell, value, cells) * share for value in (values, values**2))
        varying += [mean, 0.5 * np.log(np.maximum(squares - mean**2, _LEAST_CONTRAST**2))]
    brightness, contrast, _, tints = varying
    color = [np.log(np.maximum(np.bincount(cell, channel, cells) * share, _DARKEST)) for channel in colors.T]
    orange = (red > _ORANGE[0]) & (blue < _ORANGE[1])
    green = (red < _GREEN[0]) & (blue < _GREEN[1])
    autumn = np.bincount(cell, orange.astype(np.float32) - green, cells) * share
    shown = np.stack([brightness, contrast, color[0] - color[1], color[2] - color[1], tints, autumn])
    shape = FEATURE_ROWS, 2 * FEATURE_ROWS
    return np.asarray(shown.reshape(-1, *shape), dtype=np.float32), count.reshape(shape)


def describe_photo(
    lighting: Lighting,
    photo: NDArray[np.uint8],
    around: Image,
    segments: Segments | None = None,
    surroundings: NDArray[np.float32] | None = None,
) -> PhotoFeatures:
    """What of a photo counts for its detail.

    Args:
        lighting: of the photo; its camera and its sun count.
        photo: (h, w, 3) sRGB, upright.
        around: (FEATURE_ROWS, 2 FEATURE_ROWS, 3) linear, the coarse map that it lies in.
        segments: what the photo shows; None: unknown.
        surroundings: (R, 2R, 3) linear, what the network predicts around the camera; None: unknown.
    """
    samples = PhotoSamples.of_photo(photo, lighting, segments)
    colors, cell = sample_cells(photo, lighting, FEATURE_ROWS)
    flat = colors.reshape(-1, 3)
    shown, count = cell_features(flat, cell.reshape(-1))
    kinds, free = np.zeros((len(FEATURE_CLASSES), *count.shape), np.float32), np.float32(1)
    if segments is not None:
        kinds = class_features(segments, cell)
        free = 1 - class_features(segments, cell, PASSING_THINGS).sum(axis=0)
    level = np.cos(np.radians(latlong_angles(FEATURE_ROWS)[1]))[:, None].repeat(2 * FEATURE_ROWS, axis=1)
    seen = np.where((count >= _MIN_SAMPLES) & (free > _LEAST_FREE), level * free, 0.0)
    broad = np.log(np.maximum(around @ LUMINANCE_WEIGHTS, 1e-3))
    target = np.concatenate([shown, broad[None], kinds]).astype(np.float32)
    weight = _feature_weights(seen, level, segments is not None)
    log = np.log(np.maximum(flat, LOG_OFFSET))
    spread = float(np.std(log[:, 0] - log[:, 1]) + np.std(log[:, 2] - log[:, 1]))  # of its colors: 0 of a gray photo
    saturation = round(min(spread / _COLORFUL, 1.0), 2)
    azimuth = lighting.sun_azimuth if lighting.sun_shines else None
    likely = None
    if segments is not None and surroundings is not None:
        likely = kind_probability(kind_features(segments, surroundings), load_detail_library().kind_weights)
    snow = shows_snow(samples, lighting, None if likely is None else float(likely[_SNOW]))
    if likely is not None and not snow:
        likely[_SNOW] = 0.0
        likely /= likely.sum()
    return PhotoFeatures(target, weight, azimuth, saturation, snow, likely)


def _feature_weights(seen: Floats, level: Floats, classes: bool = True) -> Image:
    """How much each cell counts (F, FEATURE_ROWS, 2 FEATURE_ROWS), as FEATURES.

    Args:
        seen: (FEATURE_ROWS, 2 FEATURE_ROWS) solid angle of the cells that the photo shows, 0 elsewhere.
        level: as `seen`, of all cells.
        classes: whether it is known what the cells show.
    """
    share = seen / max(float(seen.sum()), 1e-6)
    of_classes = [share * (_CLASS_WEIGHT * classes)] * len(FEATURE_CLASSES)
    weights = [*(share * w for w in _SEEN_WEIGHTS), _BROAD_WEIGHT * level / level.sum(), *of_classes]
    return np.stack(weights).astype(np.float32)


def class_features(
    segments: Segments, cell: NDArray[np.intp], classes: Sequence[SurfaceClass] = FEATURE_CLASSES
) -> Image:
    """Probabilities of classes (C, FEATURE_ROWS, 2 FEATURE_ROWS), the means of samples in each cell.

    Args:
        segments: (R, C, classes) of a picture.
        cell: (h, w) row x 2 FEATURE_ROWS + column of each sample; samples are spread evenly over the picture.
        classes: whose probabilities are wanted.
    """
    height, width = segments.shape[:2]
    rows, columns = cell.shape
    row, column = np.arange(rows) * height // rows, np.arange(columns) * width // columns
    shown = segments[row[:, None], column].reshape(rows * columns, -1)
    means, _ = cell_means(shown[:, classes], cell.reshape(-1), FEATURE_ROWS)
    return np.ascontiguousarray(np.moveaxis(means, 2, 0), dtype=np.float32)


def choose_detail(features: PhotoFeatures, kind: str | None = None) -> DetailChoice:
    """The panorama, of all rotations and both ways round, whose detail suits a photo best.

    Args:
        features: of the photo.
        kind: of BACKDROPS, to which the choice is confined; None: all of them.
    """
    cost = choice_costs(features, kind) + load_detail_library().cost[:, None]
    way, index, turn = np.unravel_index(int(np.argmin(cost)), cost.shape)
    yaw = float(wrap_azimuth(int(turn) * 180.0 / FEATURE_ROWS))
    return DetailChoice(int(index), bool(way), yaw, features.saturation)


def choice_costs(photo: PhotoFeatures, kind: str | None = None) -> Floats:
    """Squared differences of features (2, N, turns), but for what is the same for all: panoramas, and flipped ones.

    Panoramas of snow are for photos of snow alone, and no others are.

    Args:
        photo: for which they are compared.
        kind: of BACKDROPS, whose panoramas alone are for it whatever it shows; None: all.
    """
    target, weight = photo.target, photo.weight
    library = load_detail_library()
    columns = 2 * FEATURE_ROWS
    turned = (np.arange(columns)[:, None] + np.arange(columns)) % columns  # (turns, columns)
    flips = [library.features, library.features[..., ::-1]]
    costs = [_sun_cost(library, flipped, photo.sun_azimuth) for flipped in (False, True)]
    for number, (weights, targets) in enumerate(zip(weight, weight * target, strict=True)):
        rows = weights.any(axis=1)  # of most kinds only those that the photo shows
        turns = [one[rows][:, turned].swapaxes(0, 1).reshape(columns, -1).T for one in (weights, targets)]
        for cost, features in zip(costs, flips, strict=True):
            values = features[:, number, rows].reshape(len(features), -1)
            cost += values**2 @ turns[0] - 2 * values @ turns[1]
    around = _around_cost(library, target, weight) + _color_cost(library, target, weight)
    if photo.kinds is not None:
        around -= _KIND_WEIGHT * np.log(library.kinds @ photo.kinds + _LEAST_LIKELY)
    fits = (library.kind == "snow") == photo.snow if kind is None else library.kind == kind
    around += np.where(fits, 0.0, np.inf)
    return np.stack(costs) + around[:, None]


def _around_cost(library: DetailLibrary, target: Image, weight: Image) -> Floats:
    """What it costs (N,) that places have more or less of plants, buildings and water around than is expected."""
    shown, known = _class_shares(target, weight[FEATURES.index("plants")] > 0)
    building, plants, water = map(float, shown[:3])
    if not known[-1]:  # what is high up, where no cell shows it
        shown[3] = shown[1]
    expected = np.array(_EXPECTED) @ [1.0, *map(float, shown)]
    cost = np.asarray((library.shares - expected) ** 2 @ (np.array(_AROUND_WEIGHTS) * known))
    dry = max(1.0 - 2 * building, 0.0)  # wet streets look like water
    wet = dry * float(np.interp(water, _WATER_SHARES, (0.0, 1.0)))
    number = FEATURES.index("building")
    seen = weight[number, _SKYLINE] > 0
    highest = (target[number, _SKYLINE] * seen).max(axis=0)  # near the horizon, in the columns that the photo shows
    skyline = float(highest.sum() / max(np.count_nonzero(seen.any(axis=0)), 1))
    built = float(np.interp(skyline, _TOWN_SHARES, (0.0, 1.0)))
    for kinds, halves, degree, price in (
        (_SHORES, (), wet, _WATER_COST * float(known[2])),
        (_TOWNS, _HALF_TOWNS, built, _TOWN_COST * float(known[0])),
    ):
        share = np.isin(library.kind, kinds) + 0.5 * np.isin(library.kind, halves)
        cost += price * np.abs(share - degree)
    grown = float(np.interp(building + plants, _BARE_SHARES, (0.0, 1.0))) * float(known[0])
    house = float(np.interp(building, _GARDEN_SHARES, (0.0, 1.0))) if known[0] else 1.0
    cost += _GARDEN_COST * (1 - house) * (library.kind == "garden")
    return np.asarray(cost + _BARE_COST * grown * np.isin(library.kind, _BARE))


def _color_cost(library: DetailLibrary, target: Image, weight: Image) -> Floats:
    """What it costs (N,) that ground and leaves have other colors than in the photo, and the sky other clouds."""
    seen = weight[0] / max(float(weight[0].max()), 1e-6) * (weight[FEATURES.index("plants")] > 0)
    ground, tints, _, leaves, wood = library.colors
    own_ground, own_tints, cells, own_leaves, own_wood = _mean_colors(target, seen)
    known = cells / (cells + _FEW_CELLS)
    cost = known * ((ground - own_ground) ** 2 @ np.array(_GROUND_WEIGHTS))
    cost += known * _TINTS_WEIGHT * np.maximum(tints - own_tints, 0)
    own_clouds, open_cells = _cloud_contrast(target, seen)
    cost += _CLOUDS_WEIGHT * (library.clouds - own_clouds) ** 2 * (open_cells / (open_cells + _FEW_CELLS))
    return np.asarray(
        cost + _LEAVES_WEIGHT * (leaves - own_leaves) ** 2 * (own_wood / (own_wood + _FEW_CELLS)) * (wood > _FEW_CELLS)
    )


def _cloud_contrast(features: Image, seen: Image) -> tuple[Floats, Floats]:
    """Mean contrast (...) of cells of open sky, and how many show it; arguments as those of `_mean_colors`."""
    contrast, plants, building = (
        features[..., FEATURES.index(name), _CLOUDS, :] for name in ("contrast", "plants", "building")
    )
    free = np.clip(1 - 2 * (plants + building), 0, 1) * seen[_CLOUDS]
    cells = free.sum(axis=(-2, -1))
    return (free * contrast).sum(axis=(-2, -1)) / np.maximum(cells, 1e-6), cells


def _mean_colors(features: Image, seen: Image) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """The ground's colors (..., 3), as _GROUND_WEIGHTS, its tints (...), its cells; the leaves' autumn and cells.

    Args:
        features: (..., F, FEATURE_ROWS, 2 FEATURE_ROWS), as FEATURES.
        seen: (FEATURE_ROWS, 2 FEATURE_ROWS) 1 for cells that count.
    """
    names = "red", "blue", "tints", "autumn", "plants", "building", "water"
    red, blue, tints, autumn, plants, building, water = (features[..., FEATURES.index(n), :, :] for n in names)
    bare = np.clip(1 - plants - building - water, 0, 1) * seen
    bare[..., : _GROUND.start, :] = bare[..., _GROUND.stop :, :] = 0
    leafy = plants.clip(0, 1) * seen
    leafy[..., _BAND.stop :, :] = 0
    cells, wood = bare.sum(axis=(-2, -1)), leafy.sum(axis=(-2, -1))
    values = -(red + blue) / 2, red - blue, autumn, tints
    *ground, varied = ((bare * value).sum(axis=(-2, -1)) / np.maximum(cells, 1e-6) for value in values)
    leaves = (leafy * autumn).sum(axis=(-2, -1)) / np.maximum(wood, 1e-6)
    return np.stack(ground, axis=-1), varied, cells, leaves, wood


def _class_shares(features: Image, seen: NDArray[np.bool_]) -> tuple[list[Floats], Floats]:
    """How much (..., 5 in a list) is seen of what _EXPECTED tells and of high buildings; how far it is known (5,).

    Args:
        features: (..., F, FEATURE_ROWS, 2 FEATURE_ROWS), as FEATURES.
        seen: (FEATURE_ROWS, 2 FEATURE_ROWS) cells that count.
    """
    means: list[Floats] = []
    parts = (("building", _BAND), ("plants", _BAND), ("water", _WATER), ("plants", _CANOPY), ("building", _CANOPY))
    for name, rows in parts:
        cells = features[..., FEATURES.index(name), rows, :][..., seen[rows]]
        means.append(np.asarray(cells.clip(0, 1).sum(axis=-1) / max(cells.shape[-1], 1), dtype=np.float64))
    counted = zip((_BAND, _WATER, _CANOPY), _WIDE_CELLS, strict=True)
    band, water, high = (min(np.count_nonzero(seen[rows]) / cells, 1.0) for rows, cells in counted)
    return means, np.array([band, band, water, band, high])


def _sun_cost(library: DetailLibrary, flipped: bool, sun_azimuth: float | None) -> Floats:
    """What the library's suns cost (N, turns) where the sun is."""
    turns = np.arange(2 * FEATURE_ROWS) * 180.0 / FEATURE_ROWS
    known = np.isfinite(library.sun_azimuth) & library.sunlit
    if sun_azimuth is None:
        return np.where(library.sunlit, _SHADE_COST, 0.0)[:, None] * np.ones(len(turns))
    azimuth = np.nan_to_num(library.sun_azimuth) * (-1 if flipped else 1)
    off = np.radians(azimuth[:, None] + turns - sun_azimuth)
    return np.asarray(np.where(known[:, None], _SUN_WEIGHT * (1 - np.cos(off)), _DULL_COST))
