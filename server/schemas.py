"""The models of requests and answers behind the OpenAPI document, with units and ranges."""

from collections.abc import Callable
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ValidationError,
    WithJsonSchema,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from lighting.records import COLOUR_RANGES, GROUND_ALBEDO, MIN_HEIGHT, OPTIONAL_RANGES, RANGES, Lighting
from lighting.sky import Model as SkyModel

MAX_HEIGHT = 2048  # rows; rendering that many takes about 0.5 GB

Format = Literal["exr", "hdr", "png"]
MEDIA_TYPES: dict[Format, str] = {"exr": "image/x-exr", "hdr": "image/vnd.radiance", "png": "image/png"}


class Between:
    """A number must lie in [low, high]; the error for any other value states that range."""

    def __init__(self, low: float, high: float, **documented: Any) -> None:
        self.limits = {"minimum": low, "maximum": high}  # also members of the error
        self.documented = documented

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_wrap_validator_function(self._check, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        plain = handler(schema)
        plain = plain.get("anyOf", [plain])[0]  # a parameter that may be left out is never null
        return {**plain, **self.limits, **self.documented}

    def _check(self, value: Any, parse: Callable[[Any], float]) -> float:
        try:
            number = parse(value)
        except ValidationError:
            number = float("nan")
        if self.limits["minimum"] <= number <= self.limits["maximum"]:
            return number
        low, high = self.limits.values()
        raise PydanticCustomError("range", f"must be a number from {low:g} to {high:g}", self.limits)


def named(name: str, meaning: str, example: float) -> Between:
    """The range of a parameter in RANGES or OPTIONAL_RANGES, with its documentation."""
    return Between(*(RANGES | OPTIONAL_RANGES)[name], description=meaning, examples=[example])


def _even(number: int) -> int:
    if number % 2:
        raise PydanticCustomError("even", "must be an even number")
    return number


def _flag(value: object) -> object:
    """Accept only `true` and `false`, as the OpenAPI document says."""
    if isinstance(value, str):
        if value not in ("true", "false"):
            raise PydanticCustomError("flag", "must be true or false")
        return value == "true"
    return value


Flag = Annotated[bool, BeforeValidator(_flag)]
FlagOrAuto = Annotated[bool | None, BeforeValidator(_flag), WithJsonSchema({"type": "boolean"})]
Height = Annotated[
    int,
    Between(MIN_HEIGHT, MAX_HEIGHT, multipleOf=2, description="rows of the map, even; columns are twice that"),
    AfterValidator(_even),
]

SunAzimuth = Annotated[float, named("sun_azimuth", "deg, 0 = where the camera points, positive to the right", -41.2)]
SunElevation = Annotated[float, named("sun_elevation", "deg above the horizon", 33.0)]
Turbidity = Annotated[float, named("turbidity", "Linke turbidity: 2 is very clear, 10 is hazy", 3.4)]
Exposure = Annotated[float, named("exposure", "factor from sky radiance to the photo's linear values", 5.0)]
GroundAlbedo = Annotated[float, named("ground_albedo", "of the ground that the sky lights", GROUND_ALBEDO)]


SkyCover = Annotated[float, named("sky_cover", "0 clear, 1 overcast; needs both irradiances", 0.2)]
Irradiance = Annotated[float, Between(*COLOUR_RANGES["sky_irradiance"])]
Reflectance = Annotated[float, Between(*COLOUR_RANGES["ground_color"])]
SUN_IRRADIANCE = "red, green, blue of a surface that faces the sun, in the photo's linear units"
SKY_IRRADIANCE = "red, green, blue of open level ground by the sky without the sun, in the photo's linear units"
GROUND_COLOR = "red, green, blue: the ground's reflectance; unknown, `ground_albedo` counts, or 0.12 with irradiances"


def three(meaning: str, example: list[float]) -> Any:
    """The default of a field of three numbers that may be absent, with its documentation."""
    return Field(None, min_length=3, max_length=3, description=meaning, examples=[example])


LINK = "/v1/envmap?sun_azimuth=-41.2&sun_elevation=33.0&turbidity=3.4&exposure=5.0&ground_albedo=0.3&sun=true"


class Part(BaseModel):
    """A part of a lighting record; other fields than these are ignored."""

    model_config = ConfigDict(strict=True, extra="ignore")


class ModelPart(Part):
    name: str = "none"
    version: str = "0"


class SunPart(Part):
    azimuth: SunAzimuth
    elevation: SunElevation
    direction: list[float] = Field([], description="unit vector towards the sun; computed from the angles")
    visibility: Annotated[float, named("sun_visibility", "probability of direct sunlight on the scene", 0.93)] = 1.0
    irradiance: list[Irradiance] | None = three(SUN_IRRADIANCE, [1.9, 1.7, 1.4])
    radius_50: Annotated[
        float, named("radius_50", "deg, radius around the sun that holds 50 % of the probability", 9.5)
    ] = 0.0
    radius_90: Annotated[
        float, named("radius_90", "deg, radius around the sun that holds 90 % of the probability", 31.0)
    ] = 0.0


class SkyPart(Part):
    model: SkyModel = "hosek-wilkie"
    turbidity: Turbidity
    irradiance: list[Irradiance] | None = three(SKY_IRRADIANCE, [0.5, 0.6, 0.9])
    cover: SkyCover | None = None
    ground_albedo: GroundAlbedo = GROUND_ALBEDO
    exposure: Exposure
    coefficients: dict[str, list[float]] = Field(
        {}, description="nine per channel and the radiance of each channel; computed from the other fields"
    )


class GroundPart(Part):
    color: list[Reflectance] | None = three(GROUND_COLOR, [0.14, 0.13, 0.11])


class CameraPart(Part):
    elevation: Annotated[float, named("camera_elevation", "deg, positive looks up", 4.1)] = 0.0
    roll: Annotated[float, named("camera_roll", "deg, positive turns the camera clockwise", -0.6)] = 0.0
    vertical_fov: Annotated[float, named("vertical_fov", "deg, vertical field of view", 48.7)] = 50.0
    heading: Annotated[float, named("camera_heading", "deg from true north, clockwise", 134.2)] | None = Field(
        None, description="only where time and place are known"
    )
    heading_radius_50: (
        Annotated[float, named("camera_heading_radius_50", "deg, half the width of the range that holds 50 %", 8.0)]
        | None
    ) = None
    heading_radius_90: (
        Annotated[float, named("camera_heading_radius_90", "deg, half the width of the range that holds 90 %", 21.0)]
        | None
    ) = None
    heading_probability: list[Annotated[float, Between(0.0, 1.0)]] | None = Field(
        None, min_length=360, max_length=360, description="of each whole degree from true north"
    )
    relative_heading: Annotated[float, Between(*OPTIONAL_RANGES["relative_heading"])] | None = Field(
        None, description="clockwise from the first of several photos whose headings are unknown"
    )


class PlacePart(Part):
    """Where the photo was taken; present only if the client set `keep_location`."""

    latitude: Annotated[float, named("latitude", "deg, positive north", 48.14)] | None = None
    longitude: Annotated[float, named("longitude", "deg, positive east", 11.58)] | None = None


class LightingRecord(Part):
    """The light of one photo and the camera that took it."""

    model: ModelPart = ModelPart()
    sun: SunPart
    sky: SkyPart
    ground: GroundPart | None = None
    suitable: (
        Annotated[float, named("suitable", "probability that it is a photo of outdoors by daylight", 0.99)] | None
    ) = None
    camera: CameraPart = CameraPart()
    evidence: list[str] = Field(
        [],
        description="the sources that the estimate uses",
        examples=[["pixels", "time+place", "heading", "focal length", "gravity"]],
    )
    warnings: list[str] = Field([], description="sentences, mostly about metadata that contradict the pixels")
    place: PlacePart | None = None

    def lighting(self) -> Lighting:
        """The record as the library's Lighting; raises ParameterError."""
        return Lighting.from_dict(self.model_dump(exclude={"sun": {"direction"}, "sky": {"coefficients"}}))


class Links(BaseModel):
    envmap: str = Field(description="link to the environment map of this light", examples=[LINK])


class SunProbability(BaseModel):
    """The probability of each cell of the sun grid; the lists are in the order of the cells."""

    grid: str = Field(examples=["fibonacci:1024"])
    azimuth: list[float] = Field(description="deg")
    elevation: list[float] = Field(description="deg")
    probability: list[float] = Field(description="sums to 1")


class SurroundingsRecord(BaseModel):
    """What the place makes of the bare map beside the photo's view, by cells of equal angles.

    The first row of cells looks up; a row's first cell is at azimuth -180 deg.
    """

    rows: int = Field(examples=[24])
    columns: int = Field(examples=[48])
    factors: list[tuple[float, float, float]] = Field(description="on the bare map's RGB, row by row")


class LightingEstimate(LightingRecord):
    links: Links
    probability: SunProbability | None = Field(None, description="present only if the request set `probability`")
    surroundings: SurroundingsRecord | None = Field(
        None, description="present only if the request set `surroundings` and the network says what lies around"
    )


class LightingEstimates(BaseModel):
    """The light of several photos of one place, each in its own camera's frame, in the order of the photos."""

    lightings: list[LightingEstimate] = Field(min_length=2)


class Accuracy(BaseModel):
    """Errors over test crops, in degrees; those of the sun over crops whose sun is known."""

    crops: int = Field(description="number of crops whose sun is known")
    sun_median: float
    sun_quartile_1: float
    sun_quartile_3: float
    sun_azimuth_median: float
    sun_elevation_median: float
    camera_elevation_median: float
    camera_roll_median: float
    vertical_fov_median: float
    turbidity_median: float
    exposure_median: float = Field(description="in stops")
    within_22_5: float = Field(description="share of suns nearer than 22.5 deg [%]")
    within_45: float = Field(description="share of suns nearer than 45 deg [%]")
    in_50_region: float = Field(description="share of suns inside the 50 % region [%]")
    in_90_region: float = Field(description="share of suns inside the 90 % region [%]")


class ModelCard(BaseModel):
    """The network that answers."""

    name: str = Field(examples=["outdoor"])
    version: str = Field(examples=["1.0.0"])
    licence: str = Field(examples=["Apache-2.0"])
    grid: str = Field(examples=["fibonacci:1024"])
    accuracy: dict[str, Accuracy] = Field(
        description="by evaluation protocol; empty for a network without published figures"
    )
    matching: bool = Field(
        description="whether this service finds by what several photos show in common how they are turned"
    )


class FieldError(BaseModel):
    field: str
    place: Literal["query", "form", "body"] = Field(description="where the field stands: in the URL or in the body")
    detail: str
    minimum: float | None = None
    maximum: float | None = None


class Problem(BaseModel):
    """What went wrong (RFC 9457)."""

    type: str = Field(examples=["tag:outdoor-lighting,2026:invalid"])
    title: str = Field(examples=["A parameter is missing, unknown or out of range"])
    status: int = Field(examples=[422])
    detail: str
    instance: str = Field(examples=["/v1/lighting"])
    request_id: str = Field(examples=["4d1c0a6f5e2b7398"])
    errors: list[FieldError] = Field([], description="the invalid fields, with their ranges")


class Status(BaseModel):
    status: Literal["ok"] = "ok"
