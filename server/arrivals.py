"""The bodies that are arriving: they take none of the places for work, and are limited in all and by client."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from server.limiter import BusyError


class CrowdedError(Exception):
    """One client sends as many bodies at once as it may."""


class Arrivals:
    """Counts the bodies under way, in all and from each client's address."""

    def __init__(self, most: int, most_of_a_client: int) -> None:
        self.most = most
        self.most_of_a_client = most_of_a_client
        self._of: Counter[str] = Counter()

    @property
    def count(self) -> int:
        return self._of.total()

    @property
    def full(self) -> bool:
        return self.count >= self.most

    @contextmanager
    def one_of(self, client: str) -> Iterator[None]:
        """Count a body until the end of the block; raises CrowdedError or BusyError where there are too many."""
        if self._of[client] >= self.most_of_a_client:
            raise CrowdedError
        if self.full:
            raise BusyError("As many bodies are arriving as the service takes at once.")
        self._of[client] += 1
        try:
            yield
        finally:
            self._of[client] -= 1
            self._of += Counter()  # forgets who sends nothing
