"""Outdoor photometric stereo: what it promises, its network, its errors."""
