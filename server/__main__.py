"""Start the service, `python -m server` or `lighting-server`: settings, socket, signals, logging."""

import asyncio
import logging
import os
import signal
import socket
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import partial
from types import FrameType
from typing import TYPE_CHECKING, Any

from lighting.errors import LightingError
from lighting.runtime import keep_memory
from lighting.version import __version__

if TYPE_CHECKING:
    from fastapi import FastAPI

    from server.connections import Listener
    from server.dependencies import Service


# For which a service behind a proxy goes on when it is told to end: longer than an idle connection of the Caddyfile is
# kept, so that no request meets the end of its connection.
_DRAIN_SECONDS = 4.0
_SWITCH_SECONDS = 0.001  # for which one thread may keep others waiting; Python's five times that delay short requests
_DROP_SECONDS = 0.5  # before the end of a shutdown's time, answers that nobody takes are dropped


def _run_until_signal(app: "FastAPI", listeners: "list[Listener]") -> None:
    """Serve; running requests finish after a signal, but a SIGINT meanwhile ends the process at once.

    Behind a proxy new requests are taken for a while, each as the last of its connection: the proxy sends them until
    it finds nobody there.
    """
    from uvicorn import Config, Server

    from server.connections import BoundedProtocol
    from server.limits import BACKLOG

    service: Service = app.state.service
    settings = service.settings
    config = Config(
        app,
        host=settings.host,
        port=settings.port,
        loop="asyncio",  # uvloop, where it is installed, would read without the bounds of BoundedProtocol
        workers=1,  # whatever WEB_CONCURRENCY says, which many hosts set: one process works on several photos
        log_config=None,  # run_server has set it, since loading logs
        access_log=False,
        server_header=False,
        proxy_headers=bool(settings.trusted_proxies),
        forwarded_allow_ips=settings.trusted_proxies,
        root_path=settings.root_path,
        timeout_graceful_shutdown=settings.shutdown_seconds,
        backlog=BACKLOG,
        ws="none",
        http=partial(BoundedProtocol, service=service),  # type: ignore[arg-type]  # which it calls alone
    )

    class InterruptibleServer(Server):
        _interrupted = False  # by somebody who waits

        def handle_exit(self, sig: int, frame: FrameType | None) -> None:
            if self.should_exit and sig == signal.SIGINT:
                _end_process(sig, frame)
            self._interrupted = sig == signal.SIGINT
            super().handle_exit(sig, frame)

        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets)
            self._log_started_message(listeners)

        async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
            service.ending = True
            if settings.trusted_proxies and not self._interrupted:
                await asyncio.sleep(_DRAIN_SECONDS)
            if sys.platform != "win32":
                await self._stop_listening()
            loop = asyncio.get_running_loop()
            loop.call_later(max(0.0, settings.shutdown_seconds - _DROP_SECONDS), service.pending.drop_all)
            await super().shutdown(sockets)

        async def _stop_listening(self) -> None:
            """Stop; connections that the system has made are taken before, since it would end them."""
            loop = asyncio.get_running_loop()
            for listener in listeners:
                loop.remove_reader(listener.fileno())
            await asyncio.sleep(0)  # for the connections that the loop has just accepted
            accepted = [connection for listener in listeners for connection in listener.accept_waiting()]
            for server in self.servers:
                server.close()
            for connection in accepted:
                await loop.connect_accepted_socket(self._make_protocol, connection)

        def _make_protocol(self) -> asyncio.Protocol:
            make: Callable[..., asyncio.Protocol] = self.config.http_protocol_class
            return make(config=self.config, server_state=self.server_state, app_state=self.lifespan.state)

    InterruptibleServer(config).run(list(listeners))


def _end_at_signals() -> None:
    """End the process by SIGINT, SIGTERM and SIGHUP; a running server finishes first.

    uvicorn raises its signal again when it has finished, whatever still runs in threads. A SIGHUP that is ignored,
    as by nohup, stays ignored.
    """
    signal.signal(signal.SIGINT, _end_process)
    signal.signal(signal.SIGTERM, _end_process)
    if sys.platform != "win32" and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        signal.signal(signal.SIGHUP, lambda *_: signal.raise_signal(signal.SIGTERM))


def _end_process(sig: int, _: FrameType | None) -> None:
    """End the process by a signal's default action; a container's first process has none and exits with its status."""
    signal.signal(sig, signal.SIG_DFL)
    signal.raise_signal(sig)
    os._exit(128 + sig)


def _prepare_process() -> None:
    """Use one thread per photo and reuse memory; call this before numpy is imported.

    OpenBLAS's threads would compete with those that process other photos. And glibc would return each photo's buffers
    to the system and request them again for the next photo.
    """
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    sys.setswitchinterval(_SWITCH_SECONDS)
    keep_memory()


def _read_arguments() -> None:
    """Print the help or the version; any other argument is wrong usage, status 2."""
    from server.settings import PREFIX, Settings

    fields = [(f"{PREFIX}{name.upper()}", field) for name, field in Settings.model_fields.items()]
    lines = [f"  {name:32}{field.description}{_format_default(field.default)}" for name, field in fields]
    parser = ArgumentParser(
        prog="lighting-server",
        description="Estimate the light of outdoor photos over HTTP. Settings are read from environment variables:",
        epilog="\n".join(lines),
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=__version__)
    parser.parse_args()


def _format_default(value: object) -> str:
    """A setting's default, in the help."""
    return "" if value in (None, "", ()) else f" [{value}]"


def run_server() -> None:
    """Serve until SIGTERM, SIGINT or SIGHUP, after which running requests have `shutdown_seconds` to finish."""
    _prepare_process()
    _read_arguments()
    from pydantic import ValidationError

    from lighting.files.exr import set_compression_threads
    from server.app import create_app
    from server.connections import bind_listeners
    from server.limits import raise_file_limit
    from server.settings import PREFIX, read_settings

    _end_at_signals()
    with ExitStack() as sockets:
        try:
            settings = read_settings()
            _configure_logging(settings.log_level.upper())
            listeners = [sockets.enter_context(one) for one in bind_listeners(settings.host, settings.port)]
            raise_file_limit()
            app = create_app(settings)
            service: Service = app.state.service
            service.load()
            app.openapi()  # before requests come, whose first ones change FastAPI's routes under its hands
            set_compression_threads(settings.workers)
        except ValidationError as error:
            sys.exit("\n".join(f"{PREFIX}{_format_setting_error(details)}" for details in error.errors()))
        except (LightingError, OSError) as error:
            sys.exit(str(error))
        for listener in listeners:
            listener.refuses = service.refuses_connection
        _run_until_signal(app, listeners)


def _format_setting_error(details: Mapping[str, Any]) -> str:
    """The name of a setting, and the sentence of pydantic or of the setting's own check."""
    reason = details["ctx"]["error"] if details["type"] == "value_error" else details["msg"]
    return f"{'.'.join(map(str, details['loc'])).upper()}: {reason}"


def _configure_logging(level: str) -> None:
    """Log to stderr, one line per event."""
    logging.basicConfig(level=level, format="%(asctime)s %(levelname)s %(name)s: %(message)s", force=True)
    for name in ("python_multipart", "server.http"):  # malformed forms and requests, which have a line of their own
        logging.getLogger(name).setLevel(logging.ERROR)


if __name__ == "__main__":
    run_server()
