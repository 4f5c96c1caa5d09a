"""What parameters of one request must fit: its photos, its body, each other."""

from server.problems import invalid
from server.queries import GivenQuery, LightingQuery


def check_photos(photos: int, query: LightingQuery) -> None:
    """Raise ProblemError where what is said of headings does not fit the number of photos."""
    turns = query.turns()
    if turns is not None and photos == 1:
        raise invalid("headings", "They are those of several photos; for one there is heading.")
    if turns is not None and len(turns) != photos:
        raise invalid("headings", f"There are {len(turns)} headings for {photos} photos.")
    if query.heading is not None and photos > 1:
        raise invalid("heading", "It is that of one photo; for several there is headings.")


def refuse_given(query: GivenQuery) -> None:
    """Raise ProblemError where a lighting record comes with what is known of a photo."""
    for name in GivenQuery.model_fields:
        if name in query.model_fields_set:
            raise invalid(name, "It goes with a photo; a lighting record is rendered as it is.")
