"""What the parameters of one request must fit: its photos, its body, each other."""

from collections import Counter

from fastapi import Request

from lighting.errors import ErrorCode, ParameterError
from lighting.evidence import check_heading, check_headings
from server.problems import InvalidField, all_invalid, invalid
from server.queries import ChangeQuery, EnvmapQuery, GivenQuery, LightingQuery


async def refuse_repeats(request: Request) -> None:
    """Raise ProblemError for a request that gives a parameter twice."""
    times = Counter(name for name, _ in request.query_params.multi_items())
    detail = "is given more than once"
    if often := [name for name, count in times.items() if count > 1]:
        raise all_invalid([InvalidField(name, "query", detail, ErrorCode.DUPLICATE) for name in often])


async def refuse_parameters(request: Request) -> None:
    """Raise ProblemError for any parameter: the route takes none."""
    if names := list(request.query_params):
        raise all_invalid([InvalidField(name, "query", "is not known here", ErrorCode.UNKNOWN) for name in names])


def check_photos(photos: int, query: LightingQuery) -> None:
    """Raise ProblemError where what is said of headings does not fit the number of photos."""
    try:
        check_headings(photos, query.turns())
        check_heading(photos, query.heading)
    except ParameterError as error:
        raise invalid(error.field or "headings", str(error), code=error.code) from error


def refuse_given(query: EnvmapQuery) -> None:
    """Raise ProblemError where a lighting record comes with parameters that describe or need a photo."""
    for name in (*GivenQuery.model_fields, *ChangeQuery.model_fields, "surroundings"):
        if name in query.stated():
            raise invalid(name, "It goes with a photo; a lighting record is rendered as it is.")
