"""Connections: listening sockets that refuse greedy clients early, and HTTP/1.1 with limits on each connection.

The limits are on the size and the time of heads, chunks and responses. Uvicorn's own class has no time limit for a head
or a response and answers 400 to a head that is too large. It passes everything that a socket held to h11 at once:
sixteen times the limit of a head, or forty thousand chunks of a body. A chunk of one byte costs as much time as one of
a thousand. And a request with two lengths of its body can be read as two different requests (request smuggling).
"""

import asyncio
import errno
import logging
import os
import secrets
import socket
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from server import problems
from server.dependencies import Service
from server.limits import PLACE_BYTES, UNKNOWN, Client, client_of_address
from server.middleware import SECURITY_HEADERS
from server.problems import ProblemKind
from server.settings import PREFIX, SettingsError

MAX_REFUSALS = 8  # in one iteration of the event loop, so that they delay nobody
_WAITING_CONNECTIONS = 2048  # that the system keeps until they are accepted, a few at a time
MAX_CHUNKS = 4096  # of a body, unless they hold MIN_MEAN_CHUNK bytes in the mean
MIN_MEAN_CHUNK = 64  # bytes
_AMBIGUOUS_LENGTH = "Content-Length and Transfer-Encoding both say where the body ends; send one of them"

MAX_HEADER_BYTES = 16384  # of a request line and its headers
RESPONSE_GRACE = 30.0  # seconds in which a response may be taken more slowly than at its minimum rate

_READ_BYTES = 4096  # of heads and of chunks that h11 gets in one iteration of the event loop
_BODY_READ_BYTES = 65536  # of a body of a known length, which costs little
_ASSUMED_BYTES = 10_000_000  # that a client counts as having taken in a second before its answer began
_PROBE_SECONDS = (0.5, 0.1, 0.4, 4.0, 24.0)  # between the interim answers to a client that sends no more
_LAST_SECONDS = 0.5  # for requests that are on their way when the service shuts down
_LINGER_BYTES = 262_144  # that are read and dropped, for so many seconds, after a refusal: a connection that is closed
_LINGER_SECONDS = 1.0  # with bytes unread takes its last response with it

access_log = logging.getLogger("server.access")
http_log = logging.getLogger("server.http")  # of which warnings would repeat the line of a refusal


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
        with suppress(OSError):  # where none waits
            while True:
                connection, _ = self.accept()
                connection.setblocking(False)
                accepted.append(connection)
        return accepted


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


class _TinyChunksError(h11.RemoteProtocolError):
    """A body comes in very many tiny chunks."""


class _Connection(h11.Connection):
    """Counts a body's chunks; next_event also raises _TinyChunksError, and RemoteProtocolError for two lengths."""

    chunked = False  # whether the last request's body is
    body_bytes = 0  # that have come of it
    _chunks = 0

    def next_event(self) -> h11.Event | type[h11.NEED_DATA] | type[h11.PAUSED]:
        event = super().next_event()
        if isinstance(event, h11.Request):
            names = {name for name, _ in event.headers}
            self.chunked = b"transfer-encoding" in names
            self._chunks = self.body_bytes = 0
            if self.chunked and b"content-length" in names:
                raise h11.RemoteProtocolError(_AMBIGUOUS_LENGTH)
        elif isinstance(event, h11.Data):
            self._count(event)
        return event

    def _count(self, data: h11.Data) -> None:
        self._chunks += data.chunk_start
        self.body_bytes += len(data.data)
        if self._chunks > MAX_CHUNKS and self.body_bytes < MIN_MEAN_CHUNK * self._chunks:
            tiny = f"fewer than {MIN_MEAN_CHUNK} bytes in the mean"
            raise _TinyChunksError(f"The body has over {MAX_CHUNKS} chunks of {tiny}.")


class BoundedProtocol(H11Protocol, asyncio.BufferedProtocol):
    """One connection, which limits how much it reads at once.

    Args:
        service: its settings, and what counts its connections and the bytes that wait for clients.
    """

    def __init__(self, *arguments: Any, service: Service, **more: Any) -> None:
        super().__init__(*arguments, **more)
        self.logger = http_log
        self.conn: _Connection = _Connection(h11.SERVER, MAX_HEADER_BYTES)
        self._service = service
        self._connections = service.connections
        self._peer = UNKNOWN
        self._deadline: asyncio.TimerHandle | None = None  # of a head
        self._send_deadline: asyncio.TimerHandle | None = None  # of a response that its client does not take
        self._answer: Any = None  # uvicorn's object of that response
        self._answer_size, self._answer_began = 0, 0.0  # its bytes, and the loop's time
        self._buffer = bytearray()
        self._dropped_bytes: int | None = None  # after a refusal; None before
        self._from_proxy = False
        self._half_closed = False  # whether the client sends no more
        self._shutting_down = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        transport.set_write_buffer_limits(high=0)  # so that writing pauses as soon as a byte is left
        host = self.client[0] if self.client else ""
        self._peer = client_of_address(host)
        self.app_state = self.app_state | {"peer": host}  # which stays, whatever client a proxy names
        self._from_proxy = self._service.settings.is_trusted_proxy(host)
        if self._connections.open(self, None if self._from_proxy else self._peer):
            self._set_deadline()
        else:
            transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        self._connections.close(self)
        self.resume_writing()
        super().connection_lost(exc)
        self._cancel_deadline()

    def give_way(self) -> None:
        """End the connection for another one."""
        self.transport.abort()

    def eof_received(self) -> bool:  # type: ignore[override]
        """Keep the connection of a client that sends no more, and may still read, until it has its answers.

        A proxy ends a whole connection, when its client has gone.
        """
        if self._dropped_bytes is not None or not self._is_working() or self.cycle.more_body or self._from_proxy:
            return False
        self._half_closed = True
        self._probe_later(0)
        return True

    def _probe_later(self, number: int) -> None:
        if number < len(_PROBE_SECONDS):
            self.loop.call_later(_PROBE_SECONDS[number], self._probe, number)

    def _probe(self, number: int) -> None:
        """Send an interim answer, which a client ignores that waits for its answer; the second one to nobody fails."""
        if self.transport.is_closing() or not self._is_working():
            return
        if self.conn.our_state is h11.SEND_RESPONSE and self.scope["http_version"] == "1.1":
            interim = h11.InformationalResponse(status_code=100, headers=[], reason=b"Continue")
            self.transport.write(self.conn.send(interim) or b"")
        self._probe_later(number + 1)

    def shutdown(self) -> None:
        """Let the request that runs or is on its way be the last."""
        self._shutting_down = True
        if self._is_working():
            super().shutdown()
        else:
            self.loop.call_later(_LAST_SECONDS, self._close_if_idle)

    def _close_if_idle(self) -> None:
        if not self._is_working() and not self.transport.is_closing():
            self.transport.close()

    def on_response_complete(self) -> None:
        self._connections.note_answer(self)
        super().on_response_complete()
        self._note_request()  # which may have waited behind the first
        if self._half_closed:
            self._close_if_idle()

    def _note_request(self) -> None:
        """Tell the limiter when something has been asked, and the last request of a shutdown that it is."""
        if not self._is_working():
            return
        self.cycle.keep_alive &= not self._shutting_down
        if self.conn.their_state is not h11.SEND_BODY or self.conn.body_bytes >= PLACE_BYTES:
            self._connections.note_request(self)

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
            self._note_request()
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
        self._service.pending.add(self, self._client())
        if self._answer is not self.cycle:
            self._answer = self.cycle
            self._answer_size, self._answer_began = self.unsent_bytes(), self.loop.time()
        self._set_send_deadline()

    def resume_writing(self) -> None:
        super().resume_writing()
        self._service.pending.discard(self)
        if self._send_deadline is not None:
            self._send_deadline.cancel()
            self._send_deadline = None

    def _client(self) -> Client:
        """Whose share an answer uses; behind a proxy the client that it names."""
        client: Client = self.scope.get("lighting_client", self._peer) if self.scope else self._peer  # type: ignore[assignment]
        return client

    def unsent_bytes(self) -> int:
        """Bytes of an answer that its client has not taken."""
        scope: Mapping[str, Any] = self.scope or {}
        return int(self.transport.get_write_buffer_size() + scope.get("unsent_rest", 0))

    def seconds_left(self) -> float:
        """Seconds until all is taken, at the mean speed so far; a fresh answer counts as taken fast."""
        taken = self._answer_size - self.unsent_bytes() + _ASSUMED_BYTES
        return self.unsent_bytes() * (self.loop.time() - self._answer_began + 1) / taken

    def drop_answer(self) -> None:
        """End the connection of a client that takes its answer more slowly than others."""
        access_log.info("dropped an answer to make room for others")
        self.transport.abort()

    def _set_send_deadline(self) -> None:
        """Set the time until which more of a response must be taken; abort a late connection."""
        taken = self._answer_size - self.unsent_bytes()
        until = self._answer_began + RESPONSE_GRACE + taken / self._service.settings.answer_rate
        if until <= self.loop.time():
            access_log.info("dropped an answer that its client took too slowly")
            self.transport.abort()
        else:
            self._send_deadline = self.loop.call_at(until, self._set_send_deadline)

    def _set_deadline(self) -> None:
        """Start the time limit of a head unless a request is running."""
        if self._dropped_bytes is not None:
            return
        if self._is_working() or self.transport.is_closing():
            self._cancel_deadline()
        elif self._deadline is None:
            self._deadline = self.loop.call_later(self._service.settings.header_seconds, self._on_deadline)

    def _is_working(self) -> bool:
        return self.cycle is not None and not self.cycle.response_complete

    def _cancel_deadline(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _on_deadline(self) -> None:
        """End the connection; answer 408 only if a head has begun or none came yet."""
        if self.conn.our_state is h11.IDLE and (self.cycle is None or self.conn.trailing_data[0]):
            seconds = self._service.settings.header_seconds
            self._refuse(problems.TOO_SLOW, f"The headers did not arrive within {seconds:g} seconds.")
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
        """Send a problem, with one line in the log: the request's own if there is one."""
        request_id = secrets.token_hex(8)
        if self._is_working():
            self.scope["refused"] = kind  # type: ignore[typeddict-unknown-key]
            request_id = str(self.scope.get("request_id", request_id))
        else:
            access_log.info("refused %d %s id=%s", kind.status, kind.name, request_id)
        body = problems.problem_json(kind, detail, request_id)
        headers = {"Content-Type": problems.MEDIA_TYPE, "Content-Length": str(len(body)), "Connection": "close"}
        headers |= {**SECURITY_HEADERS, "X-Request-ID": request_id}
        if model_name := self._service.model_name:
            headers["Lighting-Model"] = model_name
        pairs = [(name.lower().encode(), value.encode()) for name, value in headers.items()]
        response = h11.Response(status_code=kind.status, headers=self.server_state.default_headers + pairs)
        for event in (response, h11.Data(data=body), h11.EndOfMessage()):
            self.transport.write(self.conn.send(event) or b"")

    def _linger(self) -> None:
        """Close the connection when the client has, or has had time to read the response."""
        self._dropped_bytes = 0
        self._cancel_deadline()
        self._deadline = self.loop.call_later(_LINGER_SECONDS, self.transport.close)
        with suppress(OSError):  # where the client has gone
            self.transport.write_eof()
        self.flow.resume_reading()

    def _drop(self, data: bytes) -> None:
        self._dropped_bytes = (self._dropped_bytes or 0) + len(data)
        if self._dropped_bytes > _LINGER_BYTES:
            self.transport.close()
