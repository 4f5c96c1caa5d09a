"""Who asks: a client by its API key or its address, and sums by client."""

from collections.abc import Iterator
from functools import lru_cache
from ipaddress import IPv4Address, IPv6Address, IPv6Network, ip_address
from typing import NamedTuple, TypeVar

from starlette.requests import HTTPConnection

K = TypeVar("K")

_PREFIXES = (64, 56, 48)  # bits of an IPv6 address: a network, a home, a site
GROUP_SHARES = (1, 2, 3)  # what a client's groups may have, as multiples of a client's share
_NAT64 = IPv6Network("64:ff9b::/96")  # its last 32 bits are an IPv4 address (RFC 6052)
_LOCAL_NAT64 = IPv6Network("64:ff9b:1::/48")  # each of its addresses is an IPv4 one's (RFC 8215)


class Client(NamedTuple):
    """Who asks, by the groups whose shares it uses: itself first, then what it is a part of."""

    groups: tuple[str, ...]


UNKNOWN = Client(("unknown",))


@lru_cache(maxsize=4096)
def client_of_address(host: str) -> Client:
    """The client at an address.

    Args:
        host: an IP address, with or without a port.

    Returns:
        One group for IPv4, also where IPv6 maps or translates it (NAT64); else of IPv6 the /64, /56 and /48 networks;
        UNKNOWN for what is no address.
    """
    address = _parse_address(host)
    if address is None:
        return UNKNOWN
    if isinstance(address, IPv4Address) or address in _LOCAL_NAT64:
        return Client((str(address),))
    value = int(address)
    return Client(tuple(str(IPv6Network((value >> 128 - bits << 128 - bits, bits))) for bits in _PREFIXES))


def _parse_address(host: str) -> IPv4Address | IPv6Address | None:
    if host.count(":") == 1:  # some proxies append the port
        host = host.partition(":")[0]
    try:
        address = ip_address(host)
    except ValueError:
        return None
    if isinstance(address, IPv4Address):
        return address
    return IPv4Address(int(address) & 0xFFFFFFFF) if address in _NAT64 else address.ipv4_mapped or address


def client_of_key(number: int) -> Client:
    """The client that has an API key.

    Args:
        number: of the key, from 0.
    """
    return Client((f"key {number}",))


def client_of_request(request: HTTPConnection) -> Client:
    """The client that the access log's middleware noted.

    Args:
        request: a request that has come through it.
    """
    client: Client = request.scope.get("lighting_client", UNKNOWN)
    return client


class Tally:
    """Sums by client; each counts for all the groups of its client."""

    def __init__(self) -> None:
        self._sums: dict[str, float] = {}
        self._clients: dict[Client, float] = {}

    def add(self, client: Client, amount: float) -> None:
        """Add to a client's sum; one that comes back to 0 is forgotten.

        Args:
            client: any.
            amount: of either sign.
        """
        for group in client.groups:
            _add(self._sums, group, amount)
        _add(self._clients, client, amount)

    def load(self, client: Client, more: float = 0.0) -> float:
        """A client's sum, or, where that is more, a larger group's, divided by that group's share.

        Args:
            client: any.
            more: to be counted in addition.
        """
        sums = self._sums
        load = sums.get(client.groups[0], 0.0) + more
        for group, share in zip(client.groups[1:], GROUP_SHARES[1:], strict=False):
            load = max(load, (sums.get(group, 0.0) + more) / share)
        return load

    def __iter__(self) -> Iterator[Client]:
        return iter(self._clients)

    def __len__(self) -> int:
        return len(self._clients)


def _add(sums: dict[K, float], key: K, amount: float) -> None:
    sums[key] = sums.get(key, 0.0) + amount
    if not sums[key]:
        del sums[key]
