"""The command that writes light probes for engines and phones."""

from typing import TYPE_CHECKING

import click

from lighting.cli import cli, console
from lighting.cli import options as common

if TYPE_CHECKING:
    from lighting.fusion.user_input import UserInput
    from lighting.light_probe import LightProbe


def _formats() -> list[str]:
    from lighting.light_probe import LIGHT_PROBE_FORMATS

    return list(LIGHT_PROBE_FORMATS)


@cli.command(
    "light-probe",
    examples=(
        "lighting light-probe photo.jpg > probe.json",
        "lighting light-probe photo.jpg --for unity > probe.json",
        "lighting light-probe light.json --for threejs",
    ),
)
@click.argument("source", metavar="PHOTO|LIGHTING.json", type=common.FileName())
@click.option(
    "--for",
    "format",
    default="record",
    show_default=True,
    type=common.RegistryChoice(_formats),
    help="The engine that takes it.",
)
@common.no_sun_option
@common.surroundings_option
@common.user_input_options
@common.model_option
@click.option("--json", is_flag=True, expose_value=False, help="JSON, which is all that it prints.")
@common.silent_option
def _light_probe(
    source: str,
    format: str,
    sun: bool | None,
    surroundings: bool | None,
    user_input: "UserInput",
    model: str | None,
    quiet: bool,
) -> None:
    """Print the light of PHOTO for an engine or a phone, as JSON.

    It holds nine spherical-harmonics coefficients of all light but the sun's, and the sun as the main light. Of a
    record it is the sky's alone.
    """
    from lighting.light_probe import encode_light_probe

    if source.lower().endswith((".json", ".jsonl")):
        probe = _probe_of_record(source, sun, surroundings, user_input, model)
    else:
        with console.prefix_errors(source):
            data = console.read_photo_bytes(source)
            _, estimate = console.estimate_photo(source, data, user_input, model)
        probe = estimate.light_probe(sun=sun, surroundings=surroundings)
        console.report_warnings(source, estimate.warnings, quiet)
    click.echo(encode_light_probe(probe, format))


def _probe_of_record(
    source: str, sun: bool | None, surroundings: bool | None, user_input: "UserInput", model: str | None
) -> "LightProbe":
    from lighting.fusion.user_input import NO_USER_INPUT
    from lighting.light_probe import compute_light_probe

    if model is not None or surroundings is not None or user_input != NO_USER_INPUT:
        raise click.UsageError("A record holds the light already; leave out the options about a photo.")
    return compute_light_probe(console.read_lighting(source), sun=sun)
