"""The accuracy of a network, as the service returns it."""

from pathlib import Path

from export.evaluation.figures import CAMERA_AND_SKY, SUN, write_figures
from lighting.model import CARD, Model, packaged_model
from server.model_figures import accuracy
from server.schemas import Accuracy
from tests.conftest import TINY


def test_the_service_reads_what_the_evaluation_writes(tmp_path: Path) -> None:
    measured = {name: float(i) for i, name in enumerate([*SUN.values(), *CAMERA_AND_SKY.values()])}
    write_figures(TINY, {"phone": {**measured}, "paper": {**measured, "sun_median": None}}, tmp_path)
    assert accuracy(TINY, tmp_path) == {"phone": measured}  # nothing is stated of a protocol without suns to score
    assert set(measured) == set(Accuracy.model_fields)


def test_the_packaged_network_s_figures_are_those_of_its_card() -> None:
    """The row of the network in the card's table of the sun, which the same evaluation wrote."""
    folder = packaged_model().parent
    stated = accuracy(Model.load().spec, folder)
    assert set(stated) == {"paper", "phone"}
    card = (folder / CARD).read_text(encoding="utf-8")
    for protocol, numbers in stated.items():
        assert set(numbers) == set(Accuracy.model_fields)
        section = card[card.index(f"## Protocol `{protocol}`") :]
        row = next(line for line in section.splitlines() if line.startswith("| outdoor"))
        names = ("crops", "sun_median", "sun_quartile_1", "sun_quartile_3", "within_22_5", "within_45")
        assert row.split("|")[2:8] == [
            f" {numbers[name]:g} " if name == "crops" else f" {numbers[name]:.1f} " for name in names
        ]


def test_nothing_is_stated_for_a_network_without_figures(tmp_path: Path) -> None:
    assert accuracy(TINY, packaged_model().parent) == {}
    assert accuracy(TINY, tmp_path) == {}
