"""Spheres under a map, alone and in the photo."""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import mitsuba as mitsuba_renderer
import numpy as np
import pytest
from PIL import Image

from lighting.color import luminance, srgb_decode, srgb_encode, tone_map
from lighting.envmap.render import render, sun_light
from lighting.geometry import (
    EYE_HEIGHT,
    Floats,
    Pinhole,
    angle_between,
    camera_directions,
    camera_pixel,
    direction,
    latlong_directions,
)
from lighting.ground import OBJECT_RADIUS
from lighting.prediction import SurfaceClass
from lighting.preview import spheres as spheres
from lighting.preview.spheres import (
    DIFFUSE,
    DIFFUSE_REFLECTANCE,
    GLOSSINESS,
    GLOSSY,
    GLOSSY_REFLECTANCE,
    MIRROR,
    MIRROR_REFLECTANCE,
    SphereScene,
    _ball_centers,
    _coarse_ground_points,
    _ground_radiance,
    _shade_sphere,
    _shadow_cells,
    _shadow_factors,
    _sky_radiance,
    _visible_sun_share,
    build_sphere_scene,
    insert_balls,
    render_spheres,
    sphere_centers,
)
from lighting.records import Lighting
from tests.helpers.predictions import stated_light
from tests.helpers.scenes import outdoors

mi: Any = mitsuba_renderer

SIDE = 0.1  # of a patch, in sphere radii
GLOSSY_ROUGHNESS = (2 * GLOSSINESS) ** -0.5  # of the Beckmann lobe that spreads reflections as the glossy lobe does
CENTERS = np.array([[-2.6, 1.0, 0.0], [0.0, 1.0, 0.0], [2.6, 1.0, 0.0]])
PHOTO_WIDTH, PHOTO_HEIGHT = 160, 120
BARE = replace(stated_light(40.0), sun_azimuth=-90.0, camera_elevation=-10.0)
CAMERA = Pinhole(PHOTO_WIDTH, PHOTO_HEIGHT, BARE.vertical_fov, elevation=-10.0)
SPOT = camera_directions(replace(CAMERA, width=PHOTO_WIDTH + 1))[round(0.8 * PHOTO_HEIGHT), PHOTO_WIDTH // 2]
LIGHT = replace(BARE, spot_pixel=(80.0, 96.0), spot_direction=tuple(SPOT.tolist()), ground_visible=0.5)
BALL_CENTERS, RADIUS = _ball_centers(CAMERA, SPOT, EYE_HEIGHT)
SUNLIT = (
    np.array(stated_light(40.0).ground_color)
    / np.pi
    * (np.array([0.4, 0.5, 0.8]) + np.sin(np.radians(40.0)) * np.array([1.9, 1.5, 0.9]))
)
SHADED = np.array([0.12, 0.11, 0.1]) / np.pi * np.array([0.4, 0.5, 0.8])


def color(value: Any) -> dict[str, Any]:
    return {"type": "rgb", "value": np.asarray(value, dtype=float).tolist()}


def path_tracer(lighting: Lighting) -> Any:
    """The three spheres under sky and sun, which is a direction here: no patch lies in a penumbra."""
    mirror = {"type": "conductor", "material": "none", "specular_reflectance": color([MIRROR_REFLECTANCE] * 3)}
    glossy = {"type": "roughconductor", "material": "none", "specular_reflectance": color([GLOSSY_REFLECTANCE] * 3)}
    diffuse = {"type": "diffuse", "reflectance": color([DIFFUSE_REFLECTANCE] * 3)}
    surfaces = [mirror, {**glossy, "alpha": GLOSSY_ROUGHNESS}, diffuse]
    rotated = mi.ScalarTransform4f().rotate([0, 1, 0], 180)
    level = mi.ScalarTransform4f().rotate([1, 0, 0], -90).scale(500)
    ground = {"type": "diffuse", "reflectance": color([lighting.ground_albedo] * 3)}
    sky = mi.Bitmap(render(lighting, 256, disc=False))
    sun = {"direction": (-lighting.sun_direction).tolist(), "irradiance": color(sun_light(lighting)[0])}
    balls = zip(CENTERS.tolist(), surfaces, strict=True)
    return mi.load_dict({
        "type": "scene",
        "sky": {"type": "envmap", "bitmap": sky, "to_world": rotated},
        "sun": {"type": "directional", **sun},
        "ground": {"type": "disk", "to_world": level, "bsdf": ground},
        **{f"ball {i}": {"type": "sphere", "center": center, "bsdf": bsdf} for i, (center, bsdf) in enumerate(balls)},
    })  # fmt: skip


def traced(scene: Any, point: Floats) -> Floats:
    """Mean radiance (3,) of the patch around a point on the ground, seen from just above it."""
    height = 1e-3
    eye = mi.ScalarTransform4f().look_at((point + np.array([0.0, height, 0.0])).tolist(), point.tolist(), [0, 0, -1])
    film = {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}}
    sensor = mi.load_dict({
        "type": "perspective", "fov": float(2 * np.degrees(np.arctan(0.5 * SIDE / height))), "near_clip": 1e-5,
        "to_world": eye, "film": film, "sampler": {"type": "independent", "sample_count": 400},
    })  # fmt: skip
    integrator = mi.load_dict({"type": "path", "max_depth": 6})
    picture = np.array(mi.render(scene, sensor=sensor, integrator=integrator, seed=1))
    return np.asarray(picture[..., :3].mean(axis=(0, 1), dtype=np.float64))


def ours(lighting: Lighting, points: Floats) -> Floats:
    """Radiance (N, 3) of the patches around points (N, 3)."""
    stage = build_sphere_scene(render(lighting, 512), lighting.sun_direction, CENTERS)
    step = (np.arange(4) + 0.5) / 4 * SIDE - SIDE / 2
    offsets = np.stack([*np.meshgrid(step, [0.0], step)], axis=-1).reshape(-1, 3)
    patches = (points[:, None] + offsets).reshape(-1, 3)
    return np.asarray(_ground_radiance(patches, stage).reshape(len(points), -1, 3).mean(axis=1))


def patches(lighting: Lighting) -> Floats:
    """Beside the diffuse sphere's foot, in its and the glossy one's shadow from foot to tip, and in the sun."""
    away = -direction(lighting.sun_azimuth, 0.0)
    elevation = np.radians(lighting.sun_elevation)
    tip = (1 + np.cos(elevation)) / np.sin(elevation)
    shaded = [CENTERS[ball] * [1, 0, 1] + part * tip * away for ball in (DIFFUSE, GLOSSY) for part in (0.3, 0.6, 0.9)]
    across = np.array([away[2], 0, -away[0]])
    foot = CENTERS[DIFFUSE] * [1, 0, 1]
    return np.array([foot + 0.15 * away, *shaded, foot - 1.2 * away, foot - away + 1.5 * across, [1.3, 0.0, 1.5]])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("azimuth", "elevation", "turbidity"), [(-125.0, 33.0, 3.0), (-70.0, 35.0, 3.0), (-160.0, 58.0, 5.0)]
)
def test_the_ground_is_as_bright_as_a_path_tracer_says(azimuth: float, elevation: float, turbidity: float) -> None:
    mi.set_variant("scalar_rgb")
    lighting = Lighting(azimuth, elevation, turbidity, 1.0)
    points = patches(lighting)
    scene = path_tracer(lighting)
    expected = luminance(np.array([traced(scene, point) for point in points]))
    radiance = luminance(ours(lighting, points))
    np.testing.assert_allclose(radiance[1:4], expected[1:4], rtol=0.03)
    np.testing.assert_allclose(
        radiance[4:], expected[4:], rtol=0.08
    )  # its noise is 2 %, the glossy lobe is not quite ours
    assert abs(radiance[0] - expected[0]) < 0.007 * expected[-1]  # beside a foot, where it is 0.04 of it


WIDTH, HEIGHT, PITCH = 160, 110, -10.0


def render_outdoors(azimuth: float, elevation: float, visibility: float = 1.0) -> Lighting:
    return Lighting(azimuth, elevation, 3.0, 5.0, sun_visibility=visibility, camera_elevation=PITCH)


@lru_cache
def picture(azimuth: float, elevation: float, visibility: float = 1.0) -> Floats:
    lighting = render_outdoors(azimuth, elevation, visibility)
    return render_spheres(render(lighting, 128), lighting, WIDTH, HEIGHT, supersampling=1)


def pixel(point: Floats) -> tuple[int, int]:
    """Row and column of a point in the scene."""
    x, y = camera_pixel(point, Pinhole(WIDTH, HEIGHT, spheres.VERTICAL_FOV, elevation=PITCH))
    return int(y), int(x)


def centers() -> Floats:
    return spheres.sphere_centers(WIDTH / HEIGHT, PITCH).astype(np.float64)


def brightness(image: Floats, point: Floats) -> float:
    """Mean luminance of 3 x 3 pixels around a point in the scene."""
    row, column = pixel(point)
    return float(luminance(image[row - 1 : row + 2, column - 1 : column + 2]).mean())


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_diffuse_sphere_is_brighter_on_the_suns_side(side: float) -> None:
    image = picture(side * 110.0, 40.0)
    middle = centers()[DIFFUSE]
    lit, dark = (brightness(image, middle + np.array([s * 0.6, 0.3, 0.5])) for s in (side, -side))
    assert lit > 1.5 * dark


@pytest.mark.parametrize("azimuth", [-60.0, 60.0, 140.0, -140.0])
def test_shadow_falls_opposite_the_sun(azimuth: float) -> None:
    image = picture(azimuth, 40.0)
    foot = centers()[GLOSSY] - np.array([0.0, 1.0, 0.0])
    away = 1.8 * direction(azimuth, 0.0)
    assert brightness(image, foot - away) < 0.6 * brightness(image, foot + away)


def test_overcast_casts_no_hard_shadow() -> None:
    foot = centers()[DIFFUSE] - np.array([0.0, 1.0, 0.0])
    row = pixel(foot + np.array([0.0, 0.0, 0.2]))[0]
    steps = [np.abs(np.diff(luminance(picture(100.0, 50.0, v)[row]) / luminance(picture(100.0, 50.0, v)[-1, 0])))
             for v in (1.0, 0.1)]  # fmt: skip
    assert steps[0].max() > 0.3
    assert steps[1].max() < 0.08


def test_ground_is_darkest_under_a_sphere_without_sun() -> None:
    image = picture(100.0, 50.0, 0.1)
    foot = centers()[DIFFUSE] - np.array([0.0, 1.0, 0.0])
    near, far = brightness(image, foot + np.array([0, 0, 0.7])), brightness(image, foot + np.array([0, 0, 2.2]))
    assert near < 0.75 * far


def test_open_ground_has_the_colour_of_the_maps_ground() -> None:
    lighting = render_outdoors(30.0, 50.0)
    envmap = render(lighting, 128)
    image = render_spheres(envmap, lighting, WIDTH, HEIGHT, supersampling=1)
    below_horizon = pixel(np.array([0.0, -1.0, -60.0]))[0]
    np.testing.assert_allclose(image[below_horizon, 2], envmap[-1, 0], rtol=0.02)


def test_backdrop_is_the_map_behind() -> None:
    lighting = render_outdoors(150.0, 50.0)
    envmap = render(lighting, 128)
    image = render_spheres(envmap, lighting, WIDTH, HEIGHT, supersampling=1)
    row, column = pixel(direction(-10.0, 6.0))
    np.testing.assert_allclose(
        image[row, column], envmap[int((0.5 - 6 / 180) * 128), int((0.5 - 10 / 360) * 256)], rtol=0.05
    )


@pytest.mark.parametrize("azimuth", [-150.0, 150.0])
def test_mirror_shows_what_is_behind_the_camera_on_the_same_side(azimuth: float) -> None:
    envmap = np.where(latlong_directions(128) @ direction(azimuth, 25.0) > 0.97, 9.0, 0.1)[..., None]
    image = render_spheres(
        np.repeat(envmap, 3, axis=-1).astype(np.float32), render_outdoors(0.0, 80.0), WIDTH, HEIGHT, 1
    )
    row, column = pixel(centers()[MIRROR])
    reach = 14
    face = luminance(image[row - reach : row + reach, column - reach : column + reach])
    spot = np.argwhere(face > 5).mean(axis=0) - reach
    assert spot[0] < 0
    assert np.sign(spot[1]) == np.sign(azimuth)


@pytest.mark.parametrize(("azimuth", "elevation"), [(0.0, 0.0), (180.0, 90.0), (-179.9, 0.4)])
def test_extreme_suns_give_finite_pictures(azimuth: float, elevation: float) -> None:
    image = picture(azimuth, elevation)
    assert np.isfinite(image).all()
    assert image.min() >= 0


@pytest.fixture(scope="module")
def stage() -> SphereScene:
    lighting = outdoors(90.0, 45.0)
    return build_sphere_scene(render(lighting, 128), lighting.sun_direction, CENTERS)


def test_the_suns_disc_is_seen_in_full_beside_a_shadow_and_not_at_all_inside(stage: SphereScene) -> None:
    points = CENTERS[MIRROR] + np.array([[0.0, -1.0, 5.0], [-1.0, -1.0, 0.0]])
    assert _visible_sun_share(points, stage).tolist() == [1.0, 0.0]


def test_the_disc_carries_the_suns_power_whatever_its_size(stage: SphereScene) -> None:
    to_sun = stage.sun_direction[None]
    for radius in (0.3, 1.0):
        disc = _sky_radiance(to_sun, stage, radius) - _sky_radiance(to_sun, stage, None)
        solid_angle = 2 * np.pi * (1 - np.cos(np.radians(radius)))
        np.testing.assert_allclose(disc[0] * solid_angle, stage.sun_irradiance, rtol=1e-9)


def test_open_ground_far_away_has_the_radiance_of_the_map(stage: SphereScene) -> None:
    np.testing.assert_allclose(_ground_radiance(np.array([[0.0, 0.0, 400.0]]), stage)[0], stage.ground, rtol=1e-3)


def test_a_mirror_shows_the_sky_that_it_reflects(stage: SphereScene) -> None:
    normal = np.array([[0.0, 1.0, 0.0]])
    ray = -direction(0.0, 60.0)[None]  # down onto the top, which throws it up and away from the camera
    radiance = _shade_sphere(MIRROR, CENTERS[MIRROR] + normal, ray, stage, mirrored=False)
    reflected = ray - 2 * (ray @ normal.T) * normal
    expected: Floats = MIRROR_REFLECTANCE * _sky_radiance(reflected, stage, None)
    np.testing.assert_allclose(radiance, expected, rtol=1e-6)  # spheres are of 32 bits


def test_the_diffuse_sphere_is_lit_on_the_suns_side(stage: SphereScene) -> None:
    sides = np.array([[0.7, 0.7, 0.0], [-0.7, 0.7, 0.0]])
    lit, dark = _shade_sphere(DIFFUSE, CENTERS[DIFFUSE] + sides, np.zeros((2, 3)), stage, mirrored=False).mean(axis=1)
    assert lit > 1.5 * dark


@pytest.mark.parametrize(("azimuth", "elevation"), [(-60.0, 25.0), (150.0, 8.0)])
def test_fewer_rays_on_even_ground_and_sky_cannot_be_seen(azimuth: float, elevation: float) -> None:
    """Against four rays for every pixel, by the picture as it is shown, before it is rounded."""
    lighting = render_outdoors(azimuth, elevation)
    centers = spheres.sphere_centers(WIDTH / HEIGHT, PITCH)
    scene = build_sphere_scene(render(lighting, 256), lighting.sun_direction, centers)
    fine = Pinhole(2 * WIDTH, 2 * HEIGHT, spheres.VERTICAL_FOV, elevation=PITCH)
    every = spheres._trace_rays(camera_directions(fine).astype(np.float32), scene)
    some = render_spheres(render(lighting, 256), lighting, WIDTH, HEIGHT, supersampling=2, centers=centers)
    before, after = (
        255 * srgb_encode(np.clip(picture, 0, 1)).reshape(HEIGHT, 2, WIDTH, 2, 3).mean(axis=(1, 3))
        for picture in (every, some)
    )
    off = np.abs(after - before)
    assert off.max() < 3  # of 255 levels
    assert np.quantile(off, 0.995) < 0.5
    assert np.any(every != some)


@lru_cache(maxsize=1)
def balls_in_light() -> SphereScene:
    centers = sphere_centers(4 / 3, -10.0).astype(np.float64)
    return build_sphere_scene(render(LIGHT, 64), LIGHT.sun_direction, centers)


def drawn(ground: np.ndarray) -> np.ndarray:
    """Linear values of a picture of one color with the balls in it."""
    picture = Image.fromarray(tone_map(np.broadcast_to(ground, (PHOTO_HEIGHT, PHOTO_WIDTH, 3))))
    return srgb_decode(np.asarray(insert_balls(picture, LIGHT, balls_in_light())) / 255.0)


def test_the_balls_stand_side_by_side_on_the_spot() -> None:
    centers = BALL_CENTERS
    assert np.ptp(centers[:, 1]) == pytest.approx(0.0, abs=1e-9)
    assert centers[0, 0] < centers[1, 0] < centers[2, 0]
    foot = centers[1] - [0.0, 1.0, 0.0]
    assert angle_between(foot, SPOT) < 1e-6
    x, y = camera_pixel(centers[1], CAMERA)
    assert x == pytest.approx(PHOTO_WIDTH / 2, abs=1)
    assert camera_pixel(foot, CAMERA)[1] - y == pytest.approx(OBJECT_RADIUS * PHOTO_HEIGHT, rel=0.15)
    assert pytest.approx(OBJECT_RADIUS * PHOTO_HEIGHT) == RADIUS


def test_balls_on_far_ground_are_no_giants() -> None:
    """A meter of radius at most, however high the camera is, and none reaches above the camera."""
    far = camera_directions(replace(CAMERA, height=1200, width=1600))[420, 800]
    for height, radius in ((1.6, 0.4 * 1.6), (60.0, 1.0)):
        centers, pixels = _ball_centers(CAMERA, far, height)
        assert height / (1 - centers[1, 1]) == pytest.approx(radius)  # its radius, by the camera's height in radii
        assert pixels < OBJECT_RADIUS * PHOTO_HEIGHT


def test_a_picture_without_a_spot_stays_as_it_is() -> None:
    picture = Image.new("RGB", (80, 60), (90, 120, 160))
    assert insert_balls(picture, replace(BARE, ground_visible=0.0), balls_in_light()) is picture


def test_what_stands_before_the_ground_takes_no_shadow() -> None:
    """A person where the shadow falls keeps the picture's pixels; without them they are darker."""
    people = np.zeros((18, 24, 10), dtype=np.float32)
    people[..., SurfaceClass.GROUND] = 1.0
    people[8:17, 15:22] = np.eye(10, dtype=np.float32)[SurfaceClass.PERSON]
    picture = Image.fromarray(tone_map(np.broadcast_to(SUNLIT, (PHOTO_HEIGHT, PHOTO_WIDTH, 3))))
    before = np.asarray(picture).astype(int)
    with_people, plain = (
        np.abs(np.asarray(insert_balls(picture, LIGHT, balls_in_light(), segments)).astype(int) - before)[
            80:105, 108:124
        ]
        for segments in (people, None)
    )
    assert plain.max() > 20
    assert with_people.max() <= 1


def test_balls_touch_whatever_the_picture_shows_at_their_feet() -> None:
    """Leaves, which else take no shadow, are darker beside a ball's foot, also where no sun shines."""
    leaves = np.zeros((18, 24, 10), dtype=np.float32)
    leaves[..., SurfaceClass.PLANTS] = 1.0
    picture = Image.fromarray(tone_map(np.broadcast_to(SUNLIT, (PHOTO_HEIGHT, PHOTO_WIDTH, 3))))
    shown = np.asarray(insert_balls(picture, replace(LIGHT, sun_visibility=0.05), balls_in_light(), leaves)).astype(int)
    darker = np.asarray(picture).astype(int) - shown
    foot = camera_pixel(np.array(LIGHT.spot_direction), CAMERA).astype(int)
    below = darker[foot[1] + 1 : foot[1] + int(RADIUS / 2), foot[0]]
    assert below.max() > 20
    assert np.abs(darker[-2:]).max() <= 1


@pytest.mark.parametrize("size", [(32, 256), (256, 32)])
def test_a_narrow_picture_shows_the_balls(size: tuple[int, int]) -> None:
    picture = Image.new("RGB", size, (90, 120, 160))
    pasted = insert_balls(picture, LIGHT, balls_in_light())
    assert pasted.size == size
    assert pasted.getpixel((size[0] // 2, round(0.8 * size[1]) - 2)) != (90, 120, 160)


def test_a_narrow_picture_has_all_balls_inside() -> None:
    narrow = Pinhole(32, 256, LIGHT.vertical_fov, elevation=-10.0)
    centers, radius = _ball_centers(narrow, SPOT, EYE_HEIGHT)
    x = camera_pixel(centers, narrow)[:, 0]
    assert radius < OBJECT_RADIUS * 256
    assert x.min() - radius > 0
    assert x.max() + radius < 32


def test_sunlit_ground_gets_a_shadow_down_to_the_skys_light() -> None:
    share = drawn(SUNLIT) / SUNLIT
    right = share[70:110, 100:150, 1]  # the sun stands at the left
    assert right.min() < 1.4 * SHADED[1] / SUNLIT[1]
    assert share[:30] == pytest.approx(1.0, abs=0.1)
    left = share[88:104, 5:40, 1]
    assert left.min() > 0.8


@pytest.mark.parametrize("own", [0.6, 1.0, 1.3])
def test_cast_shadows_are_as_dark_as_the_photos_own(own: float) -> None:
    """The picture's left lies in shade that is darker, or brighter, than the light says."""
    ground = np.broadcast_to(SUNLIT, (PHOTO_HEIGHT, PHOTO_WIDTH, 3)).copy()
    ground[:, :24] = own * SHADED
    share = (drawn(ground) / ground)[70:110, 100:150, 1]
    assert np.median(share[share < 0.8]) == pytest.approx(own * SHADED[1] / SUNLIT[1], rel=0.25)


def test_the_edges_of_shadows_are_smooth() -> None:
    """As with eight times as many rays each way, to a tenth; by a ray for two pixels they would be stairs."""
    moved = replace(balls_in_light(), centers=BALL_CENTERS)
    fine = replace(CAMERA, width=8 * PHOTO_WIDTH, height=8 * PHOTO_HEIGHT)
    dark = _shadow_cells(*_coarse_ground_points(CAMERA, moved), moved)
    many = (
        _shadow_factors(fine, moved, np.ones((1, 1), dtype=bool))
        .reshape(PHOTO_HEIGHT, 8, PHOTO_WIDTH, 8)
        .mean(axis=(1, 3))
    )
    share = _shadow_factors(CAMERA, moved, dark)
    edge = (many > 0.01) & (many < 0.99)
    assert edge.sum() > 50
    assert np.abs(share - many)[edge].mean() < 0.12  # one ray a pixel: 0.21
    assert np.abs(share - many)[~edge].max() < 0.02


def test_ground_in_shade_is_not_darkened_by_the_sun_again() -> None:
    """The picture's right lies in shade; there the sun at the left throws the balls' shadows."""
    ground = np.broadcast_to(SUNLIT, (PHOTO_HEIGHT, PHOTO_WIDTH, 3)).copy()
    ground[:, 104:] = SHADED
    beside = (drawn(ground) / ground)[70:110, 112:150, 1]
    assert beside.min() > 0.6
    assert (drawn(SUNLIT) / SUNLIT)[70:110, 112:150, 1].min() < beside.min() - 0.2


def test_balls_on_ground_in_shade_are_in_shade() -> None:
    """Seen from where the sun is, the gray ball of the shaded picture has the sky's light alone."""
    behind = replace(LIGHT, sun_azimuth=180.0)
    centers = sphere_centers(4 / 3, -10.0).astype(np.float64)
    lit = build_sphere_scene(render(behind, 64), behind.sun_direction, centers)
    x, y = (round(float(v)) for v in camera_pixel(BALL_CENTERS[2], CAMERA))
    positions = {}
    for name, under in (("sun", SUNLIT), ("shade", SHADED)):
        ground = np.broadcast_to(SUNLIT, (PHOTO_HEIGHT, PHOTO_WIDTH, 3)).copy()
        ground[80:110, 30:130] = under
        picture = Image.fromarray(tone_map(ground))
        positions[name] = srgb_decode(np.asarray(insert_balls(picture, behind, lit)) / 255.0)[y, x]
    sky, sun = np.array([0.4, 0.5, 0.8]), np.array([1.9, 1.5, 0.9])
    assert positions["shade"][1] < positions["sun"][1] / 2
    assert positions["shade"] == pytest.approx(DIFFUSE_REFLECTANCE / np.pi * sky, rel=0.6)
    assert positions["sun"][1] - positions["shade"][1] == pytest.approx(DIFFUSE_REFLECTANCE / np.pi * sun[1], rel=0.3)


def test_the_balls_are_seen() -> None:
    linear = drawn(SHADED)
    x, y = (round(float(v)) for v in camera_pixel(BALL_CENTERS[2], CAMERA))
    assert linear[y - 2, x].mean() > 2 * SHADED.mean()


def test_a_light_of_overcast_skies_throws_no_hard_shadow() -> None:
    dull = Lighting(
        0.0, 40.0, 3.0, 1.0, camera_elevation=-10.0, sky_cover=1.0, ground_color=(0.12, 0.12, 0.12),
        sun_irradiance=(0.0, 0.0, 0.0), sky_irradiance=(0.8, 0.8, 0.8),
        spot_pixel=LIGHT.spot_pixel, spot_direction=LIGHT.spot_direction,
    )  # fmt: skip
    centers = sphere_centers(4 / 3, -10.0).astype(np.float64)
    lit = build_sphere_scene(render(dull, 64), dull.sun_direction, centers)
    level = np.full(3, 0.12 / np.pi * 0.8)
    picture = Image.fromarray(tone_map(np.broadcast_to(level, (PHOTO_HEIGHT, PHOTO_WIDTH, 3))))
    share = srgb_decode(np.asarray(insert_balls(picture, dull, lit)) / 255.0) / level
    assert share[70:110, 125:].min() > 0.75


def test_soft_light_leaves_a_contact_shadow_at_every_ball() -> None:
    """Level ground before each foot gets less of the sky: by a third at half a radius, by none at three."""
    dull = replace(LIGHT, sun_irradiance=(0.0, 0.0, 0.0), sky_irradiance=(0.8, 0.8, 0.8), sky_cover=1.0)
    centers = sphere_centers(4 / 3, -10.0).astype(np.float64)
    lit = build_sphere_scene(render(dull, 64), dull.sun_direction, centers)
    level = np.array(LIGHT.ground_color) / np.pi * 0.8
    picture = Image.fromarray(tone_map(np.broadcast_to(level, (4 * PHOTO_HEIGHT, 4 * PHOTO_WIDTH, 3))))
    share = srgb_decode(np.asarray(insert_balls(picture, dull, lit)) / 255.0)[..., 1] / level[1]
    large = replace(CAMERA, width=4 * PHOTO_WIDTH, height=4 * PHOTO_HEIGHT)
    for center in BALL_CENTERS:
        for radii, low, high in ((0.5, 0.2, 0.65), (3.0, 0.9, 1.05)):  # from the foot towards the camera
            x, y = camera_pixel(center - [0.0, 1.0, 0.0] + [0.0, 0.0, radii], large).round().astype(int)
            assert low < share[y, x] < high
