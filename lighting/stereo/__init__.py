"""Photometric stereo outdoors: mean light vectors, what noise does to normals, when to photograph, normals."""

from typing import TYPE_CHECKING

from lighting.lazy import from_homes

if TYPE_CHECKING:
    from lighting.stereo.mean_light import Skies, illumination, mean_light
    from lighting.stereo.normals.files import check_folder
    from lighting.stereo.normals.job import Solved, Told, Watch, solve_day, write_solved
    from lighting.stereo.normals.network import Network
    from lighting.stereo.picture import HOPELESS, draw_plan, shown_error
    from lighting.stereo.plan import Plan, Question, Window, clock
    from lighting.stereo.planning import Progress
    from lighting.stereo.request import (
        AskedSkies,
        MeasuredSkies,
        ModelledSkies,
        conditions,
        plan_photos,
        plan_record,
        title,
    )

__all__ = [
    "HOPELESS",
    "AskedSkies",
    "MeasuredSkies",
    "ModelledSkies",
    "Network",
    "Plan",
    "Progress",
    "Question",
    "Skies",
    "Solved",
    "Told",
    "Watch",
    "Window",
    "check_folder",
    "clock",
    "conditions",
    "draw_plan",
    "illumination",
    "mean_light",
    "plan_photos",
    "plan_record",
    "shown_error",
    "solve_day",
    "title",
    "write_solved",
]

__getattr__ = from_homes(
    __name__,
    {
        "HOPELESS": "picture",
        "AskedSkies": "request",
        "Told": "normals.job",
        "MeasuredSkies": "request",
        "ModelledSkies": "request",
        "Network": "normals.network",
        "Plan": "plan",
        "Progress": "planning",
        "Question": "plan",
        "Skies": "mean_light",
        "Solved": "normals.job",
        "Watch": "normals.job",
        "Window": "plan",
        "check_folder": "normals.files",
        "clock": "plan",
        "conditions": "request",
        "draw_plan": "picture",
        "illumination": "mean_light",
        "mean_light": "mean_light",
        "plan_photos": "request",
        "plan_record": "request",
        "shown_error": "picture",
        "solve_day": "normals.job",
        "title": "request",
        "write_solved": "normals.job",
    },
)
