"""HTTP/1.1 by h11, whose request heads must be small and must come in time.

uvicorn's own class knows no time for a head, answers 400 to one that is too large, and hands h11 as much at once as the
socket held, which may be sixteen times what h11 is told to take.
"""

import asyncio
import sys
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from server import problems
from server.problems import Kind

HEADER_BYTES = 16384  # of a request line and its headers

_PIECE = 4096  # bytes of a head that h11 sees at once


class BoundedProtocol(H11Protocol):
    """One connection; `head_seconds` is what a request's head may take, from its first byte or from connecting."""

    def __init__(self, *arguments: Any, head_seconds: float, **more: Any) -> None:
        super().__init__(*arguments, **more)
        self._head_seconds = head_seconds
        self._deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._watch()

    def connection_lost(self, exc: Exception | None) -> None:
        super().connection_lost(exc)
        self._relax()

    def data_received(self, data: bytes) -> None:
        while data and not self.transport.is_closing():
            size = self._piece() if self.conn.their_state is h11.IDLE else len(data)
            super().data_received(data[:size])
            data = data[size:]
        self._watch()

    def _piece(self) -> int:
        """The number of bytes that h11 sees next of a head, which it measures only where it is not yet whole."""
        waiting = len(self.conn.trailing_data[0])
        return max(1, min(_PIECE, HEADER_BYTES - waiting))

    def send_400_response(self, msg: str) -> None:
        """Answer what h11 could not read; the exception that is handled just now says why."""
        if getattr(sys.exception(), "error_status_hint", 400) == problems.HEADERS_TOO_LARGE.status:
            self._refuse(problems.HEADERS_TOO_LARGE, f"The request line and the headers exceed {HEADER_BYTES} bytes.")
        else:
            self._refuse(problems.MALFORMED, msg)

    def _watch(self) -> None:
        """Start the time of a head unless a request is in work."""
        working = self.cycle is not None and not self.cycle.response_complete
        if working or self.transport.is_closing():
            self._relax()
        elif self._deadline is None:
            self._deadline = self.loop.call_later(self._head_seconds, self._expire)

    def _relax(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _expire(self) -> None:
        if self.conn.our_state is h11.IDLE:
            self._refuse(problems.TOO_SLOW, f"The headers did not arrive within {self._head_seconds:g} seconds.")
        self.transport.close()

    def _refuse(self, kind: Kind, detail: str) -> None:
        body = problems.plain(kind, detail)
        headers = [
            (b"content-type", problems.MEDIA_TYPE.encode()),
            (b"content-length", b"%d" % len(body)),
            (b"connection", b"close"),
        ]
        for event in (h11.Response(status_code=kind.status, headers=headers), h11.Data(data=body), h11.EndOfMessage()):
            self.transport.write(self.conn.send(event) or b"")
        self.transport.close()
