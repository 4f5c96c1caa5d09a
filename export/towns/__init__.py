"""Rendered places with exact truth: procedural towns and countryside, path traced under known skies."""

from export.towns.dataset import LABELS, synthesize
from export.towns.llvm import find_llvm
from export.towns.path_trace import Photographed, RenderedPlace
from export.towns.place import place as random_place
from export.towns.sky import Sky, random_sky

__all__ = ["LABELS", "Photographed", "RenderedPlace", "Sky", "find_llvm", "random_place", "random_sky", "synthesize"]
