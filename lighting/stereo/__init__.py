"""Photometric stereo outdoors: mean light vectors, what noise does to normals, when to photograph, normals."""

from lighting.stereo.mean_light import Skies, illumination, mean_light
from lighting.stereo.normals.files import check_folder
from lighting.stereo.normals.job import Known, Solved, solve_day, write_solved
from lighting.stereo.plan import FEWEST_SHOTS, MOST_SHOTS, NOISES, Plan, Question
from lighting.stereo.request import MeasuredSkies, ModelledSkies, plan_photos, plan_record

__all__ = [
    "FEWEST_SHOTS",
    "MOST_SHOTS",
    "NOISES",
    "Known",
    "MeasuredSkies",
    "ModelledSkies",
    "Plan",
    "Question",
    "Skies",
    "Solved",
    "check_folder",
    "illumination",
    "mean_light",
    "plan_photos",
    "plan_record",
    "solve_day",
    "write_solved",
]
