"""Tests of identity."""

import pytest

from server.identity import GROUP_SHARES, Client, Tally, client_of_address, client_of_key


@pytest.mark.parametrize(
    ("host", "groups"),
    [
        ("::ffff:192.0.2.1", ("192.0.2.1",)),
        ("192.0.2.1:5678", ("192.0.2.1",)),
        ("192.0.2.1", ("192.0.2.1",)),
        ("64:ff9b::192.0.2.1", ("192.0.2.1",)),
        ("64:ff9b::c000:202", ("192.0.2.2",)),
        ("64:ff9b:0:0:0:1:c000:202", ("64:ff9b::/64", "64:ff9b::/56", "64:ff9b::/48")),
        ("2001:db8:1:abcd:3:4:5:6", ("2001:db8:1:abcd::/64", "2001:db8:1:ab00::/56", "2001:db8:1::/48")),
        ("2001:db8:1:abcd::9", ("2001:db8:1:abcd::/64", "2001:db8:1:ab00::/56", "2001:db8:1::/48")),
        ("fe80::1%eth0", ("fe80::/64", "fe80::/56", "fe80::/48")),
        ("testclient", ("unknown",)),
        ("", ("unknown",)),
    ],
)
def test_clients_are_known_by_address(host: str, groups: tuple[str, ...]) -> None:
    assert client_of_address(host) == Client(groups)


def test_a_key_is_a_client_and_no_address() -> None:
    assert client_of_key(0) != client_of_key(1)
    assert client_of_key(0).groups != client_of_address("192.0.2.1").groups


def test_sums_are_of_groups_and_divided_by_their_shares() -> None:
    tally = Tally()
    rooms = [client_of_address(f"2001:db8:0:{network:x}::1") for network in (0x100, 0x101, 0x102, 0x200)]
    for room in rooms[:3]:
        tally.add(room, 1)
    assert tally.load(rooms[0]) == 3 / GROUP_SHARES[1]
    assert tally.load(rooms[0], 2) == 3.0
    assert tally.load(rooms[3]) == 3 / GROUP_SHARES[2]
    assert tally.load(client_of_address("2001:db8:1::1")) == 0
    assert (list(tally), len(tally)) == (rooms[:3], 3)
    for room in rooms[:3]:
        tally.add(room, -1)
    assert (list(tally), tally.load(rooms[0])) == ([], 0)
