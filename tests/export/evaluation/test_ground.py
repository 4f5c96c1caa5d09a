"""The fit of how far the network tells the ground's brightness."""

from pathlib import Path

import numpy as np
import pytest

from export.data import DataError
from export.evaluation import ground as module
from export.evaluation.ground import Grounds, fit, ground_report, standard_error
from lighting.model import Model


def grounds(share: float, darker: float, noise: float = 0.0) -> Grounds:
    """Crops whose true ground is that share of the network's, the less the cloudier, and some noise."""
    rng = np.random.default_rng(3)
    photo, around = rng.normal(0, 1, 500), rng.normal(0, 1, 500)
    weather, cover = np.repeat(["overcast", "sunny"], 250), np.repeat([0.4, 0.0], 250)
    true = photo + (1 - cover) * share * (around + darker - photo) + rng.normal(0, noise, 500)
    return Grounds(photo, around, true, cover, weather, np.arange(500).astype(str))


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_the_share_that_made_them_is_found(share: float) -> None:
    found, darker = fit(grounds(share, 0.4))
    assert found == pytest.approx(share)
    if share:
        assert darker == pytest.approx(0.4)


def test_in_doubt_the_network_counts_for_less() -> None:
    assert 0.3 <= fit(grounds(0.5, 0.2, noise=1.0))[0] < 0.5


def test_more_crops_of_the_same_places_leave_as_much_doubt() -> None:
    one, again = grounds(0.5, 0.2, noise=1.0), np.repeat(np.arange(500), 8)
    photo, around, true, cover = (values[again] for values in (one.photo, one.around, one.true, one.cover))
    more = Grounds(photo, around, true, cover, one.weather[again], one.place[again])
    assert fit(more) == fit(one)
    error, expected = one.errors(0.0, 0.0), pytest.approx(one.errors(0.0, 0.0).std() / np.sqrt(500))
    assert standard_error(error, one.place) == expected
    assert standard_error(error[again], more.place) == expected


def test_errors_are_sizes_in_stops() -> None:
    photo, around, true = (np.array([value, value]) for value in (1.0, 3.0, 0.0))
    one = Grounds(photo, around, true, np.array([0.0, 0.5]), np.array(["sunny", "overcast"]), np.array(["a", "b"]))
    assert one.errors(0.0, 0.0) == pytest.approx([1.0, 1.0])
    assert one.errors(0.5, -6.0) == pytest.approx([1.0, 0.0])


@pytest.mark.slow
def test_places_that_the_network_saw_do_not_count(data: Path, lit_network: Path) -> None:
    assert len(module.look(Model.load(lit_network), data, data / "labels.csv", "train").true)
    with pytest.raises(DataError, match="No crop of the panoramas of train that are sunny or overcast shows ground"):
        ground_report(Model.load(lit_network), data, data / "labels.csv", seen=data)


def test_the_report_names_the_fit_and_each_weather(monkeypatch: pytest.MonkeyPatch, lit_network: Path) -> None:
    monkeypatch.setattr(module, "look", lambda *_: grounds(0.3, 0.4))
    report = ground_report(Model.load(lit_network), Path("data"), Path("labels.csv"))
    assert report.startswith("Share of the network: 0.3 x (1 - cover), 0.4 stops brighter")
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in report.splitlines()[4:]]
    assert [row[:3] for row in rows] == [
        [part, kind, "250"] for part in ("train", "val") for kind in ("overcast", "sunny")
    ]
    assert [float(row[4]) for row in rows] == [0.0] * 4
