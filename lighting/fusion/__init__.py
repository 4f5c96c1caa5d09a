"""Evidence about the sun, and its fusion: pixels, metadata, user, ephemeris, other photos."""
