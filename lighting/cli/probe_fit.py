"""The command that says what a measured sky holds."""

import json
from typing import TYPE_CHECKING

import click

from lighting.cli.files import naming
from lighting.cli.probe import pair, probe
from lighting.cli.silence import silence
from lighting.cli.words import shown
from lighting.words import aside

if TYPE_CHECKING:
    from lighting.probe import SkyState


def _direction(_ctx: click.Context, _param: click.Parameter, text: str | None) -> tuple[float, float] | None:
    found = None if text is None else pair(text, "azimuth and elevation such as 120,35")
    if found is not None and not (abs(found[0]) <= 360.0 and 0.0 <= found[1] <= 90.0):
        raise click.BadParameter(f"{text!r} is no direction: azimuth -360 to 360, elevation 0 to 90.")
    return found


@probe.command()
@click.argument("sky", metavar="PROBE.exr", type=click.Path(exists=True, dir_okay=False))
@click.option("--sun", metavar="AZIMUTH,ELEVATION", callback=_direction, help="Where it is, deg. [found in the map]")
@click.option("--json", "as_json", is_flag=True, help="One JSON record.")
def fit(sky: str, sun: tuple[float, float] | None, as_json: bool) -> None:
    """Say the sun, turbidity, exposure and cloud cover of the measured sky PROBE.exr, a lat-long map."""
    state = _state(sky, sun)
    if as_json:
        click.echo(json.dumps({"file": sky, **state.to_dict()}))
        return
    trust = "" if state.trusted else ", not to be trusted"
    click.echo(
        f"{shown(sky)}: sun {aside(state.sun_azimuth, 1)} of the centre, "
        f"{state.sun_elevation:.1f}° high ({state.sun_source}); "
        f"turbidity {state.turbidity:.1f}, exposure {state.exposure:.4g}, residual {100 * state.residual:.0f} %"
        f"{trust}; cover {100 * state.cover:.0f} %"
    )


def _state(sky: str, sun: tuple[float, float] | None) -> "SkyState":
    """What the map in a file says; errors name the file."""
    from lighting.files import read_map
    from lighting.probe import describe

    with silence():
        image = read_map(sky)
    with naming(sky):
        return describe(image, sun)
