"""What a client still sends of a body that is answered before it was read."""

from anyio import move_on_after
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

SECONDS = 5.0  # for the rest of a body, as long as a connection that stays open is kept


class ReadOn:
    """Reads and drops the rest of a body before a connection closes that the client wants closed after the answer.

    A connection that is closed with bytes unread takes its answer with it; one that stays open is read on anyway.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and _closes(scope):
            await self._with_all_read(scope, receive, send)
        else:
            await self.app(scope, receive, send)

    async def _with_all_read(self, scope: Scope, receive: Receive, send: Send) -> None:
        left = True

        async def reading() -> Message:
            nonlocal left
            message = await receive()
            left = message.get("more_body", False)
            return message

        async def answering(message: Message) -> None:
            last = message["type"] == "http.response.body" and not message.get("more_body")
            if last and left:
                await send({**message, "more_body": True})
                with move_on_after(SECONDS):
                    while left:
                        await reading()
                message = {"type": "http.response.body"}
            await send(message)

        await self.app(scope, reading, answering)


def _closes(scope: Scope) -> bool:
    """Whether the client wants its connection closed, and sends its body unasked."""
    headers = Headers(scope=scope)
    wanted = scope["http_version"] == "1.0" or "close" in headers.get("connection", "").lower()
    return wanted and "expect" not in headers
