"""The command line: parse, call the library, print.

A command's module is imported when it is called, and nothing heavy before it is needed. Results go to stdout; progress,
errors and counts to stderr. Exit status 0: all went well; 1: something failed, in one sentence; 2: wrong usage.
"""

from lighting.cli.group import cli

__all__ = ["cli"]
