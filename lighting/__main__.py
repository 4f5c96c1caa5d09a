"""The command `lighting`, and `python -m lighting`.

The network begins to load before the command line is imported.
"""

import sys

from lighting.start import exit_now, exit_on_interrupt, prepare_process, replace_closed_streams, start_network


def run_command() -> None:
    """Run the command line; what the terminal cannot show is escaped instead of failing."""
    replace_closed_streams()
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    command = next((word for word in sys.argv[1:] if not word.startswith("-")), "")
    prepare_process(command)
    with exit_on_interrupt():
        network = start_network(command)
        from lighting.cli import cli

    try:
        cli(prog_name="lighting", obj=network)
    except SystemExit as end:
        if isinstance(end.code, int):
            exit_now(end.code)
        raise


if __name__ == "__main__":
    run_command()
