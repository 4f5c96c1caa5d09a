"""Kinds of places by the words of their scenes."""

import pytest

from export.training.place_kinds import scene_kind


@pytest.mark.parametrize(
    ("scene", "kind"),
    [
        ("snow, Lapland, winter", "snow"),
        ("cedar shrine wood", "forest"),
        ("beach resort, Philippines", "shore"),
        ("oil well, broken cloud", "bare"),
        ("botanical garden", "garden"),
        ("Old town, late autumn", "city"),
        ("field, Philippines", "meadow"),
        ("campus, Lima", "park"),
        ("vineyard from the air", None),
        ("aerial", None),
        ("puresky", None),
        ("", None),
    ],
)
def test_a_scene_names_a_kind_of_place(scene: str, kind: str | None) -> None:
    assert scene_kind(scene) == kind
