"""Evidence about the sun: a photo's pixels, metadata, user, ephemeris and other photos; and its fusion."""
