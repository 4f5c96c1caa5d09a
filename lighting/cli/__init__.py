"""The command line: parse, call the library, print.

A command's module is imported when it is called, and nothing heavy before it is needed. Results go to stdout; progress,
errors and counts to stderr. Exit status 0: all went well; 1: something failed, in one sentence; 2: wrong usage.
"""

import sys

from lighting.cli.group import cli
from lighting.cli.process import hold_closed_streams, leave, prepare

__all__ = ["cli", "main"]


def main() -> None:
    """Run the command line; what the terminal cannot show is escaped instead of failing."""
    hold_closed_streams()
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    prepare(sys.argv[1:])
    try:
        cli(prog_name="lighting")
    except SystemExit as end:
        if isinstance(end.code, int):
            leave(end.code)
        raise
