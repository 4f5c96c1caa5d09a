"""Where the parts of the preview lie, in pixels."""

from dataclasses import dataclass

WIDTH = 1600  # of the whole picture
MARGIN = 40  # around all
GAP = 24  # between panels
HEADER = 78  # height of the headline above the panels
WARNING = 26  # height of a line of warnings, which stand below the headline
CAPTION = 32  # height of the line above each panel
LETTERS = 18  # size of a caption's letters
CELL = 76  # height of one number with its name
UPRIGHT_HEIGHT = 680  # of the upper row when the photo is upright
UPRIGHT_MAP_HEIGHT = 440  # of the map below it


@dataclass(frozen=True)
class Box:
    """A rectangle by its upper left corner and its size."""

    x: int
    y: int
    width: int
    height: int


@dataclass(frozen=True)
class Layout:
    """Where everything goes."""

    height: int  # of the whole picture
    photo: Box
    compass: Box
    envmap: Box
    spheres: Box
    cells: list[tuple[int, int]]  # upper left corners of the numbers


def lay_out(aspect: float, count: int, warnings: int = 0) -> Layout:
    """The layout for a photo's width / height, `count` numbers and so many lines of warnings.

    Photo and compass above, map and spheres below; the numbers beside an upright photo, else at the foot.
    """
    inner, top = WIDTH - 2 * MARGIN, MARGIN + HEADER + warnings * WARNING + CAPTION
    aspect = min(max(aspect, 0.5), 2.0)
    upright = aspect < 0.9
    upper = UPRIGHT_HEIGHT if upright else int((inner - GAP) / (1 + aspect))
    photo = Box(MARGIN, top, round(upper * aspect), upper)
    compass = Box(MARGIN + photo.width + GAP if upright else WIDTH - MARGIN - upper, top, upper, upper)
    below = top + upper + GAP + CAPTION
    lower = UPRIGHT_MAP_HEIGHT if upright else photo.width // 2
    envmap = Box(MARGIN, below, 2 * lower, lower)
    left = MARGIN + envmap.width + GAP if upright else compass.x
    spheres = Box(left, below, WIDTH - MARGIN - left, lower)
    foot = below + lower + GAP
    if upright:
        column = compass.x + compass.width + GAP + 8
        return Layout(
            foot - GAP + MARGIN, photo, compass, envmap, spheres, [(column, top + CELL * i) for i in range(count)]
        )
    cells = [(MARGIN + i * inner // count, foot) for i in range(count)]
    return Layout(foot + CELL - 10 + MARGIN // 2, photo, compass, envmap, spheres, cells)
