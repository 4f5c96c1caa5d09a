"""Normals, albedo, uncertainty and a mesh from photos of one day; `job` does the whole, the other modules its steps."""
