"""Listening sockets, which refuse the connections of greedy clients before they cost anything else."""

import errno
import os
import socket
from collections.abc import Callable
from typing import Any

from server.settings import PREFIX, SettingsError

MAX_REFUSALS = 8  # in one iteration of the event loop, so that they delay nobody
_WAITING_CONNECTIONS = 2048  # that the system keeps until they are accepted, a few at a time


class Listener(socket.socket):
    """A listening socket; a connection that is refused costs two system calls, and is never seen by the event loop."""

    refuses: Callable[[str], bool] = staticmethod(lambda _: False)  # whether an address gets no further connection

    def listen(self, _: int = 0, /) -> None:
        """Listen; asyncio would let as many connections wait as it accepts at once."""
        super().listen(_WAITING_CONNECTIONS)

    def accept(self) -> tuple[socket.socket, Any]:
        """The next connection that is not refused, and its address.

        Raises:
            BlockingIOError: none waits, or enough have been refused for this turn of the event loop.
        """
        for _ in range(MAX_REFUSALS):
            connection, address = super().accept()
            if not self.refuses(str(address[0])):
                return connection, address
            connection.close()
        raise BlockingIOError

    def accept_waiting(self) -> list[socket.socket]:
        """All connections that wait, for the event loop to take."""
        accepted: list[socket.socket] = []
        while True:
            try:
                connection, _ = self.accept()
            except OSError:
                return accepted
            connection.setblocking(False)
            accepted.append(connection)


def bind_listeners(host: str, port: int) -> list[Listener]:
    """Sockets bound to every address of a host; they do not listen yet.

    Args:
        host: a name or an address; empty means all addresses.
        port: 0 picks a free one.

    Raises:
        SettingsError: the service cannot listen there.
    """
    try:
        infos = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except OSError as error:
        raise SettingsError(f"{PREFIX}HOST: {host} is no address to listen on: {error.strerror}.") from error
    listeners, errors = [], []
    for family, _, _, _, address in dict.fromkeys(infos):
        try:
            listeners.append(_bind(family, address))
        except OSError as error:
            errors.append(error)
    if not listeners:
        setting = "HOST" if errors[0].errno == errno.EADDRNOTAVAIL else "PORT"
        reason = errors[0].strerror or errors[0]
        raise SettingsError(f"{PREFIX}{setting}: {host}:{port} cannot be listened on: {reason}.")
    return listeners


def _bind(family: int, address: Any) -> Listener:
    listener = Listener(family, socket.SOCK_STREAM)
    try:
        if os.name == "posix":  # so that connections that just ended do not count
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if family == socket.AF_INET6:  # IPv4 has a socket of its own
            listener.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        listener.bind(address)
    except OSError:
        listener.close()
        raise
    return listener
