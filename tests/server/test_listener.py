"""Tests of the listening sockets."""

import socket
import sys
from collections.abc import Iterator

import pytest

from server.listener import MAX_REFUSALS, Listener, bind_listeners

GREEDY = "127.0.0.2"

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux has all of 127.0.0.0/8")


@pytest.fixture
def listener() -> Iterator[Listener]:
    (listener,) = bind_listeners("127.0.0.1", 0)
    with listener:
        listener.refuses = lambda host: host == GREEDY
        listener.setblocking(False)
        listener.listen(1)
        yield listener


def connect(listener: Listener, host: str) -> socket.socket:
    return socket.create_connection(listener.getsockname(), timeout=10, source_address=(host, 0))


def test_a_refused_connection_is_closed_and_the_next_one_taken(listener: Listener) -> None:
    with connect(listener, GREEDY) as refused, connect(listener, "127.0.0.3") as taken:
        connection, address = listener.accept()
        assert (type(connection), address) == (socket.socket, taken.getsockname())
        connection.close()
        assert refused.recv(1) == b""
        with pytest.raises(BlockingIOError):
            listener.accept()


def test_refusals_leave_the_loop_its_turn(listener: Listener) -> None:
    crowd = [connect(listener, GREEDY) for _ in range(MAX_REFUSALS + 1)]
    with connect(listener, "127.0.0.3"):
        with pytest.raises(BlockingIOError):
            listener.accept()
        assert [crowd[0].recv(1), crowd[MAX_REFUSALS - 1].recv(1)] == [b"", b""]
        (connection,) = listener.accept_waiting()
        connection.close()
    for refused in crowd:
        refused.close()


def test_a_name_of_two_addresses_is_bound_where_they_are_free() -> None:
    addresses = {info[4][0] for info in socket.getaddrinfo("localhost", 0, type=socket.SOCK_STREAM)}
    listeners = bind_listeners("localhost", 0)
    assert {listener.getsockname()[0] for listener in listeners} <= addresses
    for listener in listeners:
        listener.close()
