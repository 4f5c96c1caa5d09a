"""The model card's numbers, as the service tells them."""

from pathlib import Path

from lighting.model import Model, packaged_model
from server.card import accuracy
from server.schemas import Accuracy
from tests.conftest import TINY

SUN = "crops | median | quartile 1 | quartile 3 | < 22.5° % | < 45° % | azimuth | elevation | in 50 % region"
CARD = f"""# tiny 0.0.1

## Protocol `phone`: 9 crops

|  | {SUN} | in 90 % region |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |
| tiny | 5 | 20.5 | 10 | 30 | 51 | 71 | 19 | 7 | 40 | 80 |
| zenith | 5 | 47.6 | 42 | 68 | 4 | 41 | 90 | 48 | - | - |

Camera and sky

|  | crops | elevation | roll | fov | turbidity | exposure, stops |
| --- | --- | --- | --- | --- | --- | --- |
| tiny | 9 | 3.5 | 1.5 | 5.5 | 2.5 | 0.5 |
"""


def test_the_sun_and_the_camera_each_have_their_elevation(tmp_path: Path) -> None:
    (tmp_path / "MODEL_CARD.md").write_text(CARD, encoding="utf-8")
    phone = accuracy(TINY, tmp_path)["phone"]
    assert (phone["crops"], phone["sun_median"], phone["sun_elevation_median"]) == (5, 20.5, 7)
    assert (phone["camera_elevation_median"], phone["exposure_median"]) == (3.5, 0.5)


def test_beside_another_version_the_network_goes_by_its_full_name(tmp_path: Path) -> None:
    versions = CARD.replace("| tiny |", "| tiny 0.0.1 |").replace("| zenith |", "| tiny 0.0.0 |")
    (tmp_path / "MODEL_CARD.md").write_text(versions, encoding="utf-8")
    assert accuracy(TINY, tmp_path)["phone"]["sun_median"] == 20.5


def test_the_packaged_card_states_every_number_of_the_answer() -> None:
    stated = accuracy(Model.load().spec, packaged_model().parent)
    assert {"paper", "phone"} <= set(stated)
    assert all(set(numbers) == set(Accuracy.model_fields) for numbers in stated.values())


def test_a_card_of_another_network_says_nothing(tmp_path: Path) -> None:
    assert accuracy(TINY, packaged_model().parent) == {}
    assert accuracy(TINY, tmp_path) == {}
