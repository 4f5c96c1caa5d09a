"""Skies measured: bracketed exposures to a map of radiance in the world's axes, and what a map says of its sky."""
