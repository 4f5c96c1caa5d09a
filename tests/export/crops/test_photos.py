"""Ordinary photos: the sun stays where it is in the world, the likelihood holds what the row tells, suns are low."""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from export.crops.photos import (
    PHOTO_COLUMNS,
    PHOTOS,
    PhotoRow,
    PhotoSource,
    crop_photo,
    fit_elevation_prior,
    fit_elevation_scale,
    load_photos,
    photo_sun_likelihood,
    photo_weights,
    read_photo_rows,
    require_photo_rows,
)
from export.data.panoramas import DataError
from export.training.suitability_head import (
    SYNTHETIC_KINDS,
    UNSUITABLE_TABLE,
    _made_pictures,
    _read_unsuitable,
    _vary,
)
from lighting.geometry import angles
from lighting.sun_grid import grid_directions
from tests.helpers.panoramas import EXAMPLES_SPEC, source

ROW = PhotoRow(Path("a.jpg"), "a_1", 30.0, 20.0, 10.0, "yes", 60.0)


def photo(row: PhotoRow = ROW) -> PhotoSource:
    """A picture whose red tells the column and whose green tells the row."""
    y, x = np.mgrid[0:300, 0:400]
    return PhotoSource(row, np.stack([x * 0.6, y * 0.8, np.full_like(x, 90)], axis=-1).astype(np.uint8))


def test_an_off_centre_crop_sees_the_sun_at_another_azimuth() -> None:
    """The middle column of a crop tells which azimuth it looks at; with the sun's, it gives the sun of the row."""
    focal = 200 / math.tan(math.radians(30))
    rng = np.random.default_rng(1)
    for _ in range(30):
        crop = crop_photo(photo(), rng, EXAMPLES_SPEC)
        height, width = crop.linear.shape[:2]
        red = crop.linear[height // 2, width // 2 - 1 : width // 2 + 1, 0].mean()
        column = 255 * float(np.where(red <= 0.0031308, 12.92 * red, 1.055 * red ** (1 / 2.4) - 0.055)) / 0.6
        looking = math.degrees(math.atan2(column - 200, focal))
        azimuth = -crop.sun_azimuth if crop.camera.mirrored else crop.sun_azimuth
        assert azimuth + looking == pytest.approx(30.0, abs=1.0)
        assert max(height, width) == EXAMPLES_SPEC.width
        assert 0 < crop.camera.vertical_fov < 60
        assert math.isnan(crop.camera.elevation)


def test_the_likelihood_is_widest_where_least_is_known() -> None:
    crop = crop_photo(photo(), np.random.default_rng(0), EXAMPLES_SPEC)
    azimuth, elevation = angles(grid_directions(EXAMPLES_SPEC.sun_grid))
    weight = photo_sun_likelihood(crop, EXAMPLES_SPEC.sun_grid)
    assert weight.sum() == pytest.approx(1.0)
    best = int(np.argmax(weight))
    assert azimuth[best] == pytest.approx(crop.sun_azimuth, abs=5.0)
    assert elevation[best] == pytest.approx(20.0, abs=3.0)
    behind = np.abs(np.abs(azimuth - crop.sun_azimuth) - 180) < 30
    assert 0 < weight[behind].sum() < 0.05
    unknown = crop_photo(
        photo(PhotoRow(Path("a"), "a", math.nan, 20.0, math.nan, "", math.nan)),
        np.random.default_rng(0),
        EXAMPLES_SPEC,
    )
    ring = photo_sun_likelihood(unknown, EXAMPLES_SPEC.sun_grid)
    near = np.abs(elevation - 20.0) < 3.0
    assert np.ptp(ring[near]) < ring[near].max()
    assert ring[near].sum() > 0.5


def test_photos_are_read_and_low_suns_and_small_groups_count_more(data: Path) -> None:
    path = next((data / "panoramas").iterdir()) if (data / "panoramas").exists() else next(data.glob("*.png"))
    rows = [PhotoRow(path, g, 0.0, e, 10.0, "yes", 60.0) for g, e in (("a", 50), ("a", 50), ("b", 50), ("c", 5))]
    weights = photo_weights([PhotoSource(row, np.zeros((8, 8, 3), np.uint8)) for row in rows])
    assert weights.sum() == pytest.approx(1.0)
    assert weights[0] == weights[1] < weights[2] < weights[3]
    assert load_photos([]) == []


@pytest.mark.parametrize("scale", [30.0, 75.0, 150.0])
def test_the_scale_that_made_the_photos_is_found(scale: float) -> None:
    rng = np.random.default_rng(0)
    crops, weights = rng.uniform(0, 80, 4000), rng.uniform(0.5, 2.0, 4000)
    chance = weights * np.exp(-crops / scale)
    photos = rng.choice(crops, 40000, p=chance / chance.sum())
    fitted, gain = fit_elevation_scale(crops, weights, photos)
    assert fitted == pytest.approx(scale, rel=0.15)
    assert gain > 0


def test_photos_like_the_crops_need_the_widest_scale() -> None:
    crops = np.linspace(0, 80, 500)
    assert fit_elevation_scale(crops, np.ones(500), crops)[0] == 300.0


def test_the_scale_is_fitted_to_the_scenes_of_a_folder(data: Path, tmp_path: Path) -> None:
    (tmp_path / "panoramas").symlink_to(data / "panoramas")
    shutil.copy(data / "panoramas.csv", tmp_path)
    (tmp_path / "a.jpg").touch()  # no picture is read
    rows = [f"a.jpg,{group},0,{elevation},yes,60,5" for group, elevation in (("a", 5), ("a", 7), ("b", 9))]
    (tmp_path / "photos_train.csv").write_text("\n".join([",".join(PHOTO_COLUMNS), *rows]))
    assert fit_elevation_prior(tmp_path, data / "labels.csv").startswith("2 scenes: exp(-elevation / ")


def test_data_without_photos_are_refused(data: Path) -> None:
    with pytest.raises(DataError, match=r"no photo to learn from in .*photos_train\.csv"):
        fit_elevation_prior(data, data / "labels.csv")


CROP = np.tile(np.linspace(20, 220, 224).astype(np.uint8)[None, :, None], (168, 1, 3))
PANORAMA = source().levels[-1]


def test_listed_pictures_are_read_and_varied(tmp_path: Path) -> None:
    Image.new("RGB", (80, 60), (10, 90, 200)).save(tmp_path / "a.png")
    (tmp_path / UNSUITABLE_TABLE).write_text("file,kind,source\na.png,indoor,somebody/photos:a.png\n", encoding="utf-8")
    (picture,) = _read_unsuitable(tmp_path)
    assert (picture.kind, picture.group) == ("indoor", "somebody/photos")
    variant = _vary(picture.pixels, np.random.default_rng(0), EXAMPLES_SPEC)
    assert variant.shape == (168, 224, 3)
    assert variant[..., 2].mean() > variant[..., 0].mean()
    assert _read_unsuitable(tmp_path / "elsewhere") == []


MADE = dict(_made_pictures([(CROP, PANORAMA)] * len(SYNTHETIC_KINDS), EXAMPLES_SPEC))


@pytest.mark.parametrize("kind", SYNTHETIC_KINDS)
def test_made_pictures_fit_the_canvas(kind: str) -> None:
    assert MADE[kind].dtype == np.uint8
    assert max(MADE[kind].shape[:2]) <= EXAMPLES_SPEC.width


def test_what_is_made_is_what_it_is_called() -> None:
    side = MADE["on its side"]
    assert side.shape == (224, 168, 3)
    assert np.ptp(side[:, 0, 0].astype(int)) > 150
    assert MADE["night"].mean() < 0.5 * CROP.mean()
    assert MADE["black"].mean() < 12
    assert MADE["blown out"].mean() > 230
    assert MADE["whole panorama"].shape == (112, 224, 3)


def test_every_kind_gets_its_turn() -> None:
    crops = [(CROP, PANORAMA)] * 2 * len(SYNTHETIC_KINDS)
    assert [kind for kind, _ in _made_pictures(crops, EXAMPLES_SPEC)] == [*SYNTHETIC_KINDS] * 2


def table(folder: Path, *rows: str) -> None:
    (folder / PHOTOS).write_text("\n".join([",".join(PHOTO_COLUMNS), *rows]) + "\n", encoding="utf-8")
    (folder / "a.jpg").write_bytes(b"")


def test_rows_keep_what_they_know(tmp_path: Path) -> None:
    table(tmp_path, "a.jpg,x_1,-35.9,51.2,yes,53.1,15", "a.jpg,x_2,,4.0,unclear,,")
    one, other = read_photo_rows(tmp_path)
    assert (one.sun_azimuth, one.sun_elevation, one.direct, one.azimuth_std) == (-35.9, 51.2, "yes", 15.0)
    assert math.isnan(other.sun_azimuth)
    assert math.isnan(other.horizontal_fov)
    assert other.direct == ""


def test_a_folder_without_the_table_has_no_photos(tmp_path: Path) -> None:
    assert read_photo_rows(tmp_path) == []


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("a.jpg,x,1,,yes,50,15", "sun_elevation is empty"),
        ("b.jpg,x,1,2,yes,50,15", "no photo"),
        ("a.jpg,x,w,2,,,", "'w'"),
    ],
)
def test_a_row_that_cannot_be_used_is_named(tmp_path: Path, row: str, words: str) -> None:
    table(tmp_path, row)
    with pytest.raises(DataError, match=f"line 2: .*{words}"):
        read_photo_rows(tmp_path)


def test_photos_that_are_needed_are_there_and_permissive_where_that_is_asked(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"There is no photo to learn from in .*photos_train\.csv\.$"):
        require_photo_rows(tmp_path)
    table(tmp_path, "a.jpg,x_1,1,2,yes,50,15")
    assert len(require_photo_rows(tmp_path)) == 1
    with pytest.raises(DataError, match="no photo with a permissive licence"):
        require_photo_rows(tmp_path, licensed_only=True)
    lines = [",".join([*PHOTO_COLUMNS, "licence"])]
    lines += [f"a.jpg,{licence},1,2,yes,50,15,{licence}" for licence in ("none stated", "GPL", "CC-BY 4.0", "")]
    (tmp_path / PHOTOS).write_text("\n".join(lines), encoding="utf-8")
    assert [row.group for row in require_photo_rows(tmp_path, licensed_only=True)] == ["CC-BY 4.0"]
    assert len(require_photo_rows(tmp_path)) == 4
