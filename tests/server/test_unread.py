"""A refusal reaches a client that sends a large body and wants its connection closed, on a real socket."""

from collections.abc import Iterator
from contextlib import closing
from http.client import HTTPConnection

import anyio
import pytest
from starlette.types import Message, Receive, Scope, Send

from server import unread
from server.unread import ReadOn
from tests.server.running import running

LARGE = bytes(20_000_000)  # more than the sockets of both sides keep


async def refusing(_scope: Scope, _receive: Receive, send: Send) -> None:
    """Answers without a look at the body."""
    await send({"type": "http.response.start", "status": 415, "headers": [(b"content-length", b"2")]})
    await send({"type": "http.response.body", "body": b"no"})


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    with running(ReadOn(refusing), "h11") as number:
        yield number


@pytest.mark.parametrize("headers", [{}, {"Connection": "close"}])
def test_a_refusal_of_a_large_body_is_heard(port: int, headers: dict[str, str]) -> None:
    with closing(HTTPConnection("127.0.0.1", port, timeout=30)) as connection:
        connection.request("POST", "/", LARGE, headers)
        with connection.getresponse() as answer:
            assert (answer.status, answer.read()) == (415, b"no")


def answered(scope: Scope, receive: Receive) -> list[Message]:
    """What is sent to the client of a request."""
    sent: list[Message] = []

    async def send(message: Message) -> None:
        sent.append(message)

    anyio.run(ReadOn(refusing), scope, receive, send)
    return sent


@pytest.mark.parametrize(
    ("headers", "version", "reads"),
    [
        ([(b"connection", b"close")], "1.1", True),
        ([], "1.0", True),
        ([], "1.1", False),
        ([(b"connection", b"close"), (b"expect", b"100-continue")], "1.1", False),
    ],
)
def test_only_a_body_on_its_way_over_a_closing_connection_is_read(
    headers: list[tuple[bytes, bytes]], version: str, reads: bool
) -> None:
    parts = [{"type": "http.request", "more_body": more} for more in (True, True, False)]

    async def receive() -> Message:
        return parts.pop(0)

    sent = answered({"type": "http", "headers": headers, "http_version": version}, receive)
    assert (not parts) == reads
    assert b"".join(message.get("body", b"") for message in sent) == b"no"
    assert not sent[-1].get("more_body")


def test_a_body_that_does_not_end_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(unread, "SECONDS", 0.05)

    async def receive() -> Message:
        await anyio.sleep(0.01)
        return {"type": "http.request", "more_body": True}

    sent = answered({"type": "http", "headers": [], "http_version": "1.0"}, receive)
    assert not sent[-1].get("more_body")
