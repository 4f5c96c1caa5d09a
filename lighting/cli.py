"""The command line: parse, call the library, print.

Nothing heavy is imported before a command needs it. Results go to stdout; progress, errors and counts to stderr.
Exit status 0: all went well; 1: something failed, in one sentence; 2: wrong usage.
"""

import errno
import json
import math
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TypeVar

import click

from lighting import __version__
from lighting.errors import LightingError, ParameterError, PhotoError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from lighting.parameters import Lighting, Prediction
    from lighting.photo import Photo
    from lighting.pipeline import Estimator

EXR_MAGIC = b"\x76\x2f\x31\x01"
PREVIEW_MAP_HEIGHT = 512  # pixels of the map that lights the preview, whatever --height says

Command = TypeVar("Command", bound=Callable[..., None])


def main() -> None:
    """Run the command line; what the terminal cannot show is escaped instead of failing."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None and hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    cli(prog_name="lighting")


class _Group(click.Group):
    """Commands whose expected errors end as one sentence and status 1."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except (LightingError, OSError) as error:
            if ctx.params["debug"] or _is_broken_pipe(error):
                raise
            raise click.ClickException(_sentence(error)) from error


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__)
@click.option("--debug", is_flag=True, help="Show the traceback of an error.")
def cli(debug: bool) -> None:
    """Light from one outdoor photo: sun, sky, camera, and an HDR environment map.

    Azimuths are degrees from where the camera points, positive to the right. A file named "-" is stdin or stdout.
    """


def _output(*suffixes: str) -> Callable[[click.Context, click.Parameter, str | None], str | None]:
    """A check that refuses a file, before any work, which its name, its folder or a terminal would refuse later."""

    def check(_ctx: click.Context, _param: click.Parameter, name: str | None) -> str | None:
        if name is not None and (objection := _objection(name, suffixes)):
            raise click.BadParameter(objection)
        return name

    return check


def _objection(name: str, suffixes: Sequence[str]) -> str | None:
    path = Path(name)
    if name == "-":
        shown = sys.stdout is None or sys.stdout.isatty()
        return "Binary data needs a file or a pipe, not a terminal." if shown else None
    if path.is_dir():
        return f"{name} is a folder."
    if path.suffix.lower() not in suffixes:
        return f"{name} must end in {_either(suffixes)}."
    if not path.parent.is_dir():
        return f"There is no folder {path.parent}."
    return None if os.access(path.parent, os.W_OK) else f"The folder {path.parent} cannot be written to."


def _either(words: Sequence[str]) -> str:
    return " or ".join(filter(None, (", ".join(words[:-1]), words[-1])))


def _height(_ctx: click.Context, _param: click.Parameter, value: int) -> int:
    from lighting.envmap import MAX_HEIGHT, MIN_HEIGHT

    if value % 2 or not MIN_HEIGHT <= value <= MAX_HEIGHT:
        raise click.BadParameter(f"{value} is not an even number from {MIN_HEIGHT} to {MAX_HEIGHT}.")
    return value


def _finite(_ctx: click.Context, _param: click.Parameter, value: float) -> float:
    if not math.isfinite(value):
        raise click.BadParameter(f"{value} is not a finite number.")
    return value


def _map_options(command: Command) -> Command:
    """The options that say how a map is rendered; a command receives them together as `view`."""
    options = [
        click.option(
            "--height", default=512, show_default=True, callback=_height, help="Rows; columns are twice that."
        ),
        click.option("--sun/--no-sun", default=None, help="Paint the sun's disc; by default if it likely shines."),
        click.option(
            "--yaw", default=0.0, metavar="DEG", callback=_finite, help="Turn the map to the right, sun and all."
        ),
    ]
    for option in reversed(options):
        command = option(command)
    return command


_map_output = click.option(
    "-o",
    "--output",
    required=True,
    metavar="FILE",
    callback=_output(".exr", ".hdr", ".png"),
    help='.exr, .hdr or .png; "-" is EXR on stdout.',
)
_preview_file = _output(".png")
_model = click.option("--model", metavar="FILE.onnx", help="Another network than the one in this package.")
_quiet = click.option("-q", "--quiet", is_flag=True, help="No progress and no summary.")


@cli.command()
@click.argument("photos", nargs=-1, required=True, metavar="PHOTO...")
@click.option("--json", "as_json", is_flag=True, help="One JSON object a line instead of words.")
@_model
@_quiet
@click.pass_context
def estimate(ctx: click.Context, photos: Sequence[str], as_json: bool, model: str | None, quiet: bool) -> None:
    """Print the light of each PHOTO.

    A photo that cannot be read does not stop the others; the exit status is 1 then.
    """
    estimator = _estimator(model)
    failed = 0
    with _progress(photos, quiet) as progress:
        for name in progress:
            try:
                lighting = estimator(_read_photo(name))
            except (PhotoError, OSError) as error:
                failed += 1
                _report_failure(name, error, as_json, progress)
            else:
                click.echo(_json_line(name, lighting=lighting.to_dict()) if as_json else _words(name, lighting))
    if failed and len(photos) > 1:
        click.echo(f"{failed} of {len(photos)} photos could not be read.", err=True)
    ctx.exit(1 if failed else 0)


@cli.command()
@click.argument("photo")
@_map_output
@_map_options
@click.option("--preview", metavar="FILE.png", callback=_preview_file, help="Also draw what `lighting preview` draws.")
@_model
@_quiet
def envmap(photo: str, output: str, preview: str | None, model: str | None, quiet: bool, **view: Any) -> None:
    """Estimate the light of PHOTO and render its environment map."""
    _refuse_collisions(photo, output, preview)
    estimator = _estimator(model)
    picture = _read_photo(photo)
    prediction, lighting = _estimated(estimator, picture)
    _write_map(output, lighting, **view)
    if preview:
        _write_preview(preview, picture, prediction, lighting)
    if not quiet and "-" not in (output, preview):
        click.echo(_words(photo, lighting))


@cli.command()
@click.argument("record", metavar="LIGHTING.json")
@_map_output
@_map_options
def render(record: str, output: str, **view: Any) -> None:
    """Render a lighting record as an environment map.

    LIGHTING.json holds one record, or one line that "estimate --json" printed.
    """
    _refuse_collisions(record, output)
    _write_map(output, _read_lighting(record), **view)


@cli.command()
@click.argument("photo")
@click.option("-o", "--output", required=True, metavar="FILE.png", callback=_preview_file, help='"-" is stdout.')
@_model
def preview(photo: str, output: str, model: str | None) -> None:
    """Draw PHOTO, its light and three spheres lit by it."""
    _refuse_collisions(photo, output)
    estimator = _estimator(model)
    picture = _read_photo(photo)
    _write_preview(output, picture, *_estimated(estimator, picture))


@cli.command()
@click.argument("file")
def info(file: str) -> None:
    """Describe an EXR, a network (.onnx) or a photo as JSON."""
    described = _describe_network(file) if Path(file).suffix.lower() == ".onnx" else _describe_picture(file)
    click.echo(json.dumps({"file": file, **described}, indent=2))


# Input


def _read_bytes(name: str) -> bytes:
    return _stdin().read() if name == "-" else Path(name).read_bytes()


def _read_photo(name: str) -> "Photo":
    from lighting.photo import read_photo

    return read_photo(_stdin() if name == "-" else name)


def _stdin() -> BinaryIO:
    if sys.stdin is None:
        raise PhotoError("There is no stdin to read.")
    return sys.stdin.buffer


def _read_lighting(name: str) -> "Lighting":
    """The record in a JSON file, bare or in the line that `estimate --json` printed."""
    from lighting.parameters import Lighting

    try:
        record = json.loads(_read_bytes(name).decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise ParameterError(f"{_shown(name)} does not hold one JSON record: {error}.") from error
    if isinstance(record, dict) and "error" in record:
        raise ParameterError(f"{_shown(name)} holds an error in place of a lighting record.")
    return Lighting.from_dict(record["lighting"] if isinstance(record, dict) and "lighting" in record else record)


def _estimator(model: str | None) -> "Estimator":
    from lighting.model import Model
    from lighting.pipeline import Estimator

    return Estimator(Model.load(model))


def _estimated(estimator: "Estimator", picture: "Photo") -> "tuple[Prediction, Lighting]":
    from lighting.parameters import lighting_from

    prediction = estimator.predict(picture)
    return prediction, lighting_from(prediction)


def _describe_network(file: str) -> dict[str, Any]:
    from lighting.model import Model

    return {"kind": "network", **json.loads(Model.load(file).spec.to_json())}


def _describe_picture(file: str) -> dict[str, Any]:
    from lighting.photo import read_photo

    data = _read_bytes(file)
    if data.startswith(EXR_MAGIC):
        return _describe_map(data)
    photo = read_photo(data)
    return {"kind": "photo", "format": photo.format, "width": photo.width, "height": photo.height}


def _describe_map(data: bytes) -> dict[str, Any]:
    from lighting.exr import read_exr

    image, lighting = read_exr(BytesIO(data))
    record = None if lighting is None else lighting.to_dict()
    return {"kind": "environment map", "width": image.shape[1], "height": image.shape[0], "lighting": record}


# Output


def _refuse_collisions(source: str, *outputs: str | None) -> None:
    """Raise UsageError where an output would replace the input or the other output."""
    files = [os.path.realpath(name) for name in (source, *outputs) if name is not None and name != "-"]
    if len(set(files)) < len(files) or outputs.count("-") > 1:
        raise click.UsageError("The input and the outputs must be different files.")


def _write_map(output: str, lighting: "Lighting", height: int, sun: bool | None, yaw: float) -> None:
    """Render and write; with a yaw, the record in the file is turned with the map."""
    from lighting.envmap import render, rotate
    from lighting.formats import encode_envmap, write_envmap
    from lighting.geometry import wrap_azimuth

    image = render(lighting, height, sun=sun)
    if yaw:
        image = rotate(image, yaw)
        lighting = replace(lighting, sun_azimuth=float(wrap_azimuth(lighting.sun_azimuth + yaw)))
    if output == "-":
        _write_stdout(encode_envmap(image, lighting, "exr"))
    else:
        write_envmap(output, image, lighting)


def _write_preview(output: str, picture: "Photo", prediction: "Prediction", lighting: "Lighting") -> None:
    from lighting.envmap import render
    from lighting.preview import draw_preview

    light = render(lighting, PREVIEW_MAP_HEIGHT)
    drawing = draw_preview(picture.pixels, lighting, prediction.sun_probability, prediction.spec.sun_grid, light)
    _write_png(output, drawing)


def _write_png(output: str, pixels: "NDArray[np.uint8]") -> None:
    from PIL import Image

    from lighting.atomic import replacing

    stream = BytesIO()
    Image.fromarray(pixels).save(stream, "PNG")
    if output == "-":
        _write_stdout(stream.getvalue())
    else:
        with replacing(output) as path:
            path.write_bytes(stream.getvalue())


def _write_stdout(data: bytes) -> None:
    sys.stdout.buffer.write(data)
    sys.stdout.buffer.flush()


def _progress(items: Sequence[str], quiet: bool) -> Any:
    """The items behind a progress bar, which shows where nothing else would: results do not go to the terminal."""
    from tqdm import tqdm

    hidden = quiet or len(items) < 2 or not sys.stderr.isatty() or sys.stdout.isatty()
    return tqdm(items, unit="photo", disable=hidden)


def _report_failure(name: str, error: Exception, as_json: bool, progress: Any) -> None:
    if as_json:
        click.echo(_json_line(name, error=_reason(error)))
    with progress.external_write_mode(file=sys.stderr):
        click.echo(f"Error: {_shown(name)}: {_reason(error)}", err=True)


def _json_line(name: str, **content: Any) -> str:
    return json.dumps({"file": name, **content}, allow_nan=False)


def _words(name: str, lighting: "Lighting") -> str:
    """One line for people."""
    tilt = "up" if lighting.camera_elevation >= 0 else "down"
    return (
        f"{_shown(name)}: sun {_side(lighting.sun_azimuth)}, {lighting.sun_elevation:.1f}° high "
        f"(50 % within {lighting.radius_50:.1f}°, 90 % within {lighting.radius_90:.1f}°), "
        f"direct sunlight {100 * lighting.sun_visibility:.0f} %, turbidity {lighting.turbidity:.1f}; "
        f"camera looks {abs(lighting.camera_elevation):.1f}° {tilt}, roll {lighting.camera_roll:.1f}°, "
        f"vertical field of view {lighting.vertical_fov:.1f}°"
    )


def _shown(name: str) -> str:
    return "stdin" if name == "-" else click.format_filename(name)


def _side(azimuth: float) -> str:
    if abs(azimuth) < 0.05:
        return "straight ahead"
    behind = " (behind)" if abs(azimuth) > 90 else ""
    return f"{abs(azimuth):.1f}° {'right' if azimuth > 0 else 'left'}{behind}"


# Errors


def _sentence(error: Exception) -> str:
    file = getattr(error, "filename", None)
    return f"{click.format_filename(file)}: {_reason(error)}" if file else _reason(error)


def _reason(error: Exception) -> str:
    return f"{error.strerror or error}." if isinstance(error, OSError) else str(error)


def _is_broken_pipe(error: Exception) -> bool:
    return isinstance(error, OSError) and error.errno == errno.EPIPE
