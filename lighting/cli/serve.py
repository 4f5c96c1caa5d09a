"""The commands that start a service, as a process of its own: `open` with a browser, `serve` without, `mcp`."""

import errno
import json
import os
import signal
import socket
import subprocess
import sys
import time
import webbrowser
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import quote

import click

from lighting.cli import cli
from lighting.cli import options as common
from lighting.cli.console import check_photo_file, escape_path
from lighting.errors import MissingExtraError, PhotoError
from lighting.files import escape_undecodable

_LOOPBACK, _PORT = "127.0.0.1", 8000  # where the service listens, if nothing else is said
_NEIGHBORS = 100  # ports from there on that are tried before any free one
_ALL_ADDRESSES = {"0.0.0.0": _LOOPBACK, "::": "::1"}  # where this machine finds a service that listens on all
_START_SECONDS = 60.0  # until the service listens, on a slow machine
_POLL_SECONDS = 0.1
_FORWARDED_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")


@cli.command(
    "open",
    epilog="""
    lighting open                                       # the page, in your browser
    lighting open photo.jpg                             # with the photo in it
    BROWSER=firefox lighting open photo.jpg
    """,
)
@click.argument("photo", required=False, metavar="[PHOTO]", type=common.FileName())
@common.json_option
@common.silent_option
def _open(photo: str | None, as_json: bool, quiet: bool) -> None:
    """Open the web page in your browser, with PHOTO in it.

    The page and its service run on this machine alone, on a free port. PHOTO is shown only to
    those who know the secret in the address. Ctrl-C ends them.
    """
    import secrets  # as `http.client` below

    port, secret = _find_free_port(), secrets.token_urlsafe()
    url = f"http://{_LOOPBACK}:{port}/"
    settings = {"LIGHTING_HOST": _LOOPBACK, "LIGHTING_PORT": str(port), **_log_level("error" if quiet else "warning")}
    if photo is not None:
        _check_head(photo)
        settings |= {"LIGHTING_PHOTO": str(Path(photo).resolve()), "LIGHTING_PHOTO_SECRET": secret}
        url += f"#opened/{secret}/{quote(Path(photo).name, safe='')}"

    def show(process: "subprocess.Popen[bytes]") -> None:
        if not _wait_until_listening(process, _LOOPBACK, port):
            return
        opened = False
        with suppress(webbrowser.Error):  # which says that there is no browser
            opened = webbrowser.open(url)
        if as_json:
            name = None if photo is None else escape_undecodable(photo)
            click.echo(json.dumps({"url": url, "file": name, "opened": opened}))
        elif not (quiet and opened):
            _report_page(url, photo, opened)

    raise SystemExit(_run_service(settings, show))


@cli.command(
    "serve",
    epilog="""
    lighting serve                                      # http://127.0.0.1:8000
    lighting serve --port 9000
    lighting serve --host 0.0.0.0                       # also for your phone: read SECURITY.md first
    """,
)
@click.option("--host", help="Address to listen on; 0.0.0.0 listens on all. [default: 127.0.0.1]")
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    help="Port to listen on; 0 picks a free one. [default: 8000, or the next that is free]",
)
@common.json_option
@common.silent_option
def _serve(host: str | None, port: int | None, as_json: bool, quiet: bool) -> None:
    """Serve the HTTP API and the web page until Ctrl-C.

    --json prints the address once the service listens. The other settings are environment variables, which
    `lighting-server --help` lists.
    """
    stated = {"LIGHTING_HOST": host, "LIGHTING_PORT": None if port is None else str(port)}
    settings = {name: value for name, value in stated.items() if value is not None}
    settings |= _log_level("error") if quiet else {}
    text = settings.get("LIGHTING_PORT") or os.environ.get("LIGHTING_PORT") or str(_PORT)
    name = host or os.environ.get("LIGHTING_HOST") or _LOOPBACK
    stated_port = port is not None or bool(os.environ.get("LIGHTING_PORT"))
    if text == "0":
        text = settings["LIGHTING_PORT"] = str(_find_free_port())
    elif text.isdecimal() and _is_taken(name, int(text)):
        if stated_port:
            raise click.ClickException(f"Another program listens on port {text}; without --port it takes a free one.")
        text = settings["LIGHTING_PORT"] = str(_next_free_port(name))
    if quiet and not as_json:
        raise SystemExit(_run_service(settings))
    address = _ALL_ADDRESSES.get(name, name)

    def report(process: "subprocess.Popen[bytes]") -> None:
        if not text.isdecimal() or not _wait_until_listening(process, address, int(text)):
            return  # the service says what is wrong
        url = f"http://{f'[{address}]' if ':' in address else address}:{text}/"
        if as_json:
            click.echo(json.dumps({"url": url}))
            return
        click.echo(f"Page: {url}  API: {url}docs  Try: curl -F photo=@photo.jpg {url}v1/lighting")
        if name in _ALL_ADDRESSES and (network := _find_network_address()):
            click.echo(f"Phones and other devices in your network open http://{network}:{text}/")

    raise SystemExit(_run_service(settings, report))


@cli.command(
    "mcp",
    epilog="""
    lighting mcp photos/                                # prints what to put into an assistant's settings
    lighting mcp photos/ shots/ --json > lighting.json  # into a file
    lighting mcp photos/ < /dev/null                    # serves, as an assistant starts it
    """,
)
@click.argument("folders", nargs=-1, required=True, metavar="FOLDER...", type=common.FileName())
@click.option("--json", "as_json", is_flag=True, help="Print the settings, also where nobody reads them.")
@click.option("-q", "--quiet", is_flag=True, help="No words beside the settings.")
def _mcp(folders: tuple[str, ...], as_json: bool, quiet: bool) -> None:
    """Serve assistants by the Model Context Protocol.

    Its tools read and write below each FOLDER alone, and fetch nothing. Assistants start it and use stdin and stdout.
    In a terminal it prints what to put into the assistant's settings.
    """
    for folder in folders:
        if not Path(folder).is_dir():
            raise click.UsageError(f"There is no folder {escape_path(folder)}.")
    if find_spec("mcp") is None:
        raise MissingExtraError.of("Assistants need the package mcp", "mcp")
    paths = [str(Path(folder).resolve()) for folder in folders]
    if as_json or sys.stdin.isatty():
        if not quiet:
            click.echo("Assistants start this command. Put this into the settings of yours:", err=True)
        entry = {"command": sys.executable, "args": ["-P", "-m", "lighting", "mcp", *paths]}
        click.echo(json.dumps({"mcpServers": {"lighting": entry}}, indent=2))
        return
    raise SystemExit(_run_service({}, module="server.mcp_server", arguments=paths))


def _check_head(photo: str) -> None:
    """Raise an error for what is no photo by its first bytes: the page would say so only later."""
    from lighting.photo.formats import HEAD_BYTES, begins_as_photo, unreadable_sentence

    check_photo_file(photo)
    with Path(photo).open("rb") as stream:
        head = stream.read(4096)
    if not begins_as_photo(head[:HEAD_BYTES]):
        sentence = unreadable_sentence(head) if head else "The photo is empty."
        raise PhotoError(f"{escape_path(photo)}: {sentence}")


def _find_network_address() -> str | None:
    """The address of this machine in its network; None without one. Nothing is sent."""
    with suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.connect(("192.0.2.1", 9))  # an address of documentation: the system says by which of its own it would go
        return str(probe.getsockname()[0])
    return None


def _log_level(level: str) -> dict[str, str]:
    """The service's log level, unless the environment states one."""
    return {} if os.environ.get("LIGHTING_LOG_LEVEL") else {"LIGHTING_LOG_LEVEL": level}


def _find_free_port() -> int:
    with socket.socket() as probe:
        probe.bind((_LOOPBACK, 0))
        return int(probe.getsockname()[1])


def _is_taken(host: str, port: int) -> bool:
    """Whether another program listens on a port; False also where the service itself says what is wrong."""
    with suppress(OSError, OverflowError):
        for family, kind, _, _, address in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM):
            with socket.socket(family, kind) as probe:
                if os.name == "posix":  # as the service does: connections that just ended do not count
                    probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                try:
                    probe.bind(address)
                except OSError as error:
                    if error.errno == errno.EADDRINUSE:
                        return True
    return False


def _next_free_port(host: str) -> int:
    following = range(_PORT + 1, _PORT + _NEIGHBORS)
    return next((port for port in following if not _is_taken(host, port)), None) or _find_free_port()


def _report_page(url: str, photo: str | None, opened: bool) -> None:
    """Say what a browser shows, or what to open where there is none."""
    shown = "" if photo is None else f" with {escape_path(Path(photo).name)}"
    sentence = f"Opened {url}{shown} in your browser." if opened else f"Open {url}{shown} in a browser."
    click.echo(f"{sentence} Ctrl-C ends the service.")


def _wait_until_listening(process: "subprocess.Popen[bytes]", host: str, port: int) -> bool:
    """Whether the service answers; False when it has ended or takes too long."""
    import http.client  # 12 ms, which the help is spared

    deadline = time.monotonic() + _START_SECONDS
    while process.poll() is None and time.monotonic() < deadline:
        connection = http.client.HTTPConnection(host, port, timeout=_START_SECONDS)
        with suppress(OSError, http.client.HTTPException), closing(connection):
            connection.request("GET", "/livez")
            return connection.getresponse().status == 200
        time.sleep(_POLL_SECONDS)
    return False


def _run_service(
    settings: Mapping[str, str],
    when_started: Callable[["subprocess.Popen[bytes]"], None] | None = None,
    *,
    module: str = "server",
    arguments: Sequence[str] = (),
) -> int:
    """Run a module of the service to its end, and hand it the signals that this process gets.

    Args:
        settings: variables of its environment.
        when_started: is called once the process runs; None calls nothing.
        module: its full name.
        arguments: of its command line.

    Returns:
        Its exit status; 128 and a signal's number where that ended it.
    """
    search_path = os.pathsep.join(filter(None, sys.path))  # the service of this installation, whatever the folder
    environment = {**os.environ, "PYTHONPATH": search_path, **settings}
    group = 0 if os.name == "posix" else None  # one of its own, so that Ctrl-C comes once, from here
    command = [sys.executable, "-P", "-m", module, *arguments]
    with subprocess.Popen(command, env=environment, process_group=group) as process:
        try:
            with _forwarded_signals(process):
                if when_started:
                    when_started(process)
                status = process.wait()
        except BaseException:
            process.kill()
            raise
    return status if status >= 0 else 128 - status


@contextmanager
def _forwarded_signals(process: "subprocess.Popen[bytes]") -> Iterator[None]:
    """Hand signals on within the block, so that the service can finish what it does; an ignored one stays ignored."""

    def forward(number: int, _: object) -> None:
        if os.name == "posix":  # elsewhere the console has told both
            process.send_signal(number)

    numbers = [getattr(signal, name) for name in _FORWARDED_SIGNALS if hasattr(signal, name)]
    before = {n: signal.signal(n, forward) for n in numbers if signal.getsignal(n) is not signal.SIG_IGN}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
