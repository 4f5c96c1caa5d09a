"""Environment maps of a light: sky, ground, sun, and the surroundings of its photo."""
