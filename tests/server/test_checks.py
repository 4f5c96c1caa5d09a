"""Parameters that do not fit the photos or the body of their request."""

import pytest

from server.checks import check_photos, refuse_given
from server.problems import ProblemError
from server.queries import EnvmapQuery, LightingQuery


def error_of(error: ProblemError) -> tuple[str, int]:
    (found,) = error.more["errors"]
    return found["field"], error.kind.status


@pytest.mark.parametrize(
    ("photos", "query", "field"),
    [
        (1, LightingQuery(headings="0,90"), "headings"),
        (3, LightingQuery(headings="0,90"), "headings"),
        (2, LightingQuery(heading=90.0), "heading"),
    ],
)
def test_headings_must_fit_the_number_of_photos(photos: int, query: LightingQuery, field: str) -> None:
    with pytest.raises(ProblemError) as caught:
        check_photos(photos, query)
    assert error_of(caught.value) == (field, 422)


def test_headings_that_fit_are_taken() -> None:
    check_photos(1, LightingQuery(heading=90.0))
    check_photos(2, LightingQuery(headings="0,90"))
    check_photos(4, LightingQuery())


def test_a_record_takes_nothing_that_describes_a_photo() -> None:
    refuse_given(EnvmapQuery(sky="perez"))
    for query, field in ((EnvmapQuery(fov=50.0), "fov"), (EnvmapQuery(surroundings=True), "surroundings")):
        with pytest.raises(ProblemError) as caught:
            refuse_given(query)
        assert error_of(caught.value) == (field, 422)
