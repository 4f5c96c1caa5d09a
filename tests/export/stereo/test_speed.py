"""What the timing prints."""

from typing import Any

import pytest

from export.stereo import speed
from lighting.stereo.normals.solve import Session


def test_one_and_three_channels_with_and_without_the_network(monkeypatch: pytest.MonkeyPatch) -> None:
    shapes = []

    def solve(session: Session, *, network: Any) -> None:
        shapes.append((*session.images.shape, network is not None))

    monkeypatch.setattr(speed, "SIDE", 16)
    monkeypatch.setattr(speed, "solve", solve)
    lines: list[str] = []
    speed.report(lines.append)
    assert shapes == [(8, 16, 16, channels, network) for channels in (1, 3) for network in (False, True)]
    assert [line.split(":")[0] for line in lines] == [
        "1 channel(s), search",
        "1 channel(s), search and network",
        "3 channel(s), search",
        "3 channel(s), search and network",
    ]
