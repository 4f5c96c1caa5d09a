"""What commands about photos share: their options, one photo after the other, and the exit status."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import wraps
from typing import TYPE_CHECKING, Any

import click

import lighting.cli.console as console
from lighting.cli import options as common
from lighting.cli.console import path_of
from lighting.errors import LightingError
from lighting.start import exit_on_interrupt

if TYPE_CHECKING:
    from concurrent.futures import Future

    from lighting.envmap.relighting import Adjustments
    from lighting.estimator import Estimator
    from lighting.fusion.user_input import UserInput
    from lighting.model import Model
    from lighting.photo.reader import Photo
    from lighting.photo_estimate import Estimate
    from lighting.records import Lighting, Prediction
    from lighting.segmentation import Segments

UNSUITABLE_STATUS = 3  # of --strict, where a photo is probably none of outdoors by daylight

EstimatePhoto = Callable[[str, bytes], "tuple[Photo, Estimate]"]  # by name and bytes


@dataclass(frozen=True)
class PhotoOptions:
    """The options of a command that makes something of each photo."""

    photos: Sequence[str]
    """Names of files; "-" is stdin."""
    output: str | None
    """Name of a file or folder. None: beside each photo."""
    overwrite: bool
    """Whether a file may be replaced."""
    surroundings: bool | None
    """Whether maps show the place. None: where the network predicts it."""
    detail: bool
    """Whether they then have detail all around the photo."""
    sun: bool | None
    """Whether it is in maps and scenes."""
    adjustments: "Adjustments | None"
    """What the user changes of the light. None: nothing."""
    user_input: "UserInput"
    """What the user states of the photos."""
    model: str | None
    """A network's file. None: the one in this package."""
    strict: bool
    """Whether an unsuitable photo gives another exit status."""
    as_json: bool
    """Whether lines are JSON."""
    quiet: bool
    """Whether there are no progress, summaries and warnings."""

    def adjust(self, lighting: "Lighting") -> "Lighting":
        """Return a light as the user adjusts it.

        Args:
            lighting: before.
        """
        if self.adjustments is None:
            return lighting
        from lighting.envmap.relighting import adjust_lighting

        return adjust_lighting(lighting, self.adjustments)

    def print_estimate(
        self, photo: str, answer: "Estimate", lighting: "Lighting", warnings: Sequence[str], files: dict[str, str]
    ) -> None:
        """Print the line of a photo, and its warnings.

        Args:
            photo: name of the file.
            answer: about the photo.
            lighting: as the user adjusted it.
            warnings: of the answer and of what was made of it.
            files: that were written, by what they are.
        """
        probe = None
        if self.as_json:
            sun = choose_sun(self.sun, self.adjustments)
            probe = answer.replace(lighting=lighting).light_probe(sun=sun, surroundings=self.surroundings)
        crop, as_json, quiet = answer.photo.crop, self.as_json, self.quiet
        console.print_estimate(photo, lighting, warnings, files, probe=probe, crop=crop, as_json=as_json, quiet=quiet)


def choose_sun(sun: bool | None, adjustments: "Adjustments | None") -> bool | None:
    """Return whether the sun is painted; one that the user moved is. UsageError where it is also to be left out.

    Args:
        sun: False where it is left out; None without a word.
        adjustments: may move it; None: nothing.
    """
    if adjustments is None or adjustments.sun is None:
        return sun
    if sun is False:
        raise click.UsageError("--sun moves the sun, and --no-sun leaves it out: choose one.")
    return True


def photo_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options that PhotoOptions holds, apart from -o; the command receives it as `chosen`.

    Args:
        command: that receives them.
    """

    @wraps(command)
    def with_chosen(*args: Any, **options: Any) -> None:
        chosen = PhotoOptions(**{field.name: options.pop(field.name) for field in fields(PhotoOptions)})
        command(*args, chosen=chosen, **options)

    added = (
        common.adjustment_options,
        common.no_sun_option,
        common.surroundings_option,
        common.detail_option,
        common.user_input_options,
        common.model_option,
        common.strict_option,
        common.json_option,
        common.silent_option,
    )
    decorated: Callable[..., None] = with_chosen
    for add in reversed(added):
        decorated = add(decorated)
    return click.argument("photos", nargs=-1, required=True, metavar="PHOTO...", type=common.FileName())(decorated)


def check_stdin(photos: Sequence[str]) -> None:
    """Raise UsageError where stdin is read twice.

    Args:
        photos: names of files; "-" is stdin.
    """
    if photos.count("-") > 1:
        raise click.UsageError("Only one of the photos can be stdin.")


def check_json(as_json: bool, names: Sequence[str | None]) -> None:
    """Raise UsageError where JSON and a file both go to stdout.

    Args:
        as_json: whether JSON is wanted.
        names: of the files; "-" is stdout.
    """
    if as_json and "-" in names:
        raise click.UsageError("--json and the file would both go to stdout.")


def photo_estimator(
    photos: Sequence[str], user_input: "UserInput", model: str | None, meanwhile: Callable[[], object] = lambda: None
) -> EstimatePhoto:
    """Return a function that reads a photo and estimates its light.

    The network is loaded now for several photos, and beside the decoding of one alone. Raises ModelError.

    Args:
        photos: names of all photos.
        user_input: what the user states of them.
        model: a network's file; None is the one in this package.
        meanwhile: what to do while the network runs on the one photo.
    """
    if len(photos) == 1:
        return lambda name, data: estimate_photo(name, data, user_input, model, meanwhile)
    estimator = load_estimator(model)

    def estimate(name: str, data: bytes) -> "tuple[Photo, Estimate]":
        from lighting.photo.reader import read_photo

        photo = read_photo(data, path=console.path_of(name))
        return photo, estimator(photo, user_input)

    return estimate


def estimate_file(estimate: EstimatePhoto, name: str) -> "tuple[bytes, Photo, Estimate]":
    """Return the bytes of a photo, its pixels and its light; errors name the file.

    Args:
        estimate: of `photo_estimator`.
        name: of the photo's file; "-" is stdin.
    """
    with console.prefix_errors(name):
        data = console.read_photo_bytes(name)
        return data, *estimate(name, data)


def process_photos(
    ctx: click.Context,
    chosen: PhotoOptions,
    work: "Callable[[int, str], tuple[Lighting, list[str]]]",
    how_to_open: Callable[[str], str] = console.open_command,
) -> None:
    """Work on each photo, say what was written, and end the command with its status.

    That is 1 where a photo failed, and 3 where --strict finds one unfit. An error of the only photo ends the command;
    of several, the others go on.

    Args:
        ctx: of click.
        chosen: the command's options.
        work: takes number and name, writes what the command writes, and returns the photo's light and the files.
        how_to_open: of the first file.
    """
    failed, lights, written = 0, list["Lighting"](), list[str]()
    with console.photo_progress(chosen.photos, chosen.quiet) as progress:
        for number, name in enumerate(progress):
            try:
                light, files = work(number, name)
            except (LightingError, OSError) as error:
                if console.is_broken_pipe(error):
                    raise
                if chosen.as_json:
                    console.print_json_error(name, error)
                if len(chosen.photos) == 1 or ctx.find_root().params["debug"]:
                    raise
                failed += 1
                console.report_failure(name, error, progress)
                continue
            lights.append(light)
            written += files
    if failed:
        click.echo(f"{failed} of {len(chosen.photos)} photos failed.", err=True)
    console.report_written(written, how_to_open, quiet=chosen.quiet or chosen.as_json)
    ctx.exit(1 if failed else strict_status(lights, chosen.strict))


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

    The network is loaded in a thread while the photo is decoded. While it answers, what comes after it is imported, and
    `meanwhile` is called. While the prediction is refined, the other network says what the photo shows. One network at
    a time is in memory: the second is loaded after the first is gone. Ctrl-C ends the process at once, for nothing is
    written yet.

    Args:
        name: of the photo's file, beside which sidecars may lie; "-" is stdin.
        data: the photo's bytes.
        user_input: what the user states of it.
        model: a network's file; None is the one in this package.
        meanwhile: what to do while the networks run.
    """
    from concurrent.futures import ThreadPoolExecutor

    from lighting.photo.reader import read_photo

    with exit_on_interrupt(), ThreadPoolExecutor(1) as decoder, ThreadPoolExecutor(1) as networks:
        decoded = decoder.submit(read_photo, data, path=path_of(name))
        prediction = networks.submit(_predict, model, decoded)
        segments = networks.submit(_segment, decoded)
        from lighting.estimator import estimate_from_prediction
        from lighting.fusion.estimate import refine_prediction

        meanwhile()
        picture = decoded.result()
        predicted = refine_prediction(prediction.result(), picture, user_input)
        return picture, estimate_from_prediction(picture, predicted, segments.result(), user_input)


def _predict(model: str | None, decoded: "Future[Photo]") -> "Prediction":
    """What the network that estimates the light says; on return it is gone, and its memory is the next one's."""
    return _load_for_one_photo(model).predict_one(decoded.result())


def _load_for_one_photo(model: str | None) -> "Model":
    from lighting.model import Model, packaged_model
    from lighting.start import started_session

    started = started_session() if model is None else None
    if started is None:
        return Model.load(model, for_one_photo=True)
    return Model.from_session(started, packaged_model())


def _segment(decoded: "Future[Photo]") -> "Segments":
    from lighting.segmentation import packaged_segmenter

    return packaged_segmenter()(decoded.result().pixels)
