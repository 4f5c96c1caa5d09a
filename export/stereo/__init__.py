"""Outdoor photometric stereo: what noise does to it, days to train on, its network and its accuracy."""
