"""The command line: parse, call the library, print.

A command's module is imported when it is called, and nothing heavy before it is needed. Results go to stdout; progress,
errors and counts to stderr. Exit status 0: all went well; 1: something failed, in one sentence; 2: wrong usage.
"""

from importlib import import_module
from typing import Any

import click

from lighting.cli.console import escape_control_chars, format_error, is_broken_pipe
from lighting.errors import LightingError
from lighting.version import __version__

_HOME = {  # the module of each command; a call imports no other
    "batch": "batch",
    "envmap": "estimate",
    "estimate": "estimate",
    "info": "info",
    "light-probe": "light_probe",
    "open": "serve",
    "preview": "estimate",
    "probe": "probe",
    "render": "estimate",
    "scene": "scene",
    "serve": "serve",
    "stereo": "stereo",
    "video": "video",
}


_NO_ARGUMENTS: Any = getattr(click.exceptions, "NoArgsIsHelpError", ())  # from click 8.2 on


class _Group(click.Group):
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
            raise click.ClickException(format_error(error)) from error

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except _NO_ARGUMENTS:  # a group's name alone, whose message is the group's help
            raise
        except click.UsageError as error:
            error.message = escape_control_chars(error.message)  # type: ignore[misc]  # declared final, for users of click
            raise
        except (LightingError, OSError) as error:
            if ctx.params["debug"] or is_broken_pipe(error):
                raise
            raise click.ClickException(format_error(error)) from error


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__)
@click.option("--debug", is_flag=True, help="Show the traceback of an error.")
def cli(debug: bool) -> None:
    """Light from one outdoor photo: sun, sky, camera, and an HDR environment map.

    Azimuths are degrees from where the camera points, positive to the right. A file named "-" is stdin or stdout.
    """
