"""Outdoor photometric stereo: mean light vectors, the gain of noise, when to shoot, normals."""
