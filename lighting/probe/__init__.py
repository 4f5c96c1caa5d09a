"""Measured skies: bracketed exposures become a map of radiance in the world's axes, and a map tells its sky."""

from lighting.probe.brackets import Shot, pictures_in, shot_of, shots_of
from lighting.probe.describe import SkyState, describe
from lighting.probe.develop import Probe, make_probe, make_series
from lighting.probe.exposures import Bracket, bracket_of, read_bracket
from lighting.probe.folders import ProbeFile, probe_path, probes_in
from lighting.probe.lens import ABSENT
from lighting.probe.orientation import Orientation, Scan, orient
from lighting.probe.settings import Moment, Settings
from lighting.probe.sky_fit import SkyFit, fit_sky
from lighting.probe.sun_finder import FoundSun, find_sun
from lighting.probe.write import target_of, write_probe

__all__ = [
    "ABSENT",
    "Bracket",
    "FoundSun",
    "Moment",
    "Orientation",
    "Probe",
    "ProbeFile",
    "Scan",
    "Settings",
    "Shot",
    "SkyFit",
    "SkyState",
    "bracket_of",
    "describe",
    "find_sun",
    "fit_sky",
    "make_probe",
    "make_series",
    "orient",
    "pictures_in",
    "probe_path",
    "probes_in",
    "read_bracket",
    "shot_of",
    "shots_of",
    "target_of",
    "write_probe",
]
