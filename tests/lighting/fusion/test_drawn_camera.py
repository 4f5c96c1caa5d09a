"""The camera by lines that a person draws, by a thing of known size, and by fSpy."""

import json
import math
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lighting.errors import ParameterError
from lighting.fusion.drawn_camera import fit_camera, height_by_reference
from lighting.fusion.fspy import read_fspy
from lighting.fusion.marks import (
    DrawnCamera,
    KnownCamera,
    LevelLines,
    Line,
    Reference,
    move_drawn,
    read_edge,
    read_line,
    read_reference,
)
from lighting.fusion.user_input import UserInput
from lighting.geometry import Floats, Pinhole, camera_pixel, direction, pixel_ray

CASES = json.loads(Path(__file__).with_name("drawn_cameras.json").read_text())
TRUE = Pinhole(1200, 900, 52.0, 0.0, -7.0, 4.0)
GUESS = replace(TRUE, vertical_fov=57.0, elevation=1.0, roll=0.0)  # by the pixels, wrong


def pixel(direction_to: Floats) -> tuple[float, float]:
    x, y = camera_pixel(direction_to, TRUE)
    return float(x), float(y)


def horizon() -> Line:
    return (*pixel(direction(-20.0, 0.0)), *pixel(direction(25.0, 0.0)))


def vertical(azimuth: float) -> Line:
    return (*pixel(direction(azimuth, -12.0)), *pixel(direction(azimuth, 9.0)))


def on_ground(azimuth: float, distance: float, height: float = 0.0) -> tuple[float, float]:
    """The pixel of a point that far from a camera 1.6 m above the ground, at a height [m]."""
    level = distance * direction(azimuth, 0.0)
    return pixel((level + np.array([0.0, height - 1.6, 0.0])) / math.hypot(distance, height - 1.6))


@pytest.mark.parametrize("case", CASES["cases"], ids=lambda case: case["name"])
def test_the_page_finds_the_same_camera_while_lines_are_drawn(case: dict[str, Any]) -> None:
    """The page's own test reads the same file."""
    (width, height), (elevation, roll, fov) = CASES["size"], CASES["pixels"]
    drawn = DrawnCamera(
        tuple(case["horizon"]) if case["horizon"] else None,
        tuple(map(tuple, case["verticals"])),
        tuple(LevelLines(tuple(map(tuple, group))) for group in case["levels"]),
    )
    fitted = fit_camera(Pinhole(width, height, fov, 0.0, elevation, roll), drawn, lens_known=case["lens_known"])
    assert [fitted.elevation, fitted.roll, fitted.vertical_fov] == pytest.approx(case["camera"], abs=1e-3)


def test_a_drawn_horizon_tilts_the_camera() -> None:
    fitted = fit_camera(replace(GUESS, vertical_fov=52.0), DrawnCamera(horizon()), lens_known=True)
    assert (fitted.elevation, fitted.roll) == pytest.approx((-7.0, 4.0), abs=0.3)
    assert fitted.vertical_fov == 52.0


def test_upright_lines_beside_the_horizon_give_the_lens() -> None:
    drawn = DrawnCamera(horizon(), (vertical(-22.0), vertical(24.0)))
    fitted = fit_camera(GUESS, drawn, lens_known=False)
    assert (fitted.elevation, fitted.roll) == pytest.approx((-7.0, 4.0), abs=0.5)
    assert abs(fitted.vertical_fov - 52.0) < abs(GUESS.vertical_fov - 52.0)


def test_upright_lines_alone_tilt_the_camera() -> None:
    drawn = DrawnCamera(verticals=(vertical(-22.0), vertical(0.0), vertical(24.0)))
    fitted = fit_camera(replace(GUESS, vertical_fov=52.0), drawn, lens_known=True)
    assert (fitted.elevation, fitted.roll) == pytest.approx((-7.0, 4.0), abs=1.5)


def level(height: float, azimuth: float, begin: float, end: float) -> Line:
    """An edge that runs towards an azimuth on the side of a house, at a height over the camera [m]."""
    wall = 6.0 * direction(azimuth + 45.0, 0.0) if azimuth < 0 else 6.0 * direction(azimuth - 45.0, 0.0)
    ends = (wall + along * direction(azimuth, 0.0) + [0.0, height, 0.0] for along in (begin, end))
    return tuple(value for end in ends for value in pixel(end / np.linalg.norm(end)))  # type: ignore[return-value]


HOUSE = tuple(LevelLines((level(-1.5, a, 1.0, 7.0), level(1.2, a, 1.0, 7.0))) for a in (-45.0, 45.0))


def test_level_edges_of_a_house_give_tilt_and_lens() -> None:
    fitted = fit_camera(GUESS, DrawnCamera(levels=HOUSE), lens_known=False)
    assert (fitted.elevation, fitted.roll) == pytest.approx((-7.0, 4.0), abs=1.0)
    assert fitted.vertical_fov == pytest.approx(52.0, abs=1.5)


@pytest.mark.parametrize("cut", [400, 500])
def test_edges_of_a_cropped_photo_tell_where_its_camera_looked(cut: int) -> None:
    """Whose principal point is not the middle of what is left."""
    drawn = move_drawn(DrawnCamera(verticals=(vertical(-12.0), vertical(20.0)), levels=HOUSE), -cut, 0.0)
    guess = replace(GUESS, width=1200 - cut, elevation=-9.0, vertical_fov=45.0)
    fitted = fit_camera(guess, drawn, lens_known=False)
    for x, y in ((0.5, 0.5), (0.5, 0.2), (0.8, 0.8)):
        point = x * guess.width, y * guess.height
        elevation, true = (
            math.degrees(math.asin(pixel_ray(camera, (point[0] + left, point[1]))[1]))
            for camera, left in ((fitted, 0), (TRUE, cut))
        )
        assert elevation == pytest.approx(true, abs=1.5)  # 1.8 and 2.5 off without a principal point


def test_level_lines_that_do_not_meet_are_no_parallel_ones() -> None:
    group = LevelLines((HOUSE[0].lines[0], HOUSE[1].lines[1], HOUSE[0].lines[1]))
    with pytest.raises(ParameterError, match="do not meet on the horizon") as caught:
        fit_camera(TRUE, DrawnCamera(levels=(group,)), lens_known=True)
    assert caught.value.field == "verticals"


@pytest.mark.parametrize(("rows", "refused"), [(-600.0, False), (-1500.0, True), (1e9, True)])
def test_a_horizon_far_outside_the_photo_is_refused(rows: float, refused: bool) -> None:
    drawn = DrawnCamera((0.0, rows, 1200.0, rows))
    if not refused:
        assert fit_camera(GUESS, drawn, lens_known=True).elevation < GUESS.elevation - 20
        return
    with pytest.raises(ParameterError, match="far outside the photo") as caught:
        fit_camera(GUESS, drawn, lens_known=True)
    assert caught.value.field == "horizon"


def test_a_short_line_counts_less_than_a_long_one() -> None:
    short = (*pixel(direction(0.0, -1.0)), *pixel(direction(0.0, 0.0)))
    rolls = [fit_camera(GUESS, DrawnCamera(verticals=(ln,)), lens_known=True).roll for ln in (short, vertical(0.0))]
    assert 0.0 < rolls[0] < rolls[1]


def test_a_line_that_lies_flat_is_not_upright() -> None:
    with pytest.raises(ParameterError, match="upright lies flat") as caught:
        fit_camera(GUESS, DrawnCamera(verticals=((100.0, 500.0, 900.0, 505.0),)), lens_known=False)
    assert caught.value.field == "verticals"


@pytest.mark.parametrize(
    "reference",
    [
        Reference(on_ground(5.0, 6.0), on_ground(5.0, 6.0, 1.8), 1.8),
        Reference(on_ground(-15.0, 9.0), on_ground(-15.0, 9.0, 4.0), 4.0),
        Reference(on_ground(0.0, 5.0), on_ground(20.0, 5.0), 2 * 5.0 * math.sin(math.radians(10.0)), lies=True),
    ],
)
def test_a_thing_of_known_size_gives_the_height_of_the_camera(reference: Reference) -> None:
    assert height_by_reference(reference, TRUE) == pytest.approx(1.6, rel=1e-6)
    twice = replace(reference, meters=2 * reference.meters)
    assert height_by_reference(twice, TRUE) == pytest.approx(3.2, rel=1e-6)


@pytest.mark.parametrize(
    ("reference", "sentence"),
    [
        (Reference((600.0, 20.0), (600.0, 5.0), 2.0), "horizon"),
        (Reference(on_ground(0.0, 5.0), on_ground(20.0, 5.0), 2.0), "does not stand upright"),
        (Reference(on_ground(0.0, 5.0), on_ground(0.0, 20.0), 1e-3), "no height"),
    ],
)
def test_a_reference_off_the_ground_is_refused(reference: Reference, sentence: str) -> None:
    with pytest.raises(ParameterError, match=sentence):
        height_by_reference(reference, TRUE)


def test_lines_and_references_are_read() -> None:
    assert read_edge("80,700,95,150") == (80.0, 700.0, 95.0, 150.0)
    assert read_edge("level:0,1,2,3,4,5,6,7") == LevelLines(((0.0, 1.0, 2.0, 3.0), (4.0, 5.0, 6.0, 7.0)))
    for text in ("", "level:0,1,2,3", "level:0,1,2,3,4,5", "flat:0,1,2,3,4,5,6,7"):
        with pytest.raises(ParameterError, match="is no edge"):
            read_edge(text)
    assert read_line("0,410, 1200,395", "horizon") == (0.0, 410.0, 1200.0, 395.0)
    assert read_reference("310,820,305,400,1.8") == Reference((310.0, 820.0), (305.0, 400.0), 1.8)
    assert read_reference("ground:1,2,3,4,5").lies
    for text in ("", "1,2,3", "a,b,c,d", "1,2,3,4,5"):
        with pytest.raises(ParameterError, match="is no line"):
            read_line(text, "horizon")
    for text in ("", "1,2,3,4", "sky:1,2,3,4,5"):
        with pytest.raises(ParameterError, match="is no thing"):
            read_reference(text)


@pytest.mark.parametrize(
    "stated",
    [
        {"horizon": (1.0, 2.0, 3.0)},
        {"horizon": (1.0, 2.0, 3.0, 4.0)},
        {"horizon": (100.0, 100.0, 100.0, 400.0)},
        {"verticals": [(0.0, 0.0, 0.0, math.inf)]},
        {"verticals": [LevelLines(((0.0, 0.0, 200.0, 0.0),))]},
        {"verticals": ["level:0,0,200,0,5,5,6,6"]},
        {"reference": "1,2,300,400,0"},
        {"reference": "1,2,300,400,2", "camera_height": 2.0},
        {"camera": "scene.fspy"},
        {"camera": KnownCamera(0.0, 0.0, 200.0)},
        {"camera": KnownCamera(0.0, 0.0, 50.0), "vertical_fov": 50.0},
        {"camera": KnownCamera(0.0, 0.0, 50.0), "horizon": "0,400,900,400"},
    ],
)
def test_what_says_nothing_or_contradicts_is_refused(stated: dict[str, object]) -> None:
    with pytest.raises(ParameterError):
        UserInput(**stated)  # type: ignore[arg-type]


def test_drawn_lines_move_with_the_border() -> None:
    known = KnownCamera(1.0, 2.0, 50.0)
    drawn = DrawnCamera((1.0, 2.0, 3.0, 4.0), ((5.0, 6.0, 7.0, 8.0),), known=known)
    moved = DrawnCamera((0.0, 12.0, 2.0, 14.0), ((4.0, 16.0, 6.0, 18.0),), known=known)
    assert move_drawn(drawn, -1.0, 10.0) == moved
    assert move_drawn(Reference((1.0, 2.0), (3.0, 4.0), 1.8), -1.0, 10.0) == Reference((0.0, 12.0), (2.0, 14.0), 1.8)
    assert move_drawn(Reference(np.array([1.0, 2.0]), [3, 4], 1.8), -1.0, 10.0).end == (2, 14)  # type: ignore[arg-type]
    assert move_drawn((1, 2), -1.0, 10.0) == (0, 12)
    assert move_drawn(None, -1.0, 10.0) is None


def fspy_json(camera: Pinhole, up: str = "z", principal: tuple[float, float] = (0.0, 0.0)) -> dict[str, object]:
    """What fSpy exports of a camera; its world is turned by 30 deg about the vertical."""
    right, above, forward = replace(camera, azimuth=30.0).axes
    columns = np.stack([right, above, -forward], axis=1)
    if up == "z":
        columns = np.stack([columns[0], -columns[2], columns[1]])
    rows = np.eye(4)
    rows[:3, :3], rows[:3, 3] = columns, (1.0, 2.0, 3.0)
    tangent = math.tan(math.radians(camera.vertical_fov / 2)) * camera.width / camera.height
    return {
        "principalPoint": dict(zip("xy", principal, strict=True)),
        "cameraTransform": {"rows": rows.tolist()},
        "horizontalFieldOfView": 2 * math.atan(tangent),
        "imageWidth": camera.width,
        "imageHeight": camera.height,
    }


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("camera", [TRUE, replace(TRUE, width=900, height=1200, roll=-9.0, elevation=20.0)])
def test_a_camera_of_fspy_is_read(camera: Pinhole, up: str) -> None:
    found = read_fspy(json.dumps(fspy_json(camera, up)).encode())
    assert (found.elevation, found.roll, found.vertical_fov) == pytest.approx(
        (camera.elevation, camera.roll, camera.vertical_fov), abs=1e-6
    )


def test_a_project_of_fspy_is_read() -> None:
    state = json.dumps({"cameraParameters": fspy_json(TRUE), "calibrationSettingsBase": {}}).encode()
    project = struct.pack("<4sIII", b"fspy", 1, len(state), 4) + state + b"JPEG"
    assert read_fspy(project).elevation == pytest.approx(-7.0)


def test_a_cropped_photo_of_fspy_looks_at_its_middle() -> None:
    focal = 1.0 / math.tan(float(fspy_json(TRUE)["horizontalFieldOfView"]) / 2)  # type: ignore[arg-type]
    level = replace(TRUE, elevation=0.0, roll=0.0)
    found = read_fspy(json.dumps(fspy_json(level, principal=(0.0, 0.2))).encode())
    assert found.elevation == pytest.approx(-math.degrees(math.atan(0.2 / focal)))
    assert found.roll == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("data", [b"", b"fspy", b"[]", b"{}", b'{"cameraParameters": null}', b"\xff\xd8photo"])
def test_what_is_no_camera_of_fspy_is_refused(data: bytes) -> None:
    with pytest.raises(ParameterError, match="no project of fSpy"):
        read_fspy(data)
