"""Photometric stereo outdoors: mean light vectors, what noise does to normals, when to photograph, normals."""
