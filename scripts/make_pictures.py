"""Make the pictures of README and docs/: `python -m scripts.make_pictures [NAME ...]`.

They go to docs/images/. `page` and `scenes` need node, Chromium, and `npm ci` in `server/web` and `tests/node`.
`blender`, `monkey` and a part of `scenes` need a Python with the module bpy, which BLENDER_PYTHON names. The command
names what this machine lacks, and leaves it out. `reliability.png` needs the training data: `python -m export evaluate
--card` draws it.
"""

import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from urllib.error import URLError
from urllib.request import urlopen

import click
from PIL import Image

from lighting import estimate
from lighting.files import atomic_write
from scripts.book import read_code_blocks
from scripts.figures import draw_axes, draw_stereo_normals, draw_stereo_plan
from scripts.gallery import EXAMPLES, GALLERY, ROOT, draw_gallery_row, draw_moving_picture

IMAGES = ROOT / "docs" / "images"
_QUALITY = 80  # of WebP
_MOVING_QUALITY = 68  # the same of what moves
_FRAME_MILLISECONDS = 90
_LARGEST = 1200  # pixels, a picture's width
_START_SECONDS = 30

Pictures = Image.Image | list[Image.Image]  # one, or the frames of one that moves


class MissingToolError(Exception):
    """A program that draws a picture is not on this machine."""


def draw_preview() -> Image.Image:
    """Return the preview of an example."""
    return estimate(EXAMPLES / "wide_street.jpg").preview()


def draw_page() -> Image.Image:
    """Return the page with an example in it, as Chromium shows it."""
    with tempfile.TemporaryDirectory() as folder, _service() as url:
        out = Path(folder) / "page.png"
        _run(_program("node"), ROOT / "scripts" / "page_picture.mjs", url, _program("chromium", "google-chrome"), out)
        return _load(out)


def draw_blender() -> Image.Image:
    """Return Blender's monkey in two lights."""
    python = _blender_python()
    with tempfile.TemporaryDirectory() as folder:
        package, out = Path(folder) / "light_from_photo.zip", Path(folder) / "blender.png"
        _run(sys.executable, "-m", "scripts.blender_extension", "-o", package)
        os.environ["BLENDER_USER_RESOURCES"] = folder
        command = Path(sys.executable).with_name("lighting")
        _run(python, ROOT / "scripts" / "blender_picture.py", package, command, EXAMPLES / "garden_windows.jpg", out)
        return _load(out)


def draw_monkey() -> Image.Image:
    """Return what the tutorial for Blender renders."""
    python = _blender_python()
    page = (ROOT / "docs" / "learn" / "blender.md").read_text(encoding="utf-8")
    (script,) = (block.text for block in read_code_blocks(page) if block.language == "python")
    with tempfile.TemporaryDirectory() as folder:
        estimate(EXAMPLES / "wide_street.jpg").scene("blender", folder)
        _run(python, Path(folder) / "scene.py", "--save")
        script = script.replace("resolution_percentage = 50", "resolution_percentage = 100")  # of a small photo
        opened = f"import bpy; bpy.ops.wm.open_mainfile(filepath={str(Path(folder) / 'scene.blend')!r})\n"
        _run(python, "-c", opened + script)
        return _load(Path(folder) / "monkey.png")


def draw_scenes() -> Image.Image:
    """Return one scene as each tool renders it."""
    blender = ["--blender", _blender_python()] if "BLENDER_PYTHON" in os.environ else []
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "scenes.png"
        _run(sys.executable, "-m", "benchmarks.scenes", "--samples", "32", "--picture", out, *blender)
        return _load(out)


PICTURES: dict[str, Callable[[], Pictures]] = {
    "moving": draw_moving_picture,
    **{f"gallery/{Path(name).name}": partial(draw_gallery_row, name) for name in GALLERY},
    "preview": draw_preview,
    "page": draw_page,
    "blender": draw_blender,
    "monkey": draw_monkey,
    "scenes": draw_scenes,
    "axes": draw_axes,
    "stereo-plan": draw_stereo_plan,
    "stereo-normals": draw_stereo_normals,
}


def _program(*names: str) -> str:
    for name in names:
        if found := shutil.which(name):
            return found
    raise MissingToolError(names[0])


def _blender_python() -> str:
    if "BLENDER_PYTHON" not in os.environ:
        raise MissingToolError("BLENDER_PYTHON")
    return os.environ["BLENDER_PYTHON"]


def _run(*command: str | Path) -> None:
    subprocess.run(list(map(str, command)), cwd=ROOT, check=True)


def _load(file: Path) -> Image.Image:
    with Image.open(file) as picture:
        return picture.convert("RGB")


@contextmanager
def _service() -> Iterator[str]:
    """The address of a service that runs meanwhile."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    url = f"http://127.0.0.1:{port}/"
    command = [sys.executable, "-m", "lighting", "serve", "--port", str(port)]
    with subprocess.Popen(command, cwd=ROOT, stderr=subprocess.DEVNULL) as process:
        try:
            _wait_until_ready(f"{url}readyz")
            yield url
        finally:
            process.terminate()


def _wait_until_ready(url: str) -> None:
    deadline = time.monotonic() + _START_SECONDS
    while True:
        try:
            with urlopen(url):
                return
        except URLError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.1)


def write_picture(drawn: Pictures, file: Path) -> None:
    """Write a picture as WebP.

    Args:
        drawn: the picture, or frames that are shown again and again.
        file: is replaced.
    """
    first, *others = [_shrink(frame) for frame in (drawn if isinstance(drawn, list) else [drawn])]
    frames = {"save_all": True, "append_images": others, "duration": _FRAME_MILLISECONDS, "loop": 0} if others else {}
    file.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(file) as path:
        first.save(path, "WEBP", quality=_MOVING_QUALITY if others else _QUALITY, method=6, **frames)


def _shrink(picture: Image.Image) -> Image.Image:
    height = round(picture.height * _LARGEST / picture.width)
    small = picture.convert("RGB")
    return small if picture.width <= _LARGEST else small.resize((_LARGEST, height), Image.Resampling.LANCZOS)


@click.command()
@click.argument("names", nargs=-1, type=click.Choice(sorted(PICTURES)))
def main(names: tuple[str, ...]) -> None:
    """Make the pictures of README and docs/, or those of NAMES."""
    failed = [name for name in names or PICTURES if not _make_picture(name)]
    if failed:
        raise click.ClickException(f"Not made: {', '.join(failed)}.")


def _make_picture(name: str) -> bool:
    """Whether a picture is made, or known to be out of this machine's reach."""
    try:
        drawn = PICTURES[name]()
    except MissingToolError as missing:
        click.echo(f"{name} is left out: this machine lacks {missing}.")
        return True
    except subprocess.CalledProcessError as error:
        click.echo(f"{name}: {error}", err=True)
        return False
    file = IMAGES / f"{name}.webp"
    write_picture(drawn, file)
    click.echo(f"{file.relative_to(ROOT)}: {file.stat().st_size / 1000:.0f} kB")
    return True


if __name__ == "__main__":
    main()
