"""What signals do to the service: the first lets it finish, a second SIGINT does not."""

import os
import signal
import sys
from types import FrameType

import uvicorn


class Server(uvicorn.Server):
    """uvicorn's server, which ends at once at a SIGINT while it finishes what runs."""

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        if self.should_exit and sig == signal.SIGINT:
            end(sig, frame)
        super().handle_exit(sig, frame)


def end_at_signals() -> None:
    """End the process by SIGINT, SIGTERM and SIGHUP; while a Server runs, it finishes first.

    The Server raises its signal again when it is done, whatever steps still run in threads. A SIGHUP that whoever
    started the process ignores, as nohup does, stays ignored.
    """
    signal.signal(signal.SIGINT, end)
    signal.signal(signal.SIGTERM, end)
    if sys.platform != "win32" and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        signal.signal(signal.SIGHUP, lambda *_: signal.raise_signal(signal.SIGTERM))


def end(sig: int, _: FrameType | None) -> None:
    """End the process by a signal's default; the first process of a container has none, and exits with its status."""
    signal.signal(sig, signal.SIG_DFL)
    signal.raise_signal(sig)
    os._exit(128 + sig)
