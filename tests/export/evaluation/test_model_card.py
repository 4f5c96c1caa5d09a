"""The card's picture, and the words that any network's card has."""

from pathlib import Path

from export.evaluation.model_card import TEMPLATE, _publish


def test_the_picture_goes_to_the_documents_and_is_linked_from_the_card(tmp_path: Path) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "lighting" / "data").mkdir(parents=True)
    picture = tmp_path / "reliability.png"
    picture.write_bytes(b"curves")
    link = _publish(picture, tmp_path / "docs", tmp_path / "lighting" / "data" / "MODEL_CARD.md")
    assert link == "../../docs/reliability.png"
    assert (tmp_path / "lighting" / "data" / link).read_bytes() == b"curves"


def test_the_template_shows_the_diagram_before_the_figures() -> None:
    text = TEMPLATE.read_text(encoding="utf-8")
    assert text.index("{reliability}") < text.index("{report}")
