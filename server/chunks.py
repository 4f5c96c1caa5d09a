"""h11's connection, which refuses a body in crumbs: a chunk of a byte costs as much time as one of a thousand."""

import h11

MOST_CHUNKS = 4096  # of a body, unless they hold LEAST_CHUNK bytes in the mean
LEAST_CHUNK = 64


class CrumbsError(h11.RemoteProtocolError):
    """A body comes in very many tiny chunks."""


class Connection(h11.Connection):
    """Counts a body's chunks; next_event raises CrumbsError, too."""

    chunked = False  # whether the last request's body is
    _chunks = 0
    _size = 0

    def next_event(self) -> h11.Event | type[h11.NEED_DATA] | type[h11.PAUSED]:
        event = super().next_event()
        if isinstance(event, h11.Request):
            self.chunked = any(name == b"transfer-encoding" for name, _ in event.headers)
            self._chunks = self._size = 0
        elif isinstance(event, h11.Data):
            self._count(event)
        return event

    def _count(self, data: h11.Data) -> None:
        self._chunks += data.chunk_start
        self._size += len(data.data)
        if self._chunks > MOST_CHUNKS and self._size < LEAST_CHUNK * self._chunks:
            raise CrumbsError(f"The body has over {MOST_CHUNKS} chunks of fewer than {LEAST_CHUNK} bytes in the mean.")
