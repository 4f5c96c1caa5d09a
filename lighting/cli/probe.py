"""The commands about measured skies: probe merge, probe fit."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import lighting.cli.outputs as outputs
from lighting.cli import OLD_OPTIONS, Command, cli
from lighting.cli import options as common
from lighting.cli.console import escape_path, prefix_errors
from lighting.cli.options import FiniteRange, number_option
from lighting.cli.photos import check_coordinates, parse_time_option, parse_utc_offset_option
from lighting.errors import ProbeError
from lighting.files import escape_undecodable
from lighting.map_options import MAX_WHOLE_HEIGHT
from lighting.start import silence_libraries

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from lighting.fields import Json
    from lighting.fusion.user_input import UserInput
    from lighting.probe.bracket import Bracket, BracketFiles
    from lighting.probe.develop import BracketSettings, Moment, Probe
    from lighting.probe.sky_fit import SkyState

PROBE_KINDS = ("equidistant", "equisolid", "ball", "latlong")


class _MergeCommand(Command):
    renamed = {  # noqa: RUF012 - of the class above
        **OLD_OPTIONS,
        "--fov": "--lens-fov",
        "--centre": "--center",
        "--pitch": "--camera-elevation",
    }


@cli.group(
    "probe",
    epilog="""
    lighting probe merge bracket/ --lens equidistant -o sky.exr
    lighting probe merge day/ --series --lens equidistant -o probes/
    lighting probe fit sky.exr
    """,
)
def _probe() -> None:
    """Measure skies: merge bracketed exposures, fit the sky model."""


def _pair(text: str) -> tuple[float, float]:
    """Two numbers with a comma between them; ValueError otherwise."""
    x, y = map(float, text.split(","))
    return x, y


_read_point = common.read_by(_pair, "{text!r} is not two numbers such as 1500,1000.")


@_probe.command(
    "merge",
    cls=_MergeCommand,
    epilog="""
    lighting probe merge *.dng --lens equidistant       # FIRST-probe.exr beside the first
    lighting probe merge ball_*.jpg --lens ball --time 2024-06-01T11:00+02:00 --lat 47 --lon 8
    lighting probe merge day/ --series --lens equidistant --lens-fov 185 -o probes/    # all files of a day
    """,
)
@click.argument("exposures", nargs=-1, required=True, type=click.Path(exists=True, path_type=Path))
@click.option("--lens", "kind", type=click.Choice(PROBE_KINDS), required=True, help="What took the pictures.")
@number_option("180", "DEG", "Across the lens's circle. [180]", "--lens-fov", "fov")
@click.option("--center", metavar="X,Y", callback=_read_point, help="Of the circle or ball, pixels. [the middle]")
@number_option("1400", "PIXELS", "Of the circle or ball. [half the shorter side]", "--radius")
@number_option("90", "DEG", "Where the camera looks: 90 up (fisheyes), 0 level (others).", "--camera-elevation")
@click.option("--mirrored", is_flag=True, help="The pictures are flipped left to right.")
@number_option("10", "STOPS", "Filter before the lens.", "--nd", default=0.0, show_default=True)
@click.option("--curve", type=click.Choice(("linear", "srgb")), help="[16 bits linear, 8 bits srgb]")
@click.option("--time", metavar="TIME", callback=parse_time_option, help="2024-06-01T14:30+02:00. [EXIF]")
@click.option(
    "--utc-offset", metavar="HOURS", callback=parse_utc_offset_option, help="Zone of local times: +02:00 or 2."
)
@click.option("--latitude", "--lat", type=FiniteRange(-90, 90), metavar="DEG", help="Positive north. [EXIF]")
@click.option("--longitude", "--lon", type=FiniteRange(-180, 180), metavar="DEG", help="Positive east. [EXIF]")
@number_option("134", "DEG", "Heading of the camera; a fisheye's lower edge has it. [the sun's]", "--yaw")
@click.option(
    "--series", is_flag=True, help="Many brackets of a camera that did not move: tilt and lens are found too."
)
@click.option("--fill-sun", "fill", is_flag=True, help="A clipped sun gets the model's power.")
@common.map_options("height", max_height=MAX_WHOLE_HEIGHT)
@click.option(
    "-o",
    "--output",
    metavar="PATH",
    help="A file .exr, or a folder to fill.  [default: FIRST-probe.exr, of a series FIRST-probes]",
)
@common.overwrite_option
@common.json_option
@common.quiet_option
def _merge(exposures: tuple[Path, ...], series: bool, output: str | None, quiet: bool, **options: Any) -> None:
    """Merge bracketed EXPOSURES into one sky in the world's axes: center column true north, right half east.

    With --series, EXPOSURES are folders of one bracket each, or all files of a day with times in EXIF. A folder is
    filled in the SkyDB's layout, YYYYMMDD/HHMMSS/envmap.exr by UTC.
    """
    from lighting.fusion.user_input import UserInput
    from lighting.probe.bracket import group_brackets, read_bracket_files
    from lighting.probe.develop import BracketSettings, write_probe

    as_json, overwrite = options.pop("as_json"), options.pop("overwrite")
    options["height"] = options.pop("view").height
    ending = "-probes" if series else "-probe.exr"
    output = outputs.choose_folder(str(exposures[0]), output, ending)
    _check_output(output, series)
    _check_lens(options)
    check_coordinates(options["latitude"], options["longitude"])
    with common.usage_errors():
        stated = UserInput(**{name: options.pop(name) for name in ("time", "utc_offset", "latitude", "longitude")})
    if series and stated.time is not None:
        raise click.UsageError("--time is that of one bracket; a series has times in EXIF or folders' names.")
    with common.usage_errors(ProbeError):  # of numbers that no picture is taken by
        settings = BracketSettings(**options)
    shots = group_brackets(exposures) if series else [read_bracket_files(_files(exposures))]
    moments = _moments(shots, stated)
    _check_targets(shots, moments, output, overwrite)
    written = list[str]()
    for probe in _merged(shots, moments, settings, series, quiet):
        path = write_probe(probe, output)
        _report(probe, path, as_json, quiet)
        written.append(str(path))
    outputs.report_written(written, quiet=quiet or as_json)


def _check_output(output: str, series: bool) -> None:
    path = Path(output)
    if not output:
        raise click.UsageError("The name of the output is empty.")
    if output == "-":
        raise click.UsageError("A probe goes to a file or a folder, not to stdout.")
    if path.is_dir():
        return
    if path.suffix.lower() == ".exr":
        if series:
            raise click.UsageError("A series fills a folder; -o must not end in .exr.")
        if not path.parent.is_dir():
            raise click.UsageError(f"There is no folder {path.parent}.")
    elif path.suffix or path.exists():
        raise click.UsageError(f"{output} must end in .exr or be a folder.")


def _check_lens(options: "Json") -> None:
    """Raise UsageError for an option that the lens does not have."""
    from lighting.fields import option_name
    from lighting.probe.fisheye import UNUSED_LENS_OPTIONS

    kind = options["kind"]
    for name in UNUSED_LENS_OPTIONS.get(kind, ()):
        if options[name] is not None:
            raise click.UsageError(f"{option_name(name)} does not go with --lens {kind}.")


def _check_targets(shots: Sequence["BracketFiles"], moments: Sequence["Moment"], output: str, overwrite: bool) -> None:
    """Raise an error where a probe would replace an exposure, another probe, or unasked a file."""
    from lighting.probe.develop import probe_output_path

    targets = [probe_output_path(output, moment.time).resolve() for moment in moments]
    if not {file.resolve() for shot in shots for file in shot.files}.isdisjoint(targets):
        raise click.UsageError("The input and the outputs must be different files.")
    if len(set(targets)) < len(targets):
        raise click.UsageError("Two brackets are of the same second, so their probes would be one file.")
    outputs.check_absent(list(map(str, targets)), overwrite=overwrite)


def _files(exposures: Sequence[Path]) -> list[Path]:
    from lighting.probe.bracket import list_pictures

    return [file for path in exposures for file in (list_pictures(path) if path.is_dir() else [path])]


def _moments(shots: Sequence["BracketFiles"], stated: "UserInput") -> list["Moment"]:
    """When and where brackets were taken, as the user states, else by EXIF; warnings of their clocks on stderr."""
    from lighting.probe.develop import Moment

    moments, warnings = [], dict[str, None]()
    for shot in shots:
        location = stated if stated.latitude is not None else shot.metadata
        if location.latitude is None or location.longitude is None:
            raise click.UsageError("The place is not in EXIF; tell it with --lat and --lon.")
        found = shot.instants(stated)
        assert found.likeliest is not None
        warnings |= dict.fromkeys((*found.warnings, *found.conflict_warnings(found.likeliest)))
        moments.append(Moment(found.likeliest.utc_time, location.latitude, location.longitude))
    for warning in warnings:
        click.echo(f"Warning: {warning}", err=True)
    return moments


def _merged(
    shots: Sequence["BracketFiles"], moments: Sequence["Moment"], settings: "BracketSettings", series: bool, quiet: bool
) -> Iterable["Probe"]:
    """The probes of a series, behind a progress bar, or that of the only bracket."""
    from functools import partial

    from tqdm import tqdm

    from lighting.probe.develop import make_probe, make_series

    if not series:
        return [make_probe(_bracket(shots[0], settings), moments[0], settings)]
    readers = [partial(_bracket, shot, settings) for shot in shots]
    bar: Iterable[Probe] = tqdm(
        make_series(readers, moments, settings), total=len(shots), unit="probe", disable=quiet or None
    )
    return bar


def _bracket(shot: "BracketFiles", settings: "BracketSettings") -> "Bracket":
    from lighting.probe.bracket import read_bracket

    with silence_libraries():
        return read_bracket(shot.files, settings.curve)


def _report(probe: "Probe", path: Path, as_json: bool, quiet: bool) -> None:
    """Warnings on stderr, and on stdout where the probe is and how it fits the ephemeris."""
    name = escape_path(str(path))
    for warning in probe.warnings:
        click.echo(f"Warning: {name}: {warning}", err=True)
    azimuth, elevation = probe.moment.sun
    if as_json:
        sun = {"azimuth": round(azimuth % 360, 3), "elevation": round(elevation, 3), "error": probe.sun_error}
        record = {"output": escape_undecodable(str(path)), "time": probe.moment.time.isoformat(), "sun": sun}
        click.echo(json.dumps(record | {"warnings": list(probe.warnings)}))
        return
    if quiet:
        return
    click.echo(f"{name}: sun {azimuth % 360:.1f}° from north, {elevation:.1f}° high{_format_alignment(probe)}")


def _format_alignment(probe: "Probe") -> str:
    text = "" if probe.sun_error is None else f"; the map shows it {probe.sun_error:.2f}° away"
    if probe.alignment is not None and len(probe.alignment.used) > 1:
        lens, used = probe.alignment.lens, int(probe.alignment.used.sum())
        text += f"; {used} suns leave {probe.alignment.residual:.2f}°, tilt {probe.alignment.tilt:.1f}°"
        text += f", lens {lens.fov:.1f}°"
        text += ", mirrored" if lens.mirrored else ""
    return text


def _direction(ctx: click.Context, param: click.Parameter, text: str | None) -> tuple[float, float] | None:
    pair = common.read_by(_pair, "{text!r} is not azimuth and elevation such as 120,35.")(ctx, param, text)
    if pair and not (abs(pair[0]) <= 360.0 and 0.0 <= pair[1] <= 90.0):
        raise click.BadParameter(f"{text!r} is no direction: azimuth -360 to 360, elevation 0 to 90.")
    return pair


@_probe.command(
    "fit",
    epilog="""
    lighting probe fit sky.exr
    lighting probe fit sky.exr --sun 120,35             # where the sun is, if it is hidden
    lighting probe fit --json sky.exr
    """,
)
@click.argument("sky", metavar="PROBE", type=click.Path(exists=True, dir_okay=False))
@click.option("--sun", metavar="AZ,EL", callback=_direction, help="Where it is, deg. [found in the map]")
@common.json_option
@common.silent_option
def _fit(sky: str, sun: tuple[float, float] | None, as_json: bool, quiet: bool) -> None:
    """Say the sun, turbidity, exposure and cloud cover of the measured sky PROBE, a lat-long map.

    PROBE is an EXR or HDR file, or a panorama of 8 or 16 bits, which tells them roughly.
    """
    from lighting.formatting import format_side

    state = _state(sky, sun, quiet)
    fit = state.fit
    if as_json:
        click.echo(json.dumps({"file": escape_undecodable(sky), **state.to_dict()}))
        return
    trust = "" if fit.ok else ", not to be trusted"
    click.echo(
        f"{escape_path(sky)}: sun {format_side(state.sun_azimuth, 1)} of the center, "
        f"{state.sun_elevation:.1f}° high ({state.sun_source}); "
        f"turbidity {fit.turbidity:.1f}, exposure {fit.exposure:.4g}, residual {100 * fit.residual:.0f} %"
        f"{trust}; cover {100 * state.cover:.0f} %"
    )


def _state(sky: str, sun: tuple[float, float] | None, quiet: bool) -> "SkyState":
    """What the map in a file says; errors name the file."""
    from lighting.probe.sky_fit import describe_sky

    with silence_libraries():
        image = _read_map(sky, quiet)
    with prefix_errors(sky):
        return describe_sky(image, sun)


def _read_map(sky: str, quiet: bool) -> "NDArray[np.float32]":
    """The map (H, 2H, 3) in a file, of 8 or 16 bits with a warning."""
    from lighting.color import check_envmap
    from lighting.files import read_envmap
    from lighting.files.exr import is_exr

    if sky.lower().endswith((".exr", ".hdr")) or is_exr(Path(sky)):
        return read_envmap(sky)
    from lighting.photo.linear import read_linear

    photo = read_linear(sky)
    with prefix_errors(sky):
        image = check_envmap(photo.pixels)
    if quiet:
        return image
    clipped = 100 * float((image >= photo.white).any(axis=-1).mean())
    curve = "The values count as sRGB, and " if photo.srgb_decoded else "Of the values "
    sentence = f"{curve}{clipped:.1f} % are clipped: turbidity and exposure are rough."
    click.echo(f"Warning: {escape_path(sky)}: {sentence}", err=True)
    return image
