"""Start the service: `python -m server`, or `lighting-server`."""

import errno
import os
import socket
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NoReturn

from lighting import __version__
from lighting.errors import LightingError, MissingExtraError
from server.process import prepare

if TYPE_CHECKING:
    from server.service import Service


def main() -> None:
    """Serve until SIGTERM, SIGINT or SIGHUP, after which running requests have `shutdown_seconds` to finish."""
    prepare()
    try:
        if sys.argv[1:]:
            refuse(sys.argv[1:])
        serve()
    except ModuleNotFoundError as error:
        sys.exit(str(MissingExtraError.of(f"The service needs {error.name}", "server")))


def refuse(arguments: Sequence[str]) -> NoReturn:
    """Print help or the version if asked for; any other argument is wrong usage, status 2."""
    from server.settings import PREFIX, Settings

    fields = Settings.model_fields.items()
    listed = "\n".join(
        f"  {PREFIX + name.upper():29}{field.description}{_default(field.default)}" for name, field in fields
    )
    parser = ArgumentParser(
        prog="lighting-server",
        description="Estimate the light of outdoor photos over HTTP. Settings are read from environment variables:",
        epilog=listed,
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=__version__)
    parser.parse_args(arguments)
    parser.error("there are no other arguments; settings are read from the environment")


def _default(value: object) -> str:
    """A setting's default, in the help."""
    return "" if value in (None, "", ()) else f" [{value}]"


def serve() -> None:
    """Read the settings, load the network and serve."""
    from pydantic import ValidationError
    from uvicorn import Config

    from lighting.files import pack_in_threads
    from server.app import create_app
    from server.ending import Server, end_at_signals
    from server.settings import PREFIX, read_settings

    end_at_signals()
    try:
        settings = read_settings()
        refuse_taken(settings.host, settings.port)
        app = create_app(settings)
        app.state.service.load()
        pack_in_threads(settings.places)
    except ValidationError as error:
        sys.exit("\n".join(f"{PREFIX}{_fault_of_setting(found)}" for found in error.errors()))
    except (LightingError, OSError) as error:
        sys.exit(str(error))
    config = Config(
        app,
        host=settings.host,
        port=settings.port,
        workers=1,  # whatever WEB_CONCURRENCY says, which many hosts set: one process works on several photos
        log_config=_logging(settings.log_level.upper()),
        access_log=False,
        server_header=False,
        proxy_headers=bool(settings.trusted_proxies),
        forwarded_allow_ips=settings.trusted_proxies,
        root_path=settings.root_path,
        timeout_graceful_shutdown=settings.shutdown_seconds,
        ws="none",
        http=_protocol(app.state.service),
    )
    Server(config).run()


def _fault_of_setting(found: Mapping[str, Any]) -> str:
    """The name of a setting, and what pydantic or the setting's own check says of it."""
    said = found["ctx"]["error"] if found["type"] == "value_error" else found["msg"]
    return f"{'.'.join(map(str, found['loc'])).upper()}: {said}"


def refuse_taken(host: str, port: int) -> None:
    """Raise SettingsError where the service could not listen, before the network is loaded."""
    from server.settings import PREFIX, SettingsError

    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except OSError as error:
        raise SettingsError(f"{PREFIX}HOST: {host} is no address to listen on: {error.strerror}.") from error
    errors = [_error_of_binding(family, address) for family, _, _, _, address in found]
    if all(errors) and (first := errors[0]):
        at_fault = "HOST" if first.errno == errno.EADDRNOTAVAIL else "PORT"
        raise SettingsError(f"{PREFIX}{at_fault}: {host}:{port} cannot be listened on: {first.strerror or first}.")


def _error_of_binding(family: int, address: Any) -> OSError | None:
    """Why a socket cannot have the address; None if it can."""
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        if os.name == "posix":  # as asyncio does, so that connections that just ended do not count
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(address)
        except OSError as error:
            return error
    return None


def _protocol(service: "Service") -> Any:
    """The class of a connection, with what its limits are."""
    from server.protocol import BoundedProtocol

    limits = service.settings
    return partial(
        BoundedProtocol,
        head_seconds=limits.header_seconds,
        answer_rate=limits.answer_rate,
        unsent=service.unsent,
    )


def _logging(level: str) -> dict[str, Any]:
    """Log to stderr, one line per event."""
    return {
        "version": 1,
        "disable_existing_loggers": False,
        "formatters": {"line": {"format": "%(asctime)s %(levelname)s %(name)s: %(message)s"}},
        "handlers": {"stderr": {"class": "logging.StreamHandler", "formatter": "line"}},
        "loggers": {"python_multipart": {"level": "ERROR"}},  # warns about every malformed form
        "root": {"level": level, "handlers": ["stderr"]},
    }


if __name__ == "__main__":
    main()
