"""What commands about photos share: an estimate of one photo after the other, and the exit status."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING

import click

import lighting.cli.console as console
import lighting.cli.outputs as outputs
from lighting.cli.inputs import PhotoOptions
from lighting.errors import LightingError
from lighting.start import StartedNetwork, exit_on_interrupt

if TYPE_CHECKING:
    from lighting.estimator import Estimator
    from lighting.fusion.user_input import UserInput
    from lighting.model import Model
    from lighting.photo_estimate import Estimate
    from lighting.records import Lighting

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
    failed, lights, written = 0, list["Lighting"](), list[str]()
    estimate = _photo_estimator(chosen, meanwhile)
    with console.photo_progress(chosen.photos, chosen.quiet) as progress:
        for number, name in enumerate(progress):
            try:
                answer = estimate(name)
                written += work(number, name, answer)
            except (LightingError, OSError) as error:
                if console.is_broken_pipe(error):
                    raise
                if chosen.as_json:
                    click.echo(console.format_json_error(name, error))
                if len(chosen.photos) == 1 or ctx.find_root().params["debug"]:
                    raise
                failed += 1
                console.report_failure(name, error, progress)
                continue
            lights.append(answer.lighting)
    if failed:
        click.echo(f"{failed} of {len(chosen.photos)} photos failed.", err=True)
    outputs.report_written(written, how_to_open, quiet=chosen.quiet or chosen.as_json)
    ctx.exit(1 if failed else lights_status(lights, chosen.strict, chosen.require))


def _photo_estimator(chosen: PhotoOptions, meanwhile: Callable[[], object]) -> "Callable[[str], Estimate]":
    """A function that reads a photo and estimates its light; raises ModelError.

    The network is loaded now for several photos, and beside the decoding of one alone.
    """
    if len(chosen.photos) == 1:
        return lambda name: estimate_file(name, chosen.user_input, chosen.model, meanwhile)
    estimator = load_estimator(chosen.model)

    def estimate(name: str) -> "Estimate":
        with console.prefix_errors(name):
            return estimator(console.read_photo_file(name), chosen.user_input)

    return estimate


def estimate_file(
    name: str, user_input: "UserInput", model: str | None, meanwhile: Callable[[], object] = lambda: None
) -> "Estimate":
    """Do what `estimate_alone` does; errors name the file.

    Args:
        name: of the photo's file; "-" is stdin.
        user_input: what the user states of it.
        model: a network's file; None is the one in this package.
        meanwhile: what to do while the network runs.
    """
    with console.prefix_errors(name):
        return estimate_alone(name, user_input, model, meanwhile)


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


def lights_status(lights: Sequence["Lighting"], strict: bool, require: str | None) -> int:
    """Return the exit status for lights that could be estimated.

    Args:
        lights: of photos.
        strict: whether one of a photo that is probably not of outdoors by daylight counts.
        require: the trust that each must have; None: any.
    """
    from lighting.records import MIN_SUITABLE

    unfit = strict and any(light.suitable is not None and light.suitable < MIN_SUITABLE for light in lights)
    if unfit:
        return UNSUITABLE_STATUS
    return DOUBTED_STATUS if require is not None and any(light.trust != require for light in lights) else 0


def load_estimator(model: str | None) -> "Estimator":
    """Load an estimator for many photos.

    Args:
        model: a network's file; None is the one in this package.
    """
    from lighting.estimator import Estimator
    from lighting.model import Model

    return Estimator(Model.load(model))
