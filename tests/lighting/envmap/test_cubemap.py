import numpy as np
import pytest

from lighting.envmap.latlong import FACES, cubemap_directions, prefilter_cubemap, to_cubemap
from lighting.geometry import latlong_directions, latlong_solid_angle


def test_faces_look_where_their_names_say() -> None:
    middles = cubemap_directions(3)[:, 1, 1]
    for name, middle in zip(FACES, middles, strict=True):
        expected = np.zeros(3)
        expected["XYZ".index(name[1])] = 1 if name[0] == "+" else -1
        assert middle == pytest.approx(expected)


def test_rows_and_columns_are_opengls() -> None:
    """Table 8.19 of its specification: for +X, s is -z and t is -y; for +Y, s is x and t is z; for -Z, s is -x."""
    first = cubemap_directions(64)[:, 0, 0]
    signs = np.sign(first)
    assert signs.tolist() == [[1, 1, 1], [-1, 1, -1], [-1, 1, -1], [-1, -1, 1], [-1, 1, 1], [1, 1, -1]]


def test_a_map_is_the_same_as_a_cubemap() -> None:
    directions = latlong_directions(64)
    image = (1 + directions @ np.diag([0.5, 0.3, 0.2])).astype(np.float32)
    assert to_cubemap(image, 16) == pytest.approx(1 + cubemap_directions(16) @ np.diag([0.5, 0.3, 0.2]), abs=0.01)


def test_mirror_images_are_means_by_ggx() -> None:
    """Against the sum over all pixels of the map, direction by direction."""
    image = np.random.default_rng(3).random((96, 192, 3)).astype(np.float32)
    image[20:24, 30:36] = 50.0
    sharp, rough, roughest = prefilter_cubemap(image, 16, [0.0, 0.5, 1.0])
    assert [level.shape[1] for level in (sharp, rough, roughest)] == [16, 8, 4]
    directions, weight = latlong_directions(96).reshape(-1, 3), np.repeat(latlong_solid_angle(96), 192)
    for level, alpha, size in ((rough, 0.25, 8), (roughest, 1.0, 4)):
        for face, row, column in ((0, 1, 1), (2, 2, 1), (5, 0, 2)):
            cosine = directions @ cubemap_directions(size)[face, row, column]
            half2 = (1 + cosine) / 2
            share = np.maximum(cosine, 0) / (half2 * (alpha**2 - 1) + 1) ** 2 * weight
            expected = share @ image.reshape(-1, 3) / share.sum()
            assert level[face, row, column] == pytest.approx(expected, rel=0.05)
