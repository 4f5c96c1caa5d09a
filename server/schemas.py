"""The models of records and answers behind the OpenAPI document."""

from typing import Annotated, Any, Literal

from pydantic import AwareDatetime, BaseModel, ConfigDict, FailFast, Field

from lighting.errors import WarningCode
from lighting.fields import OPTIONAL_RANGES
from lighting.files import MAP_FORMATS
from lighting.fusion.instants import OTHER_PHOTOS, USER
from lighting.fusion.time_zones import OFFSET_RULES, ZONE_OF_PLACE
from lighting.geometry import EYE_HEIGHT
from lighting.records import GROUND_ALBEDO, EvidenceKind, Lighting, Trust
from lighting.scene import EXPORTERS
from lighting.sky import SKY_MODEL, SKY_MODELS
from server import field_types as types
from server.field_types import InRange, RegistryName, parameter_range
from server.problems import FieldError


def _rgb_field(meaning: str, example: list[float]) -> Any:
    """The default of an optional field of three numbers, with its documentation."""
    return Field(None, min_length=3, max_length=3, description=meaning, examples=[example])


# Of a list of any length only the first wrong item is named: half a million would take a second.
_SkyName = Annotated[str, RegistryName(SKY_MODELS)]
_Numbers = Annotated[list[float], FailFast()]
_Texts = Annotated[list[str], FailFast()]

_LINK = "envmap?sun_azimuth=-41.2&sun_elevation=33.0&turbidity=3.4&exposure=5.0&ground_albedo=0.3&sun=true"


class _Part(BaseModel):
    """A part of a lighting record; other fields than these are ignored."""

    model_config = ConfigDict(strict=True, extra="ignore")


class LightingRecord(_Part):
    """The light of one photo and the camera that took it."""

    class ModelPart(_Part):
        name: str = "none"
        version: str = "0"

    class SunPart(_Part):
        class CandidatePart(_Part):
            """One of the suns that the answer thinks possible."""

            azimuth: types.SunAzimuth
            elevation: types.SunElevation
            probability: Annotated[float, InRange(0.0, 1.0)] = Field(
                description="that lies nearer to it than to others"
            )

        azimuth: types.SunAzimuth
        elevation: types.SunElevation
        direction: _Numbers = Field([], description="unit vector towards the sun; computed from the angles")
        visibility: Annotated[
            float, parameter_range("sun_visibility", "probability of direct sunlight on the scene", 0.93)
        ] = 1.0
        irradiance: list[types.Irradiance] | None = _rgb_field(types.SUN_IRRADIANCE, [1.9, 1.7, 1.4])
        radius_50: Annotated[
            float, parameter_range("radius_50", "deg, radius around the sun that holds 50 % of the probability", 9.5)
        ] = 0.0
        radius_90: Annotated[
            float, parameter_range("radius_90", "deg, radius around the sun that holds 90 % of the probability", 31.0)
        ] = 0.0
        candidates: list[CandidatePart] = Field(
            [], max_length=3, description="the answer first, then the likeliest suns at least 40 deg from it"
        )

    class SkyPart(_Part):
        class CoefficientsPart(_Part):
            """The sky's nine coefficients of each channel, and the radiance of each."""

            r: _Numbers = []
            g: _Numbers = []
            b: _Numbers = []
            radiance: _Numbers = []

        model: _SkyName = SKY_MODEL
        painted: _SkyName | None = Field(None, description="what paints the sky of maps, where it is another model")
        turbidity: types.Turbidity
        irradiance: list[types.Irradiance] | None = _rgb_field(types.SKY_IRRADIANCE, [0.5, 0.6, 0.9])
        cover: types.SkyCover | None = None
        ground_albedo: types.GroundAlbedo = GROUND_ALBEDO
        exposure: types.Exposure
        coefficients: CoefficientsPart = Field(default_factory=CoefficientsPart, description="computed from the others")

    class GroundPart(_Part):
        class SpotPart(_Part):
            """Where an object may stand."""

            pixel: Annotated[list[float], Field(min_length=2, max_length=2)] = Field(
                description="(x, y) in the upright photo", examples=[[1012.5, 1140.0]]
            )
            direction: Annotated[list[float], Field(min_length=3, max_length=3)] = Field(
                description="unit vector from the camera", examples=[[0.02, -0.31, -0.95]]
            )

        color: list[types.Reflectance] | None = _rgb_field(types.GROUND_COLOR, [0.14, 0.13, 0.11])
        visible: (
            Annotated[
                float, parameter_range("ground_visible", "share of the photo that shows firm, level ground", 0.31)
            ]
            | None
        ) = None
        spot: SpotPart | None = Field(None, description="null where the photo shows no ground for an object")

    class CameraPart(_Part):
        elevation: types.CameraElevation = 0.0
        roll: types.CameraRoll = 0.0
        vertical_fov: types.VerticalFov = 50.0
        height: Annotated[float, parameter_range("camera_height", "m above the ground", 1.6)] = EYE_HEIGHT
        heading: Annotated[float, parameter_range("camera_heading", "deg from true north, clockwise", 134.2)] | None = (
            Field(None, description="only where time and place are known")
        )
        heading_radius_50: (
            Annotated[
                float,
                parameter_range("camera_heading_radius_50", "deg, half the width of the range that holds 50 %", 8.0),
            ]
            | None
        ) = None
        heading_radius_90: (
            Annotated[
                float,
                parameter_range("camera_heading_radius_90", "deg, half the width of the range that holds 90 %", 21.0),
            ]
            | None
        ) = None
        heading_probability: list[Annotated[float, InRange(0.0, 1.0)]] | None = Field(
            None, min_length=360, max_length=360, description="of each whole degree from true north"
        )
        relative_heading: Annotated[float, InRange(*OPTIONAL_RANGES["relative_heading"])] | None = Field(
            None, description="clockwise from the first of several photos whose headings are unknown"
        )

    class PlacePart(_Part):
        """Where the photo was taken; present only if the client set `keep_location`."""

        latitude: Annotated[float, parameter_range("latitude", "deg, positive north", 48.14)] | None = None
        longitude: Annotated[float, parameter_range("longitude", "deg, positive east", 11.58)] | None = None

    class TimePart(_Part):
        """When the photo was taken, as the answer believes; absent where no zone is known."""

        utc: AwareDatetime | None = Field(None, strict=False, description="in UTC", examples=["2024-06-01T16:49:00Z"])
        utc_offset: Annotated[float, parameter_range("utc_offset", "h, local minus universal time", 2.0)] | None = None
        source: str | None = Field(
            None,
            description=f"{USER}, {', '.join(OFFSET_RULES)}, {OTHER_PHOTOS}, or {ZONE_OF_PLACE}",
            examples=["offset in the file"],
        )

    model: ModelPart = ModelPart()
    sun: SunPart
    sky: SkyPart
    ground: GroundPart | None = None
    suitable: (
        Annotated[float, parameter_range("suitable", "probability that it is a photo of outdoors by daylight", 0.99)]
        | None
    ) = None
    camera: CameraPart = CameraPart()
    trust: Annotated[Trust, Field(strict=False)] | None = Field(
        None, description="sure, unsure or no sun; computed from the others", examples=["sure"]
    )
    evidence: _Texts = Field(
        [],
        description="the sources that the estimate uses",
        examples=[[kind.value for kind in tuple(EvidenceKind)[:6]]],
    )
    warnings: _Texts = Field([], description="sentences, mostly about metadata that contradict the pixels")
    place: PlacePart | None = None
    time: TimePart | None = None

    def to_lighting(self) -> Lighting:
        """The record as the library's Lighting; raises ParameterError."""
        return Lighting.from_dict(self.model_dump(exclude={"sun": {"direction"}, "sky": {"coefficients"}}))


class LightingEstimate(LightingRecord):
    class LightProbePart(BaseModel):
        """The light for engines and phones: all but the sun as spherical harmonics, and the sun as the main light."""

        class MainLightPart(BaseModel):
            """The sun as a directional light."""

            direction: list[float] = Field(description="unit vector towards it", examples=[[-0.55, 0.54, -0.63]])
            irradiance: list[float] = Field(
                description="RGB of a surface that faces it; zeros where no sun reaches the scene"
            )
            lux: float = Field(description="lx of such a surface, good to a factor of two", examples=[81500.0])
            kelvin: float | None = Field(
                description="its correlated color temperature; null of no light", examples=[5420]
            )

        coefficients: list[tuple[float, float, float]] = Field(
            min_length=9, max_length=9, description="RGB of radiance, in the order and basis of WebXR and three.js"
        )
        main_light: MainLightPart

    class Links(BaseModel):
        envmap: str = Field(
            description="link to the environment map of this light, relative to this request's URL", examples=[_LINK]
        )

    class CropRecord(BaseModel):
        """The photo inside a border, in pixels of the upright picture: camera, spot and maps are of this part alone."""

        left: int = Field(examples=[0])
        top: int = Field(examples=[131])
        width: int = Field(description="of the photo", examples=[1920])
        height: int = Field(examples=[818])
        picture_width: int = Field(description="of the whole picture", examples=[1920])
        picture_height: int = Field(examples=[1080])

    class SunProbability(BaseModel):
        """The probability of each cell of the sun grid; the lists are in the order of the cells."""

        grid: str = Field(examples=["fibonacci:1024"])
        azimuth: list[float] = Field(description="deg")
        elevation: list[float] = Field(description="deg")
        probability: list[float] = Field(description="sums to 1")

    class PhotoMetadataRecord(BaseModel):
        """What a photo's file says of itself; what it does not say, or what cannot be true, is absent."""

        time: str | None = Field(None, description="local, ISO 8601", examples=["2024-06-01T18:49:00"])
        utc_offset: float | None = Field(None, description="h, of that time from UTC", examples=[2.0])
        gps_time: AwareDatetime | None = Field(None, description="by the satellites", examples=["2024-06-01T16:49:00Z"])
        latitude: float | None = Field(None, description="deg, positive north", examples=[48.14])
        longitude: float | None = Field(None, description="deg, positive east", examples=[11.58])
        heading: float | None = Field(None, description="deg, clockwise from `heading_reference`", examples=[134.2])
        heading_reference: Literal["true", "magnetic"] | None = Field(None, description="the north of the heading")
        focal_length: float | None = Field(None, description="mm, of a 35 mm camera", examples=[26.0])
        vertical_fov: float | None = Field(None, description="deg, of the upright photo", examples=[48.7])
        camera_elevation: float | None = Field(None, description="deg, positive looks up", examples=[4.1])
        camera_roll: float | None = Field(None, description="deg, positive is clockwise", examples=[-0.6])
        camera_height: float | None = Field(None, description="m above the ground", examples=[42.0])
        orientation: int | None = Field(None, description="1 to 8, how the pixels lie in the file", examples=[6])

    class SurroundingsRecord(BaseModel):
        """What the place makes of the bare map beside the photo's view, by cells of equal angles.

        The first row of cells looks up; a row's first cell is at azimuth -180 deg.
        """

        rows: int = Field(examples=[24])
        columns: int = Field(examples=[48])
        factors: list[tuple[float, float, float]] = Field(description="on the bare map's RGB, row by row")

    light_probe: LightProbePart
    links: Links
    crop: CropRecord | None = Field(None, description="present only if the photo lies inside a border")
    warning_codes: _Texts = Field(
        [],
        description="what each of the `warnings` is about, in their order; absent where there are none",
        json_schema_extra={"items": {"type": "string", "enum": [code.value for code in WarningCode]}},
    )
    probability: SunProbability | None = Field(None, description="present only if the request set `probability`")
    photo_metadata: PhotoMetadataRecord | None = Field(
        None, description="present only if the request set `photo_metadata`"
    )
    surroundings: SurroundingsRecord | None = Field(
        None, description="present only if the request set `surroundings` and the network says what lies around"
    )


class LightingEstimates(BaseModel):
    """The light of several photos of one place, each in its own camera's frame, in the order of the photos."""

    lightings: list[LightingEstimate] = Field(min_length=1)


class DayLight(BaseModel):
    """The light of a day at a photo's place, while the sun is up."""

    class Hour(BaseModel):
        time: AwareDatetime = Field(description="on the clock of the place", examples=["2026-12-21T12:00:00+01:00"])
        lighting: LightingRecord

    hours: list[Hour] = Field(min_length=1)
    warnings: _Texts = Field(description="what is a guess, and how sure the heading is")


class LitSpot(BaseModel):
    """Where an object would stand in the sun."""

    spot: Annotated[list[float], Field(min_length=2, max_length=2)] | None = Field(
        description="in shares of the photo's width, from the left, and height, from the top; null where there is none",
        examples=[[0.53, 0.81]],
    )


class ModelCard(BaseModel):
    """The network that answers."""

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
    jobs: bool = Field(description="whether this service takes long jobs, whose uploads it keeps until they end")
    scene_tools: list[str] = Field(description="values of `tool`", examples=[list(EXPORTERS)])
    scene_labels: dict[str, str] = Field(description="their names, as people write them, by values of `tool`")
    sky_models: list[str] = Field(description="values of `sky`", examples=[list(SKY_MODELS)])
    map_formats: list[str] = Field(description="values of `format`", examples=[list(MAP_FORMATS)])


class Problem(BaseModel):
    """What went wrong (RFC 9457)."""

    type: str = Field(examples=["tag:outdoor-lighting,2026:invalid"])
    title: str = Field(examples=["A parameter is missing, unknown or out of range"])
    status: int = Field(examples=[422])
    detail: str
    instance: str = Field(examples=["/v1/lighting"])
    request_id: str = Field(examples=["4d1c0a6f5e2b7398"])
    errors: list[FieldError] = Field([], description="the invalid fields, with their ranges")


class JobRecord(BaseModel):
    """A job and where it is on its way."""

    class JobLinks(BaseModel):
        self: str = Field(
            description="of this record, relative to this request's URL", examples=["jobs/0PzMZlz5QyxYyh4sHUhXrQ"]
        )
        result: str | None = Field(None, description="of the ZIP; present once the job has finished")

    id: str = Field(description="secret: who knows it may read the result", examples=["0PzMZlz5QyxYyh4sHUhXrQ"])
    kind: str = Field(examples=["video"])
    state: Literal["queued", "running", "finished", "failed"]
    progress: float = Field(description="part that is done, 0 to 1", examples=[0.42])
    created: AwareDatetime
    expires: AwareDatetime | None = Field(None, description="when the job is forgotten; present once it has ended")
    warnings: list[str] = Field([], description="sentences about the result")
    error: str | None = Field(None, description="why it failed")
    code: str | None = Field(None, description="the same for programs")
    links: JobLinks


class Status(BaseModel):
    status: Literal["ok"] = "ok"
