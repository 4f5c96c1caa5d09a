"""Hardened HTTP/1.1 (optional behind a proxy).

uvicorn's own class knows no time for a head or an answer, answers 400 to a head that is too large, and hands h11 as
much at once as the socket held: of a head sixteen times what h11 is told to take, of a body forty thousand chunks.

A chunk of a byte costs as much time as one of a thousand; and who reads the one of two ends that h11 drops takes what
lies between them for another request.
"""

import asyncio
import logging
import sys
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from server import problems
from server.limits import PendingResponses
from server.problems import Kind

# h11's connection, which refuses a body in crumbs, and one that says twice where it ends.

MOST_CHUNKS = 4096  # of a body, unless they hold LEAST_CHUNK bytes in the mean
LEAST_CHUNK = 64
TWO_ENDS = "Content-Length and Transfer-Encoding both say where the body ends; send one of them"


class _CrumbsError(h11.RemoteProtocolError):
    """A body comes in very many tiny chunks."""


class _Connection(h11.Connection):
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
            raise _CrumbsError(f"The body has over {MOST_CHUNKS} chunks of fewer than {LEAST_CHUNK} bytes in the mean.")


HEADER_BYTES = 16384  # of a request line and its headers
ANSWER_GRACE = 30.0  # seconds in which an answer may be taken more slowly than at its least rate

access = logging.getLogger("server.access")

_PIECE = 4096  # bytes of heads and of chunks that h11 sees in one turn of the event loop
_LARGE_PIECE = 65536  # of a body of a known length, which costs little
_LINGER_BYTES = 262_144  # that are read and dropped, for so many seconds, after a refusal: a connection that is closed
_LINGER_SECONDS = 1.0  # with bytes unread takes its last answer with it


class BoundedProtocol(H11Protocol, asyncio.BufferedProtocol):
    """One connection, which says itself how much it reads at once.

    `head_seconds` is what a request's head may take, from its first byte or from connecting; `answer_rate`, in bytes
    per second after ANSWER_GRACE, how fast at least an answer must be taken; `unsent` counts what has not been.
    """

    def __init__(
        self, *arguments: Any, head_seconds: float, answer_rate: int, unsent: PendingResponses, **more: Any
    ) -> None:
        super().__init__(*arguments, **more)
        self.conn: _Connection = _Connection(h11.SERVER, HEADER_BYTES)
        self._head_seconds = head_seconds
        self._answer_rate = answer_rate
        self._unsent = unsent
        self._deadline: asyncio.TimerHandle | None = None  # of a head
        self._patience: asyncio.TimerHandle | None = None  # with a client that does not take its answer
        self._buffer = bytearray()
        self._dropped: int | None = None  # bytes after a refusal

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        transport.set_write_buffer_limits(high=0)  # so that writing pauses as soon as a byte is left
        self._watch()

    def connection_lost(self, exc: Exception | None) -> None:
        self.resume_writing()
        super().connection_lost(exc)
        self._relax()

    def get_buffer(self, sizehint: int) -> bytearray:  # noqa: ARG002
        """Room for what is read next; other connections have their turn before what comes after it."""
        self._buffer = bytearray(self._piece())
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        self.data_received(bytes(self._buffer[:nbytes]))

    def data_received(self, data: bytes) -> None:
        if self._dropped is None:
            super().data_received(data)
            self._watch()
        else:
            self._drop(data)

    def _piece(self) -> int:
        """The number of bytes that h11 sees next; it measures a head only where it is not yet whole."""
        if self.conn.their_state is h11.SEND_BODY:
            return _PIECE if self.conn.chunked else _LARGE_PIECE
        waiting = len(self.conn.trailing_data[0])
        return max(1, min(_PIECE, HEADER_BYTES - waiting))

    def send_400_response(self, msg: str) -> None:
        """Answer what h11 could not read; the exception that is handled just now says why."""
        error = sys.exception()
        if isinstance(error, _CrumbsError):
            self._refuse(problems.UNREADABLE_BODY, str(error))
        elif getattr(error, "error_status_hint", 400) == problems.HEADERS_TOO_LARGE.status:
            self._refuse(problems.HEADERS_TOO_LARGE, f"The request line and the headers exceed {HEADER_BYTES} bytes.")
        else:
            reason = str(error or msg).partition(": bytearray")[0]  # without the bytes, which may hold a key
            self._refuse(problems.MALFORMED, f"The request cannot be read: {reason}.")

    def _unsupported_upgrade_warning(self) -> None:
        """Say nothing: an upgrade may be ignored, and some clients ask for HTTP/2 on every connection."""

    def pause_writing(self) -> None:
        super().pause_writing()
        self._unsent.add(self.transport)
        size = self.transport.get_write_buffer_size()
        self._await_client(size, self.loop.time())

    def resume_writing(self) -> None:
        super().resume_writing()
        self._unsent.discard(self.transport)
        if self._patience is not None:
            self._patience.cancel()
            self._patience = None

    def _await_client(self, size: int, began: float) -> None:
        """Set the time until which more of an answer of `size` bytes must be taken; end a connection that is late."""
        taken = size - self.transport.get_write_buffer_size()
        until = began + ANSWER_GRACE + taken / self._answer_rate
        if until <= self.loop.time():
            access.info("dropped an answer that its client took too slowly")
            self.transport.abort()
        else:
            self._patience = self.loop.call_at(until, self._await_client, size, began)

    def _watch(self) -> None:
        """Start the time of a head unless a request is in work."""
        if self._dropped is not None:
            return
        if self._working() or self.transport.is_closing():
            self._relax()
        elif self._deadline is None:
            self._deadline = self.loop.call_later(self._head_seconds, self._expire)

    def _working(self) -> bool:
        return self.cycle is not None and not self.cycle.response_complete

    def _relax(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _expire(self) -> None:
        """End the connection, with an answer where one is due: not to the silence after an earlier answer."""
        if self.conn.our_state is h11.IDLE and (self.cycle is None or self.conn.trailing_data[0]):
            self._refuse(problems.TOO_SLOW, f"The headers did not arrive within {self._head_seconds:g} seconds.")
        else:
            self.transport.close()

    def _refuse(self, kind: Kind, detail: str) -> None:
        """End the connection, and with it its request, with a problem unless an answer has already begun."""
        if self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            self._send(kind, detail)
        if self._working():
            self.cycle.waiting_for_100_continue = False
            self.cycle.disconnected = True
            self.cycle.message_event.set()
        self._linger()

    def _send(self, kind: Kind, detail: str) -> None:
        access.info("refused %d %s", kind.status, kind.name)
        body = problems.plain(kind, detail)
        headers = [
            (b"content-type", problems.MEDIA_TYPE.encode()),
            (b"content-length", b"%d" % len(body)),
            (b"connection", b"close"),
        ]
        for event in (h11.Response(status_code=kind.status, headers=headers), h11.Data(data=body), h11.EndOfMessage()):
            self.transport.write(self.conn.send(event) or b"")

    def _linger(self) -> None:
        """Close the connection when the client has, or has had the time to read the answer."""
        self._dropped = 0
        self._relax()
        self._deadline = self.loop.call_later(_LINGER_SECONDS, self.transport.close)
        self.transport.write_eof()
        self.flow.resume_reading()

    def _drop(self, data: bytes) -> None:
        self._dropped = (self._dropped or 0) + len(data)
        if self._dropped > _LINGER_BYTES:
            self.transport.close()
