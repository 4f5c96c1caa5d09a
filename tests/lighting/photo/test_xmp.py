"""XMP packets: what is read of them, and that none costs time or raises."""

import time
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lighting.photo.read import read_photo
from lighting.photo.xmp import MOST_BYTES, properties
from tests.conftest import encode, scene
from tests.lighting.photo.held import DJI, drone, packet

PITCH = "http://www.dji.com/drone-dji/1.0 GimbalPitchDegree"
BOMB = (
    b'<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">'
    + b"".join(f'<!ENTITY {chr(98 + i)} "{f"&{chr(97 + i)};" * 10}">'.encode() for i in range(12))
    + b']><x xmlns:d="http://www.dji.com/drone-dji/1.0/" d:GimbalPitchDegree="1"><y>&m;</y></x>'
)


def test_attributes_and_elements_are_alike() -> None:
    for elements in (False, True):
        found = properties(drone("-12.30", elements=elements))
        assert found[PITCH] == "-12.30"
        assert properties(drone("-12.30", elements=elements) + b"\0\0 \n") == found
        assert properties(packet(DJI.rstrip("/"), {"GimbalPitchDegree": "-12.30"}, elements))[PITCH] == "-12.30"


def test_the_first_of_two_counts() -> None:
    twice = packet(DJI, {"GimbalPitchDegree": "-1"}).replace(b"</rdf:RDF>", b"<d:a xmlns:d='u'>2</d:a></rdf:RDF>")
    assert properties(twice)[PITCH] == "-1"


@pytest.mark.parametrize(
    "data",
    [
        None,
        (1, 2),
        "text",
        b"",
        b"<x",
        b"<x></y>",
        b"\xff\xfe",
        b"<?xml version='1.0' encoding='nobody-knows'?><x/>",
        BOMB,
        b'<!DOCTYPE x SYSTEM "file:///etc/passwd"><x/>',
        b'<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]><x>&e;</x>',
        drone("-1").replace(b"<rdf:RDF", b"<!--" + b"x" * MOST_BYTES + b"--><rdf:RDF"),
    ],
)
def test_what_is_damaged_large_or_an_attack_counts_as_absent(data: Any) -> None:
    assert properties(data) == {}


@pytest.mark.parametrize(
    "data",
    [
        BOMB,
        b"<x>" * (MOST_BYTES // 3),
        b"<x " + b" ".join(f'a{i}="1"'.encode() for i in range(20_000)) + b"/>",
        b"<x>" + b"&amp;" * (MOST_BYTES // 5 - 10) + b"</x>",
        b"<x>" + b"\0" * 60_000_000,
    ],
)
def test_no_packet_takes_long(data: bytes) -> None:
    start = time.process_time()
    properties(data)
    assert time.process_time() - start < 1.0


def test_megabytes_of_it_leave_the_photo_as_it_is() -> None:
    packet = b"<x>" + b"a" * 4_000_000
    plain, heavy = (read_photo(encode(scene(160, 120), "WEBP", **options)) for options in ({}, {"xmp": packet}))
    assert heavy.facts == plain.facts
    assert (heavy.pixels == plain.pixels).all()


@given(st.binary(max_size=200))
def test_no_packet_whatever_raises(data: bytes) -> None:
    for start in (b"", b"<", b"<x ", drone("-1")[:200]):
        properties(start + data)
