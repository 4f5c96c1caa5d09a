"""Randomness of crops."""

from export.crops.seeds import generator


def test_randomness_depends_on_name_index_and_purpose_alone() -> None:
    values = {generator(n, i, p).random() for n in "ab" for i in range(3) for p in ("train", "tune")}
    assert len(values) == 12
    assert generator("a", 1, "train").random() == generator("a", 1, "train").random()
