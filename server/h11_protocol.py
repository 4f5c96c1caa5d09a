"""Hardened HTTP/1.1: limits on the size and the time of heads, chunks and responses.

uvicorn's own class has no time limit for a head or a response and answers 400 to a head that is too large. It passes
everything that a socket held to h11 at once: sixteen times the limit of a head, or forty thousand chunks of a body.
A chunk of one byte costs as much time as one of a thousand. And a request with two lengths of its body can be read as
two different requests (request smuggling).
"""

import asyncio
import logging
import sys
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from server import problems
from server.limits import PendingResponses
from server.problems import ProblemKind

MAX_CHUNKS = 4096  # of a body, unless they hold MIN_MEAN_CHUNK bytes in the mean
MIN_MEAN_CHUNK = 64  # bytes
_AMBIGUOUS_LENGTH = "Content-Length and Transfer-Encoding both say where the body ends; send one of them"

MAX_HEADER_BYTES = 16384  # of a request line and its headers
RESPONSE_GRACE = 30.0  # seconds in which a response may be taken more slowly than at its minimum rate

_READ_BYTES = 4096  # of heads and of chunks that h11 gets in one iteration of the event loop
_BODY_READ_BYTES = 65536  # of a body of a known length, which costs little
_LINGER_BYTES = 262_144  # that are read and dropped, for so many seconds, after a refusal: a connection that is closed
_LINGER_SECONDS = 1.0  # with bytes unread takes its last response with it

access_log = logging.getLogger("server.access")


class _TinyChunksError(h11.RemoteProtocolError):
    """A body comes in very many tiny chunks."""


class _Connection(h11.Connection):
    """Counts a body's chunks; next_event also raises _TinyChunksError, and RemoteProtocolError for two lengths."""

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
                raise h11.RemoteProtocolError(_AMBIGUOUS_LENGTH)
        elif isinstance(event, h11.Data):
            self._count(event)
        return event

    def _count(self, data: h11.Data) -> None:
        self._chunks += data.chunk_start
        self._size += len(data.data)
        if self._chunks > MAX_CHUNKS and self._size < MIN_MEAN_CHUNK * self._chunks:
            tiny = f"fewer than {MIN_MEAN_CHUNK} bytes in the mean"
            raise _TinyChunksError(f"The body has over {MAX_CHUNKS} chunks of {tiny}.")


class BoundedProtocol(H11Protocol, asyncio.BufferedProtocol):
    """One connection, which limits how much it reads at once.

    Args:
        head_seconds: time limit for a request's head, from its first byte or from connecting.
        answer_rate: bytes per second at which a response must be taken, at least, after RESPONSE_GRACE.
        pending: counts the bytes that wait for clients.
    """

    def __init__(
        self, *arguments: Any, head_seconds: float, answer_rate: int, pending: PendingResponses, **more: Any
    ) -> None:
        super().__init__(*arguments, **more)
        self.conn: _Connection = _Connection(h11.SERVER, MAX_HEADER_BYTES)
        self._head_seconds = head_seconds
        self._answer_rate = answer_rate
        self._pending = pending
        self._deadline: asyncio.TimerHandle | None = None  # of a head
        self._send_deadline: asyncio.TimerHandle | None = None  # of a response that its client does not take
        self._buffer = bytearray()
        self._dropped_bytes: int | None = None  # after a refusal; None before

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        transport.set_write_buffer_limits(high=0)  # so that writing pauses as soon as a byte is left
        self._set_deadline()

    def connection_lost(self, exc: Exception | None) -> None:
        self.resume_writing()
        super().connection_lost(exc)
        self._cancel_deadline()

    def get_buffer(self, sizehint: int) -> bytearray:  # noqa: ARG002
        """A buffer for the next read, small enough that other connections run between two reads."""
        self._buffer = bytearray(self._read_size())
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        self.data_received(bytes(self._buffer[:nbytes]))

    def data_received(self, data: bytes) -> None:
        if self._dropped_bytes is None:
            super().data_received(data)
            self._set_deadline()
        else:
            self._drop(data)

    def _read_size(self) -> int:
        """The number of bytes that h11 gets next; it checks the size of a head only while it is incomplete."""
        if self.conn.their_state is h11.SEND_BODY:
            return _READ_BYTES if self.conn.chunked else _BODY_READ_BYTES
        waiting = len(self.conn.trailing_data[0])
        return max(1, min(_READ_BYTES, MAX_HEADER_BYTES - waiting))

    def send_400_response(self, msg: str) -> None:
        """Answer what h11 could not read, by the exception that is being handled."""
        error = sys.exception()
        if isinstance(error, _TinyChunksError):
            self._refuse(problems.UNREADABLE_BODY, str(error))
        elif getattr(error, "error_status_hint", 400) == problems.HEADERS_TOO_LARGE.status:
            detail = f"The request line and the headers exceed {MAX_HEADER_BYTES} bytes."
            self._refuse(problems.HEADERS_TOO_LARGE, detail)
        else:
            reason = str(error or msg).partition(": bytearray")[0]  # without the bytes, which may hold a key
            self._refuse(problems.MALFORMED, f"The request cannot be read: {reason}.")

    def _unsupported_upgrade_warning(self) -> None:
        """No warning: an upgrade may be ignored, and some clients request HTTP/2 on every connection."""

    def pause_writing(self) -> None:
        super().pause_writing()
        self._pending.add(self.transport)
        size = self.transport.get_write_buffer_size()
        self._set_send_deadline(size, self.loop.time())

    def resume_writing(self) -> None:
        super().resume_writing()
        self._pending.discard(self.transport)
        if self._send_deadline is not None:
            self._send_deadline.cancel()
            self._send_deadline = None

    def _set_send_deadline(self, size: int, began: float) -> None:
        """Set the time until which more of a response of `size` bytes must be taken; abort a late connection."""
        taken = size - self.transport.get_write_buffer_size()
        until = began + RESPONSE_GRACE + taken / self._answer_rate
        if until <= self.loop.time():
            access_log.info("dropped an answer that its client took too slowly")
            self.transport.abort()
        else:
            self._send_deadline = self.loop.call_at(until, self._set_send_deadline, size, began)

    def _set_deadline(self) -> None:
        """Start the time limit of a head unless a request is running."""
        if self._dropped_bytes is not None:
            return
        if self._is_working() or self.transport.is_closing():
            self._cancel_deadline()
        elif self._deadline is None:
            self._deadline = self.loop.call_later(self._head_seconds, self._on_deadline)

    def _is_working(self) -> bool:
        return self.cycle is not None and not self.cycle.response_complete

    def _cancel_deadline(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _on_deadline(self) -> None:
        """End the connection; answer 408 only if a head has begun or none came yet."""
        if self.conn.our_state is h11.IDLE and (self.cycle is None or self.conn.trailing_data[0]):
            self._refuse(problems.TOO_SLOW, f"The headers did not arrive within {self._head_seconds:g} seconds.")
        else:
            self.transport.close()

    def _refuse(self, kind: ProblemKind, detail: str) -> None:
        """End the connection and its request, with a problem unless a response has already begun."""
        if self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            self._send(kind, detail)
        if self._is_working():
            self.cycle.waiting_for_100_continue = False
            self.cycle.disconnected = True
            self.cycle.message_event.set()
        self._linger()

    def _send(self, kind: ProblemKind, detail: str) -> None:
        access_log.info("refused %d %s", kind.status, kind.name)
        body = problems.problem_json(kind, detail)
        headers = [
            (b"content-type", problems.MEDIA_TYPE.encode()),
            (b"content-length", b"%d" % len(body)),
            (b"connection", b"close"),
        ]
        for event in (h11.Response(status_code=kind.status, headers=headers), h11.Data(data=body), h11.EndOfMessage()):
            self.transport.write(self.conn.send(event) or b"")

    def _linger(self) -> None:
        """Close the connection when the client has, or has had time to read the response."""
        self._dropped_bytes = 0
        self._cancel_deadline()
        self._deadline = self.loop.call_later(_LINGER_SECONDS, self.transport.close)
        self.transport.write_eof()
        self.flow.resume_reading()

    def _drop(self, data: bytes) -> None:
        self._dropped_bytes = (self._dropped_bytes or 0) + len(data)
        if self._dropped_bytes > _LINGER_BYTES:
            self.transport.close()
