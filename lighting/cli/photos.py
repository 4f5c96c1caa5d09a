"""Commands about photos: what a user states of one, an estimate of one after the other, and the exit status."""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields
from functools import partial
from typing import TYPE_CHECKING, Any

import click

import lighting.cli.console as console
import lighting.cli.outputs as outputs
from lighting.cli.options import (
    Decorator,
    FileName,
    json_option,
    map_options,
    model_option,
    number_option,
    read_by,
    record_options,
    require_option,
    silent_option,
    strict_option,
    with_option_name,
)
from lighting.errors import LightingError, ParameterError
from lighting.fields import option_name
from lighting.map_options import MAX_HEIGHT, MapOptions
from lighting.photo.timestamps import parse_time, parse_utc_offset
from lighting.start import StartedNetwork, exit_on_interrupt

if TYPE_CHECKING:
    from lighting.estimator import Estimator
    from lighting.fusion.marks import KnownCamera
    from lighting.fusion.user_input import UserInput
    from lighting.model import Model
    from lighting.photo_estimate import Estimate


def _read_headings(text: str) -> list[float]:
    from lighting.fusion.user_input import read_headings

    return read_headings(text)


parse_time_option, parse_utc_offset_option = read_by(parse_time), read_by(parse_utc_offset)


def _fspy_camera(_ctx: click.Context, _param: click.Parameter, name: str | None) -> "KnownCamera | None":
    if name is None:
        return None
    from lighting.cli.console import read_small_file
    from lighting.fusion.fspy import MAX_FSPY_BYTES, read_fspy

    data = read_small_file(name, MAX_FSPY_BYTES)
    try:
        return read_fspy(data)
    except ParameterError as error:
        raise click.BadParameter(f"{name}: {error}") from error


_OPTIONS: dict[str, Decorator] = {  # by the fields of UserInput that they fill
    "metadata": click.option(
        "--no-metadata",
        "metadata",
        flag_value=False,
        default=True,
        help="Ignore EXIF and the like; use only the pixels.",
    ),
    "time": click.option(
        "--time",
        metavar="TIME",
        callback=parse_time_option,
        help="When: 2024-06-01T14:30, or with its offset, 2024-06-01T14:30+02:00.",
    ),
    "utc_offset": click.option(
        "--utc-offset",
        metavar="HOURS",
        callback=parse_utc_offset_option,
        help="Offset of local time from UTC: +02:00 or 2.",
    ),
    "latitude": number_option("48.14", "DEG", "Where: positive north.", "--latitude", "--lat"),
    "longitude": number_option("11.58", "DEG", "Where: positive east.", "--longitude", "--lon"),
    "heading": number_option("134.2", "DEG", "Where the camera points, clockwise from true north.", "--heading"),
    "vertical_fov": number_option(
        "48.7", "DEG", "Vertical field of view of the upright photo.", "--vertical-fov", "--fov"
    ),
    "camera_height": number_option(
        "1.6", "METERS", "How high the camera is above the ground.  [default: 1.6]", "--camera-height"
    ),
    "shadows": click.option(
        "--shadow",
        "shadows",
        metavar="X,Y,X,Y[,X,Y]",
        multiple=True,
        help="A shadow, in pixels: from the foot of what casts it to its tip, then the thing's top. Repeatable. "
        "Also doubt: before them, own:X,Y, head:X,Y, line:X,Y,X,Y and lit:X,Y,X,Y[,X,Y].",
    ),
    "horizon": click.option(
        "--horizon", metavar="X,Y,X,Y", help="Two points of the horizon, in pixels: the camera's tilt."
    ),
    "verticals": click.option(
        "--vertical",
        "verticals",
        metavar="X,Y,X,Y",
        multiple=True,
        help="A line along an edge that stands upright: tilt and, of two or more, the lens. Repeatable. "
        "Also level:X,Y,X,Y,X,Y,X,Y of level edges that are parallel.",
    ),
    "reference": click.option(
        "--reference",
        metavar="X,Y,X,Y,METERS",
        help="A thing of known size, from its foot to its top: the camera's height. ground:... of one that lies.",
    ),
    "camera": click.option(
        "--camera",
        metavar="FILE",
        type=FileName(),
        callback=_fspy_camera,
        help="The camera by fSpy: its project (.fspy), or its JSON.",
    ),
    "spot": click.option("--spot", metavar="X,Y", help="Where an object stands on the ground, in pixels."),
    "keep_location": click.option("--keep-location", is_flag=True, help="Put latitude and longitude into the output."),
}
together_option = click.option("--together", is_flag=True, help="Combine photos of one place, taken in the same light.")
headings_option = click.option(
    "--headings",
    metavar="DEG,DEG,...",
    callback=read_by(_read_headings),
    help="Where each camera points, clockwise from any common direction.",
)


def input_options_but(*left_out: str) -> Decorator:
    """Add the options that fill fields of UserInput; a command receives it as `user_input`.

    Args:
        left_out: fields that it lacks.
    """
    names = [name for name in _OPTIONS if name not in left_out]
    return record_options("user_input", partial(_make_user_input, names), *map(_OPTIONS.__getitem__, names))


def _make_user_input(names: Sequence[str], values: dict[str, Any]) -> "UserInput":
    """The UserInput of a command's values, which are removed."""
    from lighting.fusion.user_input import UserInput

    stated = {name: values.pop(name) for name in names}
    check_coordinates(stated["latitude"], stated["longitude"])
    user_input = UserInput(**stated)
    if user_input.drawn_fields and len(values.get("photos", ())) > 1:
        raise click.UsageError(f"{option_name(user_input.drawn_fields[0])} is of one photo; give that photo alone.")
    return user_input


user_input_options = input_options_but()  # contradictions among them are wrong usage
DRAWN = ("shadows", "horizon", "verticals", "reference", "camera", "spot")  # fields of what is drawn in one photo


@dataclass(frozen=True, eq=False, repr=False)
class PhotoOptions:
    """The options of a command that makes something of each photo."""

    photos: Sequence[str]
    """Names of files; "-" is stdin."""
    output: str | None
    """Name of a file or folder. None: beside each photo."""
    overwrite: bool
    """Whether a file may be replaced."""
    view: MapOptions
    """Of the map, the preview or the scene."""
    user_input: "UserInput"
    """What the user states of the photos."""
    model: str | None
    """A network's file. None: the one in this package."""
    strict: bool
    """Whether an unsuitable photo gives another exit status."""
    require: str | None
    """The trust that each answer must have, or the exit status is another. None: any."""
    as_json: bool
    """Whether lines are JSON."""
    quiet: bool
    """Whether there are no progress, summaries and warnings."""

    def print_estimate(self, photo: str, answer: "Estimate", warnings: Sequence[str], files: dict[str, str]) -> None:
        """Print the line of a photo, whose light is adjusted first, and its warnings.

        Args:
            photo: name of the file.
            answer: about the photo.
            warnings: of the answer and of what was made of it.
            files: that were written, by what they are.
        """
        from lighting.envmap.relighting import adjust_lighting

        light = adjust_lighting(answer.lighting, self.view.adjustments)
        probe = answer.probe(self.view.of_record()) if self.as_json else None
        crop, as_json, quiet = answer.photo.crop, self.as_json, self.quiet
        console.print_estimate(photo, light, warnings, files, probe=probe, crop=crop, as_json=as_json, quiet=quiet)


def photo_options(*names: str, max_height: int = MAX_HEIGHT) -> Decorator:
    """Add the options that PhotoOptions holds, apart from -o; the command receives it as `chosen`.

    Args:
        names: the fields of MapOptions that count; none is all.
        max_height: as in `map_options`.
    """

    return record_options(
        "chosen",
        lambda values: PhotoOptions(**{field.name: values.pop(field.name) for field in fields(PhotoOptions)}),
        click.argument("photos", nargs=-1, required=True, metavar="PHOTO...", type=FileName()),
        map_options(*names, max_height=max_height),
        user_input_options,
        model_option,
        strict_option,
        require_option,
        json_option,
        silent_option,
    )


def check_coordinates(latitude: float | None, longitude: float | None) -> None:
    """Raise UsageError where one of the two is missing.

    Args:
        latitude: deg; None where not stated.
        longitude: deg; None where not stated.
    """
    if (latitude is None) != (longitude is None):
        stated, missing = ("--lat", "--lon") if longitude is None else ("--lon", "--lat")
        raise click.UsageError(f"{stated} needs {missing} too, such as --lat 48.14 --lon 11.58.")


UNSUITABLE_STATUS = 3  # of --strict, where a photo is probably none of outdoors by daylight
DOUBTED_STATUS = 4  # of --require, where an answer is less sure


def process_photos(
    ctx: click.Context,
    chosen: PhotoOptions,
    work: Callable[[int, str, "Estimate"], list[str]],
    how_to_open: Callable[[str], str | None] = outputs.open_command,
    meanwhile: Callable[[], object] = lambda: None,
) -> None:
    """Estimate the light of each photo, work on it, say what was written, and end the command with its status.

    That is 1 where a photo failed, 3 where --strict finds one unfit, 4 where --require finds one less sure. An error
    of the only photo ends the command; of several, the others go on.

    Args:
        ctx: of click.
        chosen: the command's options.
        work: takes a photo's number, name and answer, writes what the command writes, and returns the files.
        how_to_open: of the first file.
        meanwhile: what to do while the network runs on the only photo.
    """
    failed, answers, written = 0, list[tuple[float | None, str | None]](), list[str]()
    estimate = photo_estimator(chosen.photos, chosen.user_input, chosen.model, meanwhile)
    with console.photo_progress(chosen.photos, chosen.quiet) as progress:
        for number, name in enumerate(progress):
            try:
                with console.prefix_errors(name):
                    answer = estimate(name)
                written += work(number, name, answer)
            except (LightingError, OSError) as error:
                if console.is_broken_pipe(error):
                    raise
                if chosen.as_json:
                    click.echo(console.format_record(name, error))
                if len(chosen.photos) == 1 or ctx.find_root().params["debug"]:
                    raise
                failed += 1
                console.report_failure(name, with_option_name(ctx, error), progress)
                continue
            answers.append((answer.lighting.suitable, answer.lighting.trust))
    if failed:
        click.echo(f"{failed} of {len(chosen.photos)} photos failed.", err=True)
    outputs.report_written(written, how_to_open, quiet=chosen.quiet or chosen.as_json)
    ctx.exit(1 if failed else exit_status(answers, chosen.strict, chosen.require))


def photo_estimator(
    photos: Sequence[str], user_input: "UserInput", model: str | None, meanwhile: Callable[[], object] = lambda: None
) -> "Callable[[str], Estimate]":
    """Return a function that reads one of the photos and estimates its light; raises ModelError.

    The network is loaded now for several photos, and beside the decoding of one alone.

    Args:
        photos: names of files.
        user_input: what the user states of them.
        model: a network's file; None is the one in this package.
        meanwhile: what to do while the network runs on the only photo.
    """
    if len(photos) == 1:
        return lambda name: estimate_alone(name, user_input, model, meanwhile)
    estimator = load_estimator(model)
    return lambda name: estimator(console.read_photo_file(name), user_input)


def estimate_file(name: str, user_input: "UserInput", model: str | None) -> "Estimate":
    """Do what `estimate_alone` does; errors name the file.

    Args:
        name: of the photo's file; "-" is stdin.
        user_input: what the user states of it.
        model: a network's file; None is the one in this package.
    """
    with console.prefix_errors(name):
        return estimate_alone(name, user_input, model)


def estimate_alone(
    name: str, user_input: "UserInput", model: str | None, meanwhile: Callable[[], object] = lambda: None
) -> "Estimate":
    """Read a photo and estimate its light by a network of its own.

    It is the network that began to load with the process, where there is one. Ctrl-C ends the process at once, for
    nothing is written yet.

    Args:
        name: of the photo's file; "-" is stdin.
        user_input: what the user states of it.
        model: a network's file; None is the one in this package.
        meanwhile: what to do while the network runs.
    """
    context = click.get_current_context(silent=True)
    started: StartedNetwork | None = context.find_root().obj if context else None

    def load() -> "Model":
        from lighting.model import Model, packaged_model

        session = started.take() if started and model is None else None
        return Model.from_session(session, packaged_model()) if session else Model.load(model, for_one_photo=True)

    from lighting.estimator import estimate_once

    with exit_on_interrupt(), started.thread if started else ThreadPoolExecutor(1) as thread:
        read = partial(console.read_photo_file, name)
        return estimate_once(read, load, user_input, thread=thread, meanwhile=meanwhile)


def exit_status(answers: "Iterable[tuple[float | None, str | None]]", strict: bool, require: str | None) -> int:
    """Return the exit status for photos that all have an answer.

    Args:
        answers: `suitable` and `trust` of each.
        strict: whether one that is probably not of outdoors by daylight counts.
        require: the trust that each must have; None: any.
    """
    from lighting.records import MIN_SUITABLE

    status = 0
    for suitable, trust in answers if strict or require else ():
        if strict and suitable is not None and suitable < MIN_SUITABLE:
            return UNSUITABLE_STATUS
        if require is not None and trust != require:
            status = DOUBTED_STATUS
    return status


def load_estimator(model: str | None) -> "Estimator":
    """Load an estimator for many photos.

    Args:
        model: a network's file; None is the one in this package.
    """
    from lighting.estimator import Estimator
    from lighting.model import Model

    return Estimator(Model.load(model))
