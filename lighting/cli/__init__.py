"""The command line: parse, call the library, print.

A command's module is imported when it is called, and nothing heavy before it is needed. Results go to stdout; progress,
errors and counts to stderr. Exit status 0: all went well; 1: something failed, in one sentence; 2: wrong usage;
3: with --strict, a photo is probably not of outdoors by daylight.
"""

from importlib import import_module
from typing import Any

import click

from lighting.cli.commands import Group
from lighting.cli.console import escape_control_chars, format_error, is_broken_pipe
from lighting.errors import LightingError
from lighting.version import __version__

_HOME = {  # the module of each command, in the order of use; a call imports no other
    "open": "serve",
    "envmap": "envmap",
    "preview": "envmap",
    "scene": "scene",
    "estimate": "estimate",
    "render": "envmap",
    "light-probe": "envmap",
    "info": "info",
    "batch": "batch",
    "video": "video",
    "probe": "probe",
    "stereo": "stereo",
    "serve": "serve",
    "doctor": "info",
}


_NO_ARGUMENTS: Any = getattr(click.exceptions, "NoArgsIsHelpError", ())  # from click 8.2 on


class _Program(Group):
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


@click.group(
    cls=_Program,
    context_settings={"help_option_names": ["-h", "--help"]},
    examples=(
        "lighting envmap photo.jpg                      # photo.exr, a map that lights like the photo",
        "lighting scene photo.jpg --for blender         # a folder that Blender opens",
        "lighting envmap photo.jpg --sun 40,25 -o b.exr # the same with another sun",
    ),
)
@click.version_option(__version__)
@click.option("--debug", is_flag=True, help="Show the traceback of an error.")
def cli(debug: bool) -> None:
    """Light from one outdoor photo: sun, sky, camera, and an HDR environment map.

    Begin with `lighting envmap photo.jpg`, or with `lighting open`, which shows a page. The book is at
    /book/ of `lighting serve`.

    Azimuths are degrees from where the camera points, positive to the right. "-" is stdin or stdout.

    Results go beside the input, or where -o says. No file is replaced without --overwrite.

    Exit status: 0 all went well, 1 something failed, 2 wrong usage, 3 probably no outdoor daylight photo (--strict).

    \b
    Completion, once for each shell:
      bash  eval "$(_LIGHTING_COMPLETE=bash_source lighting)"     in ~/.bashrc
      zsh   eval "$(_LIGHTING_COMPLETE=zsh_source lighting)"      in ~/.zshrc, after compinit
      fish  _LIGHTING_COMPLETE=fish_source lighting | source      in ~/.config/fish/config.fish
    """


@cli.command("help", hidden=True)
@click.argument("names", nargs=-1, metavar="[COMMAND]...")
@click.pass_context
def _help(ctx: click.Context, names: tuple[str, ...]) -> None:
    """Show the help of a command."""
    parent = ctx.find_root()
    for name in names:
        if not isinstance(parent.command, click.Group):
            raise click.UsageError(f"`{parent.command_path}` has no commands.")
        _, command, _ = parent.command.resolve_command(parent, [name])
        assert command is not None
        parent = click.Context(command, info_name=name, parent=parent)
    click.echo(parent.get_help())
