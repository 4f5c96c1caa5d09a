"""What a plan for photometric stereo is asked for in a URL, and what its JSON holds."""

from datetime import date
from typing import Annotated, Literal, Self

from pydantic import BaseModel, BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from lighting.stereo import FEWEST_SHOTS, NOISES, ModelledSkies, Question
from server.queries import Query
from server.texts import Offset, in_words, misfit
from server.values import Between, Omissible, named

MOST_DAYS = 31  # of a range
MOST_SHOTS = 64  # of a window; these two bound what a request costs, as does
MOST_WORK = 248  # days times photos: ten seconds of one processor under a polar day's broken clouds


def _day(text: object) -> object:
    """A date written 2026-06-21; pydantic would take seconds too."""
    if not isinstance(text, str):
        return text
    try:
        return date.fromisoformat(text if len(text) == len("2026-06-21") else "")
    except ValueError as error:
        raise PydanticCustomError("date", "must be a date such as 2026-06-21") from error


Day = Annotated[date, BeforeValidator(_day), Field(examples=["2026-06-21"])]


class PlanQuery(Query):
    """Where, when and what is to be photographed."""

    lat: Annotated[float, named("latitude", "deg, positive north", 48.14)]
    lon: Annotated[float, named("longitude", "deg, positive east", 11.58)]
    date: Day = Field(description="the day by the clock of the place")
    until: Annotated[Day | None, Omissible()] = Field(
        None, description=f"last of up to {MOST_DAYS} days, whose best is planned"
    )
    sky: Literal["clear", "overcast", "mixed"] = Field("clear", description="modelled sky; mixed is broken cloud")
    facing: Annotated[
        float | None, Between(-360, 360, description="deg clockwise from north: where the surface faces; else all ways")
    ] = None
    shots: Annotated[int, Between(FEWEST_SHOTS, MOST_SHOTS, description="photos of a window")] = 8
    noise: Annotated[float, Between(*NOISES, description="per cent of the brightest light, of a pixel")] = 1.0
    utc_offset: Offset = Field(None, description="hours from UTC of the clock; by default the longitude's")

    @model_validator(mode="after")
    def _of_days(self) -> Self:
        in_words(lambda _: self.skies())("")
        days = ((self.until or self.date) - self.date).days + 1
        if days > MOST_DAYS:
            raise misfit("until", f"until is more than {MOST_DAYS} days from date")
        if days * self.shots > MOST_WORK:
            raise misfit("shots", f"days times shots may be {MOST_WORK} at most")
        return self

    def skies(self) -> ModelledSkies:
        """The same as the library takes it; raises ParameterError for dates that it cannot."""
        return ModelledSkies(self.lat, self.lon, self.date, self.until or self.date, self.sky, self.utc_offset)

    def question(self) -> Question:
        return Question(self.facing, self.shots, self.noise)


class Orientation(BaseModel):
    """What a window promises for one orientation of the surface."""

    name: str
    azimuth: float = Field(description="deg clockwise from north, where the normal points")
    elevation: float = Field(description="deg, of the normal above the horizon")
    error: float = Field(description="deg, expected error of the normal, 90 at most")
    gain: float | None = Field(description="largest noise gain of an axis; null where the light resolves nothing")
    interval_95: list[float | None] = Field(description="half width for the normal's components east, up, south")


class Window(BaseModel):
    hours: int
    start: str = Field(examples=["10:30"])
    end: str
    error: float = Field(description="deg, expected error of the normal, median over orientations")
    gain: float | None = Field(description="largest noise gain of an axis, median over orientations")
    rotation_free_gain: float | None = Field(description="1 / least singular value, median over orientations")
    orientations: list[Orientation]


class DayScore(BaseModel):
    date: str
    errors: list[float] = Field(description="deg, of the best window of 1, 2, 3 and 6 hours; 90 where none fits")


class StereoPlan(BaseModel):
    """When to photograph a surface so that photometric stereo finds its normals best."""

    latitude: float
    longitude: float
    utc_offset: float = Field(description="h, of the clock that days and times are told by")
    sky: str
    date: str = Field(description="the best day")
    facing: float | None
    shots: int
    noise: float
    windows: list[Window]
    days: list[DayScore]
