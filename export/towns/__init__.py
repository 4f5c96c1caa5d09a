"""Rendered places with exact truth: procedural towns and countryside, path traced under known skies."""

from export.towns.dataset import LABELS, synthesize
from export.towns.llvm import find_llvm

__all__ = ["LABELS", "find_llvm", "synthesize"]
