"""The answers that their clients have not taken yet: they take no place for work, and are limited in bytes."""

from typing import Protocol

from server.limiter import BusyError


class Sender(Protocol):
    """What is counted of a connection's transport."""

    def get_write_buffer_size(self) -> int: ...


class Unsent:
    """Counts the bytes that wait in connections; to be used in the event loop's thread alone."""

    def __init__(self, most: int) -> None:
        self.most = most
        self._waiting: set[Sender] = set()

    def add(self, transport: Sender) -> None:
        """Count what this connection holds until it is discarded."""
        self._waiting.add(transport)

    def discard(self, transport: Sender) -> None:
        self._waiting.discard(transport)

    @property
    def size(self) -> int:
        return sum(transport.get_write_buffer_size() for transport in self._waiting)

    @property
    def full(self) -> bool:
        return self.size >= self.most

    def check(self) -> None:
        """Raise BusyError where no further answer may be made."""
        if self.full:
            raise BusyError("As many bytes of answers as the service keeps wait for clients to take them.")
