"""The command line: parse, call the library, print.

A command's module is imported when it is called, and nothing heavy before it is needed. Results go to stdout; progress,
errors and counts to stderr. Exit status 0: all went well; 1: something failed, in one sentence; 2: wrong usage.
3: with --strict, a photo is probably not of outdoors by daylight; 4: with --require sure, an answer is not sure.

Commands and groups show examples in their help, know old names of options, and suggest what was probably meant.
"""

from collections.abc import Mapping, Sequence
from importlib import import_module
from inspect import cleandoc
from typing import Any, ClassVar

import click

from lighting.cli.console import escape_control_chars, format_error, is_broken_pipe
from lighting.errors import OLD_NAMES, LightingError
from lighting.version import __version__

_HOME = {  # the module of each command, in the order of use; a call imports no other
    "open": "serve",
    "envmap": "envmap",
    "preview": "envmap",
    "scene": "scene",
    "estimate": "estimate",
    "render": "envmap",
    "day": "day",
    "light-probe": "envmap",
    "info": "info",
    "batch": "batch",
    "video": "video",
    "probe": "probe",
    "stereo": "stereo",
    "serve": "serve",
    "mcp": "serve",
    "doctor": "info",
}

OLD_OPTIONS = {f"--{no}{old}": f"--{no}{new}" for old, new in OLD_NAMES.items() for no in ("", "no-")}
_SECTIONS = {  # of a long help, in this order, as are the options in each; others come first, as "Options"
    "Output": (
        "-o",
        "--preview",
        "--candidates",
        "--height",
        "--overwrite",
        "--json",
        "-q",
        "--strict",
        "--require",
        "-h",
    ),
    "Light": ("--sun", "--exposure", "--haze", "--overcast", "--no-sun", "--pick"),
    "Place": ("--time", "--utc-offset", "--latitude", "--longitude", "--heading", "--keep-location"),
    "Photo": (
        *("--shadow", "--horizon", "--vertical", "--camera", "--vertical-fov"),
        *("--reference", "--spot", "--camera-height", "--no-metadata", "--model"),
    ),
    "Map": ("--around", "--backdrop", "--sky", "--compression", "--colors"),  # and the others of MapOptions
}
_LONG = 24  # options, from which on a help has sections


class _Helped(click.Command):
    """A command or group that shows its help by -h and --help, in any context, and examples at the end of it."""

    @property
    def examples(self) -> list[str]:
        """Command lines in the epilog, which the help shows as they are, however long."""
        return cleandoc(self.epilog or "").splitlines()

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """Write the examples, each in a line of its own.

        Args:
            ctx: of click.
            formatter: takes the lines.
        """
        if self.examples:
            with formatter.section("Examples"):
                for line in self.examples:
                    formatter.write(f"{'':{formatter.current_indent}}{line}\n")

    def get_help_option_names(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        """Return the names of the option that shows the help.

        Args:
            ctx: of click.
        """
        return ["-h", "--help"]


class Command(_Helped):
    """A command whose help ends with examples, and that knows the old names of its options."""

    renamed: ClassVar[Mapping[str, str]] = OLD_OPTIONS
    """Options' names by the old ones, which still work until 0.4.0 and which no help shows."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read the arguments; UsageError for one too many.

        Args:
            ctx: of click.
            args: as the user typed them.
        """
        ctx.allow_extra_args = True  # for a sentence of our own about them
        params = self.get_params(ctx)
        _check_dashes(ctx, args, params)
        try:
            extra = super().parse_args(ctx, self._with_new_names(args))
        except click.NoSuchOption as error:
            raise _explain_option(error, params) from error
        if extra and not ctx.resilient_parsing:
            takes = " and ".join(p.make_metavar(ctx) for p in self.params if isinstance(p, click.Argument))
            needs = f"takes only {takes}" if takes else "takes no file"
            is_port = extra[0].isdecimal() and any("--port" in param.opts for param in params)
            hint = f" Did you mean --port {extra[0]}?" if is_port else ""
            raise click.UsageError(f"`{ctx.command_path}` {needs}; {extra[0]!r} is too much.{hint}", ctx)
        return extra

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; an error about one of its options names it as the user typed it.

        Args:
            ctx: of click.
        """
        try:
            return super().invoke(ctx)
        except LightingError as error:
            from lighting.cli.options import with_option_name

            told = with_option_name(ctx, error)
            if told is error:
                raise
            raise told from error

    def option_sections(self, ctx: click.Context) -> dict[str, list[tuple[str, str]]]:
        """What the help shows of the options, names and meaning, by the title of their section.

        Args:
            ctx: of click.
        """
        params = self.get_params(ctx)
        options = {p.opts[0]: help for p in params if isinstance(p, click.Option) and (help := p.get_help_record(ctx))}
        if len(options) < _LONG:
            return {"Options": list(options.values())}
        from lighting.map_options import MapOptions

        sections = {title: [options.pop(n) for n in names if n in options] for title, names in _SECTIONS.items()}
        of_maps = [p.opts[0] for p in params if p.name in MapOptions.__dataclass_fields__]
        sections["Map"] += [options.pop(name) for name in of_maps if name in options]
        return {title: records for title, records in {"Options": list(options.values()), **sections}.items() if records}

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, of a long help in sections.

        Args:
            ctx: of click.
            formatter: takes the lines.
        """
        for title, records in self.option_sections(ctx).items():
            with formatter.section(title):
                formatter.write_dl(records)

    def _with_new_names(self, args: Sequence[str]) -> list[str]:
        """The arguments with the new names of options that were renamed."""
        typed = _before_names(args)
        split = (word.partition("=") for word in typed)
        options = [self.renamed.get(name, name) + equals + value for name, equals, value in split]
        if options[-1:] == ["--sun"]:  # which once stood alone: its check says what it is now
            options.append("")
        return [*options, *args[len(typed) :]]


def _before_names(args: Sequence[str]) -> Sequence[str]:
    """The arguments before "--", behind which all are names."""
    return args[: args.index("--")] if "--" in args else args


def _check_dashes(ctx: click.Context, args: Sequence[str], params: Sequence[click.Parameter]) -> None:
    """Raise UsageError for a long option with one dash, of which click reads the letters one by one."""
    names = {name for param in params for name in param.opts}
    for word in _before_names(args):
        option = "-" + word.partition("=")[0]
        if len(option) > len("--x") and option in names and word not in names:
            raise click.UsageError(f"There is no option {option[1:]}. Did you mean {option}?", ctx)


def _explain_option(error: click.NoSuchOption, params: Sequence[click.Parameter]) -> click.UsageError:
    """The error about an option that a command does not have, which names another if somebody can tell which."""
    from lighting.cli.hints import describe_unknown_option

    sentence = describe_unknown_option(error.option_name, {name for param in params for name in param.opts})
    return click.UsageError(sentence, error.ctx) if sentence else error


class Group(_Helped, click.Group):
    """Commands whose help ends with examples; an unknown one is answered by what was probably meant."""

    command_class = Command

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        """The commands in the order of their definition, which is that of their use.

        Args:
            ctx: of click.
        """
        return list(self.commands)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command; UsageError with a suggestion for a word that is none.

        Args:
            ctx: of click.
            args: the command's name and its arguments.
        """
        name = args[0]
        if not ctx.resilient_parsing and not name.startswith("-") and self.get_command(ctx, name) is None:
            from lighting.cli.hints import describe_unknown_command

            sentence = describe_unknown_command(name, ctx.command_path, self.list_commands(ctx))
            raise click.UsageError(escape_control_chars(sentence), ctx)
        return super().resolve_command(ctx, args)


Group.group_class = Group  # of a group's groups


class _Program(Group):
    """Commands whose expected errors end as one sentence and status 1."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        return list(_HOME)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name in _HOME:
            import_module(f"lighting.cli.{_HOME[cmd_name]}")
        return super().get_command(ctx, cmd_name)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if args[:1] in (["-h"], ["--help"]) and len(args) > 1:  # `--help COMMAND` is `COMMAND --help`
            args = [*args[1:], args[0]]
        try:
            return super().parse_args(ctx, args)  # which prints --help and --version
        except click.NoSuchOption as error:
            option, envmap = error.option_name, self.get_command(ctx, "envmap")
            if envmap and option in {name for param in envmap.params for name in param.opts}:
                sentence = f"{option} goes behind a command: `lighting envmap PHOTO {option}`."
                raise click.UsageError(sentence, ctx) from error
            raise _explain_option(error, self.get_params(ctx)) from error
        except OSError as error:
            if is_broken_pipe(error):
                raise
            raise click.ClickException(format_error(error)) from error

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except click.exceptions.NoArgsIsHelpError:  # a group's name alone, whose message is the group's help
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
    epilog="""
    lighting envmap photo.jpg                      # photo.exr, a map that lights like the photo
    lighting scene photo.jpg --for blender         # a folder that Blender opens
    lighting envmap photo.jpg --sun 40,25 -o b.exr # the same with another sun
    """,
)
@click.version_option(__version__)
@click.option("--debug", is_flag=True, help="Show the traceback of an error.")
def cli(debug: bool) -> None:
    """Light from one outdoor photo: sun, sky, camera, and an HDR environment map.

    Begin with `lighting envmap photo.jpg`, or with `lighting open`, which shows a page. The book is at
    /book/ of `lighting serve`.

    Azimuths are degrees from where the camera points, positive to the right. "-" is stdin or stdout.

    Results go beside the input, or where -o says. No file is replaced without --overwrite.

    Exit status: 0 all went well, 1 something failed, 2 wrong usage, 3 probably no outdoor daylight photo (--strict),
    4 an answer that is not sure (--require sure).

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
