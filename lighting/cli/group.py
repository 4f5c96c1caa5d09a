"""The group that every command joins, and how errors end."""

from importlib import import_module
from typing import Any

import click

from lighting import __version__
from lighting.cli.words import is_broken_pipe, printable, sentence
from lighting.errors import LightingError

_HOME = {  # the module of each command; a call imports no other
    "batch": "batch",
    "envmap": "commands",
    "estimate": "commands",
    "info": "info",
    "preview": "commands",
    "probe": "probe_fit",
    "render": "commands",
    "scene": "scene",
    "stereo": "stereo_normals",
    "video": "video",
}


class Group(click.Group):
    """Commands whose expected errors end as one sentence and status 1."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        return list(_HOME)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name in _HOME:
            import_module(f"lighting.cli.{_HOME[cmd_name]}")
        return super().get_command(ctx, cmd_name)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        try:
            return super().parse_args(ctx, args)  # which prints --help and --version
        except OSError as error:
            if is_broken_pipe(error):
                raise
            raise click.ClickException(sentence(error)) from error

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except click.UsageError as error:
            error.message = printable(error.message)  # type: ignore[misc]  # declared final, for users of click
            raise
        except (LightingError, OSError) as error:
            if ctx.params["debug"] or is_broken_pipe(error):
                raise
            raise click.ClickException(sentence(error)) from error


@click.group(cls=Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__)
@click.option("--debug", is_flag=True, help="Show the traceback of an error.")
def cli(debug: bool) -> None:
    """Light from one outdoor photo: sun, sky, camera, and an HDR environment map.

    Azimuths are degrees from where the camera points, positive to the right. A file named "-" is stdin or stdout.
    """
