"""h11's connection, which refuses a body in crumbs, and one that says twice where it ends.

A chunk of a byte costs as much time as one of a thousand; and who reads the one of two ends that h11 drops takes what
lies between them for another request.
"""

import h11

MOST_CHUNKS = 4096  # of a body, unless they hold LEAST_CHUNK bytes in the mean
LEAST_CHUNK = 64
TWO_ENDS = "Content-Length and Transfer-Encoding both say where the body ends; send one of them"


class CrumbsError(h11.RemoteProtocolError):
    """A body comes in very many tiny chunks."""


class Connection(h11.Connection):
    """Counts a body's chunks; next_event raises CrumbsError, too, and RemoteProtocolError for two ends of a body."""

    chunked = False  # whether the last request's body is
    _chunks = 0
    _size = 0

    def next_event(self) -> h11.Event | type[h11.NEED_DATA] | type[h11.PAUSED]:
        event = super().next_event()
        if isinstance(event, h11.Request):
            names = {name for name, _ in event.headers}
            self.chunked = b"transfer-encoding" in names
            self._chunks = self._size = 0
            if self.chunked and b"content-length" in names:
                raise h11.RemoteProtocolError(TWO_ENDS)
        elif isinstance(event, h11.Data):
            self._count(event)
        return event

    def _count(self, data: h11.Data) -> None:
        self._chunks += data.chunk_start
        self._size += len(data.data)
        if self._chunks > MOST_CHUNKS and self._size < LEAST_CHUNK * self._chunks:
            raise CrumbsError(f"The body has over {MOST_CHUNKS} chunks of fewer than {LEAST_CHUNK} bytes in the mean.")
