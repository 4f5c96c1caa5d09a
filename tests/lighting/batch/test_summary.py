"""The last line of a batch."""

from collections import Counter

import pytest

from lighting.batch import Summary
from lighting.batch.summary import in_words


@pytest.mark.parametrize(
    ("summary", "words"),
    [
        (Summary(10, 0, 0, 2.0), "10 done, 0 failed, 0 skipped; 5.0 photos a second."),
        (
            Summary(8, 2, 6, 0.5, Counter({".gif": 2, ".jxl": 1})),
            "8 done, 2 failed, 3 skipped (2 .gif, 1 .jxl); 6 by an earlier run, 8.0 photos a second.",
        ),
        (Summary(0, 0, 0, 0.0), "0 done, 0 failed, 0 skipped; 0.0 photos a second."),
    ],
)
def test_it_tells_what_became_of_the_photos(summary: Summary, words: str) -> None:
    assert str(summary) == words


def test_the_most_frequent_kind_comes_first() -> None:
    assert in_words(Counter({".bmp": 1, ".gif": 3})) == " (3 .gif, 1 .bmp)"
    assert in_words(Counter({".jxl": 1, ".bmp": 1})) == " (1 .bmp, 1 .jxl)"
    assert in_words(Counter()) == ""
