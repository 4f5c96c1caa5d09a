"""The parameters in the URLs of requests, with units and ranges, and what they must fit together."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import fields, replace
from datetime import date
from typing import Annotated, Any, ClassVar, Self, TypeVar

from fastapi import Request
from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, create_model, field_validator, model_validator

from lighting.errors import OLD_NAMES, SHORT_FORMS, ErrorCode, ParameterError
from lighting.fields import Json, parameter_name
from lighting.files import FileOptions
from lighting.fusion.fspy import read_fspy
from lighting.fusion.user_input import DRAWN_FIELDS, UserInput, check_headings, read_headings
from lighting.light_probe import LIGHT_PROBE_FORMATS
from lighting.map_options import Adjustments, Around, MapOptions, around_of_switches, option_texts
from lighting.photo.reader import MIN_SIDE
from lighting.records import GROUND_ALBEDO, Color, Lighting
from lighting.scene import EXPORTERS, unsupported_options
from lighting.scene.records import PLATE_SIDE
from lighting.sun_study import STEP_RANGE
from server import field_types as types
from server.field_types import InRange, NotNull, RegistryName, field_error, field_errors, parameter_range
from server.problems import FieldError, invalid_error, refuse_repeated

SUN_BY_DEFAULT = "by default if it likely shines"
_DAYLIGHT_EXPOSURE = 4.0  # white ground shows as white under a clear sky's sun of 30 to 35 deg, as in the examples
# Fields of a record whose names mean something else beside a photo: an adjustment, and what is known of its lens.
_EDIT_NAMES = {"exposure": "sky_exposure", "vertical_fov": "camera_vertical_fov"}


_Q = TypeVar("_Q", bound="Query")


class Query(BaseModel):
    """Parameters of a URL; unknown names are refused, short ones are read, and old ones are until 0.4.0."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    old_names: ClassVar[Mapping[str, str]] = {}
    """Old names of these parameters alone, and the new ones."""

    @model_validator(mode="before")
    @classmethod
    def _rename(cls, values: Any) -> Any:
        return cls._with_new_names(dict(values)) if isinstance(values, Mapping) else values

    @classmethod
    def _with_new_names(cls, values: Json) -> Json:
        """The parameters, which this may change, by the names that fields have."""
        names = {field.alias or name for name, field in cls.model_fields.items()}
        for other, name in (OLD_NAMES | SHORT_FORMS | dict(cls.old_names)).items():
            if other in values and name in names:
                if name in values:
                    raise field_error(other, f"is the same as {name}; give one of them", ErrorCode.DUPLICATE)
                values[name] = values.pop(other)
        return values

    def explicit_fields(self) -> set[str]:
        """The parameters with another value than their default, which clients may send, too."""
        fields = type(self).model_fields
        return {name for name in self.model_fields_set if getattr(self, name) != fields[name].default}


class UserInputQuery(Query):
    """What the client states about a photo; it overrides the photo's metadata."""

    metadata: types.Flag = Field(True, description="use the photo's metadata; false uses only the pixels")
    time: types.Time = Field(None, description="when the photo was taken, ISO 8601, with the offset from UTC if known")
    utc_offset: types.Offset = Field(None, description="offset of a local time from UTC in hours, -12 to 14")
    latitude: Annotated[float | None, parameter_range("latitude", "deg, positive north; needs `longitude`", 48.14)] = (
        None
    )
    longitude: Annotated[float | None, parameter_range("longitude", "deg, positive east; needs `latitude`", 11.58)] = (
        None
    )
    heading: Annotated[
        float | None,
        InRange(-360, 360, description="deg from true north, clockwise: where the camera points", examples=[134.2]),
    ] = None
    vertical_fov: Annotated[
        float | None, parameter_range("vertical_fov", "deg, vertical field of view of the upright photo", 48.7)
    ] = None
    camera_height: Annotated[
        float | None, parameter_range("camera_height", "m, of the camera above the ground; by default 1.6", 1.6)
    ] = None
    shadow: str = Field(
        "", description="of one photo: its shadows in pixels, FOOT_X,FOOT_Y,TIP_X,TIP_Y, separated by `;`"
    )
    horizon: str = Field("", description="of one photo: two points of its horizon in pixels, X,Y,X,Y")
    vertical: str = Field(
        "",
        description="of one photo: lines along upright edges in pixels, X,Y,X,Y, separated by `;`; "
        "`level:X,Y,X,Y,X,Y,X,Y` of level edges that are parallel",
    )
    reference: str = Field(
        "", description="of one photo: a thing of known size, X,Y,X,Y,METERS from foot to top; `ground:` if it lies"
    )
    camera: str = Field("", description="of one photo: its camera, as the JSON that fSpy exports", max_length=8192)
    spot: str = Field("", description="of one photo: where an object stands on its ground, in pixels, X,Y")
    keep_location: types.Flag = Field(False, description="put latitude and longitude into the answer")

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
        with field_errors():
            self.user_input()
        return self

    def user_input(self) -> UserInput:
        """The same for the library; raises ParameterError for values that contradict each other."""
        names = [field.name for field in fields(UserInput) if field.name not in DRAWN_FIELDS]
        shadows, verticals = (
            [part for part in text.split(";") if part.strip()] for text in (self.shadow, self.vertical)
        )
        return UserInput(
            shadows=shadows,
            horizon=self.horizon or None,
            verticals=verticals,
            reference=self.reference or None,
            camera=read_fspy(self.camera.encode()) if self.camera else None,
            spot=self.spot or None,
            **{name: getattr(self, parameter_name(name)) for name in names},
        )


class LightingQuery(UserInputQuery):
    """How a photo is estimated, and what the answer includes."""

    probability: types.Flag = Field(False, description="add the sun's probability on its grid")
    surroundings: types.Flag = Field(False, description="add what the place makes of the bare map, cell by cell")
    photo_metadata: types.Flag = Field(
        False, description="add the file's own metadata with its location, to fill in a form"
    )


class DayQuery(UserInputQuery):
    """The day at a photo's place."""

    day: date = Field(alias="date", description="on the calendar of the place", examples=["2026-12-21"])
    every: Annotated[float, InRange(*STEP_RANGE, description="min between two times", examples=[60])] = 60.0


class LightingsQuery(LightingQuery):
    """How several photos are estimated together, and what each answer includes."""

    headings: types.Headings = Field(
        None, description="deg, where each of several photos points, clockwise from any common direction"
    )
    together: types.Flag = Field(True, description="several photos are of one place and light; false: each by itself")
    match: types.Flag = Field(
        True, description="compare several photos' pixels to find how they are turned, unless `headings` tell"
    )

    def heading_values(self) -> list[float] | None:
        """The headings in deg; None if the client states none."""
        return None if self.headings is None else read_headings(self.headings)

    def needs_matching(self, photos: int) -> bool:
        """Whether this number of photos must be matched with each other."""
        return self.match and self.together and self.headings is None and photos > 1


def with_options(record: type, *names: str, without: Collection[str] = ()) -> Callable[[type[_Q]], type[_Q]]:
    """Give a Query a parameter for each option of a record.

    Args:
        record: such as MapOptions.
        names: of the options; none is all.
        without: names of those among all that the Query lacks.
    """
    texts, defaults = option_texts(record), record()
    chosen: Json = {
        name: types.option_parameter(texts[name], getattr(defaults, name))
        for name in names or texts
        if name not in without
    }
    return _with_parameters(chosen)


def _with_parameters(parameters: Json) -> Callable[[type[_Q]], type[_Q]]:
    return lambda query: create_model(query.__name__, __base__=query, __doc__=query.__doc__, **parameters)


class ViewQuery(Query):
    """How a light is shown; parameters that a route lacks are as the library has them."""

    sun: types.FlagOrAuto = Field(None, description=f"paint the sun; {SUN_BY_DEFAULT}")

    def view(self) -> MapOptions:
        """The same for the library."""
        names = option_texts(MapOptions).keys() & type(self).model_fields.keys()
        is_moved = isinstance(self.sun, tuple)  # as AdjustQuery lets it; then it is painted
        return MapOptions(**{name: getattr(self, name) for name in names} | {"sun": is_moved or self.sun})


@with_options(MapOptions, without=("sun", "around", "backdrop"))
@with_options(FileOptions)
class MapQuery(ViewQuery):
    """How a map is rendered and written."""

    @model_validator(mode="after")
    def _check_format_options(self) -> Self:
        with field_errors():
            self.file_options()
        return self

    def file_options(self) -> FileOptions:
        """How the file is written; raises ParameterError where the format does not take that."""
        return FileOptions(**{name: getattr(self, name) for name in option_texts(FileOptions)})


class _IrradianceQuery(Query):
    """Irradiances and colors, which otherwise follow from the sky model or from the photo."""

    sun_irradiance: types.Irradiances = Field(None, description=types.SUN_IRRADIANCE)
    sky_irradiance: types.Irradiances = Field(None, description=types.SKY_IRRADIANCE, validate_default=True)
    sky_cover: Annotated[types.SkyCover | None, NotNull()] = None
    ground_color: types.Reflectances = Field(None, description=types.GROUND_COLOR)

    @field_validator("sky_irradiance")
    @classmethod
    def _check_pair(cls, sky: Any, others: ValidationInfo) -> Any:
        if "sun_irradiance" in others.data and (others.data["sun_irradiance"] is None) != (sky is None):
            raise field_error(None, "sun_irradiance and sky_irradiance go together; give both")
        return sky

    @field_validator("sky_cover")
    @classmethod
    def _check_irradiances(cls, cover: float | None, others: ValidationInfo) -> float | None:
        if cover is not None and others.data.get("sky_irradiance", True) is None:
            raise field_error(None, "needs sky_irradiance and sun_irradiance too")
        return cover


@with_options(Adjustments)
class AdjustQuery(ViewQuery):
    """What a client changes of a light by hand, under the names of the command line and of Python."""

    sun: types.SunOrFlag = Field(  # type: ignore[assignment]  # also moves it
        None,
        description=f"AZIMUTH,ELEVATION in deg moves the sun; false leaves it out; true turns it on; {SUN_BY_DEFAULT}",
    )

    def view(self) -> MapOptions:
        """The same for the library."""
        sun = self.sun if isinstance(self.sun, tuple) else None
        changes = {name: getattr(self, name) for name in option_texts(Adjustments)}
        return replace(super().view(), adjustments=Adjustments(sun, **changes))


class _EditQuery(_IrradianceQuery):
    """Fields of the record that replace the estimate; irradiances that are not among them follow the sky.

    `exposure` and `vertical_fov` once were those of the record. Beside `photo_exposure`, or `vertical_fov` beside
    `fov`, they still are until 0.4.0.
    """

    @classmethod
    def _with_new_names(cls, values: Json) -> Json:
        for name, new in _EDIT_NAMES.items():
            was_edit = "photo_exposure" in values or (name == "vertical_fov" and "fov" in values)
            if was_edit and name in values and new not in values:
                values[new] = values.pop(name)
        return super()._with_new_names(values)

    sun_azimuth: Annotated[types.SunAzimuth | None, NotNull()] = None
    sun_elevation: Annotated[types.SunElevation | None, NotNull()] = None
    turbidity: Annotated[types.Turbidity | None, NotNull()] = None
    sky_exposure: Annotated[types.Exposure | None, NotNull()] = None
    camera_elevation: Annotated[types.CameraElevation | None, NotNull()] = None
    camera_roll: Annotated[types.CameraRoll | None, NotNull()] = None
    camera_vertical_fov: Annotated[
        float | None,
        parameter_range("vertical_fov", "deg; unlike `vertical_fov` it leaves the estimate of the sun as it is", 48.7),
    ] = None
    photo_exposure: Annotated[
        float | None,
        parameter_range("exposure", "the exposure at which the photo is as it is; by default its estimate's", 5.0),
    ] = None

    def changes(self) -> dict[str, float | Color]:
        """The fields of Lighting that the client replaces, by name."""
        values = self.model_dump(include=set(_EditQuery.model_fields) - {"photo_exposure"}, exclude_none=True)
        fields_of = {new: name for name, new in _EDIT_NAMES.items()}
        return {fields_of.get(name, name): value for name, value in values.items()}


@with_options(MapOptions, "around", "backdrop", "sky")
class PlaceQuery(ViewQuery):
    """What the light of a photo shows around it. Until 0.4.0 the switches `surroundings` and `detail` say it, too."""

    @classmethod
    def _with_new_names(cls, values: Json) -> Json:
        old = {name: values.pop(name) for name in ("surroundings", "detail") if name in values}
        if old and "around" in values:
            raise field_error(next(iter(old)), "is an old form of around; give one of them", ErrorCode.DUPLICATE)
        for name, value in old.items():
            if value not in ("true", "false", True, False):
                raise field_error(name, "must be true or false", ErrorCode.WRONG_TYPE)
        switches = {name: value in ("true", True) for name, value in old.items()}
        around = around_of_switches(switches.get("surroundings"), switches.get("detail"), cls._without_detail(values))
        return super()._with_new_names(values | ({"around": around} if around else {}))

    @classmethod
    def _without_detail(cls, _values: Mapping[str, Any]) -> str:
        """What `detail=false` stands for."""
        return Around.PHOTO.value


@with_options(MapOptions, "yaw", "sky")
class ProbeQuery(ViewQuery):
    """A light probe for an engine."""

    old_names: ClassVar[Mapping[str, str]] = {"format": "for"}  # gone in 0.4.0
    tool: Annotated[str, RegistryName(LIGHT_PROBE_FORMATS)] = Field(
        "record", alias="for", description="the engine that takes it; `record` is the record's `light_probe`"
    )


class PreviewQuery(UserInputQuery, AdjustQuery, PlaceQuery):
    """The preview of a photo."""


class PhotoEditQuery(AdjustQuery, PlaceQuery, UserInputQuery, _EditQuery):
    """What is made of a photo's light, which may be edited before."""

    def changes(self) -> dict[str, float | Color]:
        """As of any edit; a sun that is turned on, and whose irradiance is stated, shines."""
        turned_on = self.sun is True and self.sun_irradiance is not None
        return super().changes() | ({"sun_visibility": 1.0} if turned_on else {})


class GroundQuery(UserInputQuery):
    """The mask of a photo's ground."""

    sun: types.FlagOrAuto = Field(None, description=f"whether the ground may lie in direct sunlight; {SUN_BY_DEFAULT}")


class LitSpotQuery(GroundQuery):
    """The point of a photo from which ground in the sun is sought."""

    x: Annotated[float, InRange(0, 1, description="share of the photo's width, from the left", examples=[0.5])]
    y: Annotated[float, InRange(0, 1, description="share of the photo's height, from the top", examples=[0.8])]


class PhotoProbeQuery(PhotoEditQuery, ProbeQuery):
    """The light probe of a photo."""


class EnvmapQuery(PhotoEditQuery, MapQuery):
    """The map of a photo."""


class _SkyParameters(_IrradianceQuery):
    """The parameters of a sky."""

    sun_azimuth: types.SunAzimuth
    sun_elevation: types.SunElevation
    turbidity: types.Turbidity
    exposure: types.Exposure = _DAYLIGHT_EXPOSURE
    ground_albedo: types.GroundAlbedo = GROUND_ALBEDO

    def to_lighting(self) -> Lighting:
        """The lighting with these parameters; raises ParameterError for values that contradict each other."""
        return Lighting(**self.model_dump(include={field.name for field in fields(Lighting)}))


class SkyQuery(MapQuery, _SkyParameters):
    """A sky from parameters alone."""

    sun: types.Flag = Field(True, description="paint the sun's disc")


class SkyProbeQuery(ProbeQuery, _SkyParameters):
    """The light probe of a sky from parameters alone."""

    sun: types.Flag = Field(True, description="include the sun as the main light")


@_with_parameters(
    {
        name: (Annotated[str, RegistryName(option.choices)], Field(option.default, description=f"with `for={tool}`"))
        for tool, entry in EXPORTERS.items()
        for name, option in entry.options.items()
        if option.choices
    }
)
class _ToolQuery(Query):
    tool: Annotated[str, RegistryName(EXPORTERS)] = Field(alias="for", description="the tool that opens it")


@with_options(MapOptions, "height", "sky")
class SceneQuery(ViewQuery, _ToolQuery):
    """The tool that a scene is for, and its options."""

    @model_validator(mode="after")
    def _check_tool_options(self) -> Self:
        if others := unsupported_options(self.explicit_fields(), self.tool):
            reason = " and ".join(f"{name} goes with for={tool}" for name, tool in sorted(others.items()))
            raise field_error(min(others), reason)
        return self

    def options(self) -> Mapping[str, str]:
        """The options that the tool's `encode` takes."""
        return self.model_dump(
            include={name for name, option in EXPORTERS[self.tool].options.items() if option.choices}
        )


class PhotoSceneQuery(PhotoEditQuery, SceneQuery):
    """The scene of a photo."""


class SkySceneQuery(SceneQuery, _SkyParameters):
    """A scene from parameters alone."""

    sun: types.Flag = Field(True, description="include direct sunlight")
    camera_elevation: types.CameraElevation = 0.0
    camera_roll: types.CameraRoll = 0.0
    vertical_fov: types.VerticalFov = 50.0
    plate_width: Annotated[int, InRange(MIN_SIDE, PLATE_SIDE, description="of the picture in pixels")] = 1440
    plate_height: Annotated[int, InRange(MIN_SIDE, PLATE_SIDE, description="of the picture in pixels")] = 1080


async def refuse_duplicates(request: Request) -> None:
    """Raise ProblemError for a URL with a parameter twice.

    Args:
        request: any request.
    """
    refuse_repeated((name for name, _ in request.query_params.multi_items()), "query")


async def refuse_parameters(request: Request) -> None:
    """Raise ProblemError for any parameter in the URL.

    Args:
        request: one of a route that takes none.
    """
    if names := list(request.query_params):
        detail = "is not known here"
        raise invalid_error(*(FieldError(name, "query", detail, ErrorCode.UNKNOWN) for name in names))


def check_photo_headings(photos: int, query: LightingsQuery) -> None:
    """Raise ProblemError if the headings do not fit the number of photos.

    Args:
        photos: the number of photos.
        query: has `headings` of all photos or `heading` of one.
    """
    if query.headings is not None and not query.together:
        detail = "Headings are of photos taken together."
        raise invalid_error(FieldError("headings", "query", detail, ErrorCode.CONTRADICTION))
    try:
        check_headings(photos if query.together else 1, query.heading_values(), query.heading)
    except ParameterError as error:
        raise invalid_error(FieldError(error.field or "headings", "query", str(error), error.code)) from error


def refuse_photo_parameters(query: EnvmapQuery | PhotoProbeQuery) -> None:
    """Raise ProblemError for parameters that describe or need a photo.

    Args:
        query: the parameters of a request with a lighting record instead of a photo.
    """
    for name in (*UserInputQuery.model_fields, *_EditQuery.model_fields, "around"):
        if name in query.explicit_fields():
            detail = "It goes with a photo; a lighting record is rendered as it is."
            raise invalid_error(FieldError(name, "query", detail, ErrorCode.CONTRADICTION))
