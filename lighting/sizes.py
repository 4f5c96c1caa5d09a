"""Sizes of pictures that are made smaller or larger: width and height in whole pixels, at least 1 x 1."""


def scaled(width: int, height: int, scale: float) -> tuple[int, int]:
    """Width and height of a picture that is made `scale` times as large."""
    return max(1, round(width * scale)), max(1, round(height * scale))


def fitting(width: int, height: int, most_width: int, most_height: int) -> tuple[int, int]:
    """The largest width and height of the picture's aspect ratio in a box."""
    return scaled(width, height, min(most_width / width, most_height / height))


def shrunk(width: int, height: int, side: int) -> tuple[int, int]:
    """Width and height of a picture whose longer side is made `side` pixels long, if it is longer."""
    return (width, height) if max(width, height) <= side else fitting(width, height, side, side)
