"""Randomness that does not change when panoramas are added or left out."""

import hashlib

import numpy as np


def generator(name: str, index: int, purpose: str) -> np.random.Generator:
    """A generator whose seed is made of a panorama's name, a crop's index and a purpose, and of nothing else."""
    digest = hashlib.sha256(f"{purpose}/{name}/{index}".encode()).digest()
    return np.random.default_rng(int.from_bytes(digest[:8], "little"))
