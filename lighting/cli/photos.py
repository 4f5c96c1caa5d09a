"""What commands about photos share: an estimate of one photo after the other, and the exit status."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

import lighting.cli.console as console
from lighting.cli.console import path_of
from lighting.cli.options import PhotoOptions
from lighting.errors import LightingError
from lighting.start import exit_on_interrupt, network_thread

if TYPE_CHECKING:
    from lighting.estimator import Estimator
    from lighting.fusion.user_input import UserInput
    from lighting.model import Model
    from lighting.photo.reader import Photo
    from lighting.photo_estimate import Estimate
    from lighting.records import Lighting

UNSUITABLE_STATUS = 3  # of --strict, where a photo is probably none of outdoors by daylight


@dataclass(frozen=True, eq=False, repr=False)
class EstimatedPhoto:
    """A photo that a command read, and the estimate of its light."""

    name: str
    """Of the file; "-" is stdin."""
    data: bytes
    """What the file holds."""
    picture: "Photo"
    """The photo decoded."""
    estimate: "Estimate"
    """Of its light."""


def process_photos(
    ctx: click.Context,
    chosen: PhotoOptions,
    work: Callable[[int, EstimatedPhoto], list[str]],
    how_to_open: Callable[[str], str | None] = console.open_command,
    meanwhile: Callable[[], object] = lambda: None,
) -> None:
    """Estimate the light of each photo, work on it, say what was written, and end the command with its status.

    That is 1 where a photo failed, and 3 where --strict finds one unfit. An error of the only photo ends the command;
    of several, the others go on.

    Args:
        ctx: of click.
        chosen: the command's options.
        work: takes a photo's number and answer, writes what the command writes, and returns the files.
        how_to_open: of the first file.
        meanwhile: what to do while the network runs on the only photo.
    """
    failed, lights, written = 0, list["Lighting"](), list[str]()
    estimate = _photo_estimator(chosen, meanwhile)
    with console.photo_progress(chosen.photos, chosen.quiet) as progress:
        for number, name in enumerate(progress):
            try:
                answer = estimate(name)
                written += work(number, answer)
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
            lights.append(answer.estimate.lighting)
    if failed:
        click.echo(f"{failed} of {len(chosen.photos)} photos failed.", err=True)
    console.report_written(written, how_to_open, quiet=chosen.quiet or chosen.as_json)
    ctx.exit(1 if failed else strict_status(lights, chosen.strict))


def _photo_estimator(chosen: PhotoOptions, meanwhile: Callable[[], object]) -> Callable[[str], EstimatedPhoto]:
    """A function that reads a photo and estimates its light; raises ModelError.

    The network is loaded now for several photos, and beside the decoding of one alone.
    """
    if len(chosen.photos) == 1:
        return lambda name: estimate_file(name, chosen.user_input, chosen.model, meanwhile)
    estimator = load_estimator(chosen.model)

    def estimate(name: str) -> EstimatedPhoto:
        from lighting.photo.reader import read_photo

        with console.prefix_errors(name):
            data = console.read_photo_bytes(name)
            photo = read_photo(data, path=path_of(name))
            return EstimatedPhoto(name, data, photo, estimator(photo, chosen.user_input))

    return estimate


def estimate_file(
    name: str, user_input: "UserInput", model: str | None, meanwhile: Callable[[], object] = lambda: None
) -> EstimatedPhoto:
    """Read a photo and estimate its light as `estimate_photo` does; errors name the file.

    Args:
        name: of the photo's file; "-" is stdin.
        user_input: what the user states of it.
        model: a network's file; None is the one in this package.
        meanwhile: what to do while the network runs.
    """
    with console.prefix_errors(name):
        data = console.read_photo_bytes(name)
        return EstimatedPhoto(name, data, *estimate_photo(name, data, user_input, model, meanwhile))


def strict_status(lights: Sequence["Lighting"], strict: bool) -> int:
    """Return the exit status for lights that could be estimated.

    Args:
        lights: of photos.
        strict: whether one of a photo that is probably not of outdoors by daylight counts.
    """
    from lighting.records import MIN_SUITABLE

    unfit = strict and any(light.suitable is not None and light.suitable < MIN_SUITABLE for light in lights)
    return UNSUITABLE_STATUS if unfit else 0


def load_estimator(model: str | None) -> "Estimator":
    """Load an estimator for many photos.

    Args:
        model: a network's file; None is the one in this package.
    """
    from lighting.estimator import Estimator
    from lighting.model import Model

    return Estimator(Model.load(model))


def estimate_photo(
    name: str, data: bytes, user_input: "UserInput", model: str | None, meanwhile: Callable[[], object] = lambda: None
) -> "tuple[Photo, Estimate]":
    """Decode a photo and estimate its light.

    A thread loads the network meanwhile, and runs it while this one imports what comes after and calls `meanwhile`.
    Ctrl-C ends the process at once, for nothing is written yet.

    Args:
        name: of the photo's file, beside which sidecars may lie; "-" is stdin.
        data: the photo's bytes.
        user_input: what the user states of it.
        model: a network's file; None is the one in this package.
        meanwhile: what to do while the network runs.
    """
    from lighting.model import preprocess
    from lighting.photo.reader import read_photo

    with exit_on_interrupt(), network_thread() as thread:
        loading = thread.submit(_load_for_one_photo, model)
        picture = read_photo(data, path=path_of(name))
        network = loading.result()
        predictions = thread.submit(network.predict, preprocess(picture, network.spec))
        del loading, network  # so that the network is gone with its answer
        from lighting.estimator import estimate_from_prediction
        from lighting.fusion.estimate import refine_prediction

        meanwhile()
        (prediction,) = predictions.result()
        predicted = refine_prediction(prediction, picture, user_input)
        return picture, estimate_from_prediction(picture, predicted, user_input)


def _load_for_one_photo(model: str | None) -> "Model":
    from lighting.model import Model, packaged_model
    from lighting.start import started_session

    started = started_session() if model is None else None
    if started is None:
        return Model.load(model, for_one_photo=True)
    return Model.from_session(started, packaged_model())
