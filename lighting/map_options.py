"""Options of environment maps: MapOptions, what adjusts a light by hand, and what people read of each.

The command line, HTTP, batches and Python take their options from here. A field's metadata say what it means, in which
unit and range. Nothing here needs numpy: the command line's help reads it, too.
"""

import reprlib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from numbers import Integral
from typing import Any, Self, TypedDict

from lighting.errors import ErrorCode, ParameterError, warn_of_old_name
from lighting.fields import RANGES, Json, check_range, convert_numpy_numbers, describe_fields
from lighting.sky import SKY_MODELS, format_sky_models

MIN_HEIGHT, MAX_HEIGHT = 16, 8192  # rows of an environment map
MAX_WHOLE_HEIGHT = 4096  # rows, up to which a map is made at once; a taller one by strips, for a file
EXPOSURE_RANGE = (-20.0, 20.0)  # EV, of an adjustment: the range of RANGES["exposure"] by its middle
_SUN_AZIMUTH_RANGE = (-360.0, 360.0)  # deg, of an adjustment; records have -180 to 180


class Around(StrEnum):
    """What a map shows around its photo."""

    PLACE = "place"
    """The photo, and the place around it with detail."""
    PHOTO = "photo"
    """The photo, and a smooth continuation of it."""
    PLAIN = "plain"
    """Sky and ground alone."""


BACKDROPS = ("city", "waterfront", "parking", "garden", "meadow", "forest", "shore", "desert", "mountain", "snow")
"""Kinds of the places whose detail a map shows around its photo."""


Names = Collection[str] | Callable[[], Collection[str]]
"""A registry, which is read when it is asked, so that entries added meanwhile count; or a function that gives one."""


def names_in(registry: Names) -> tuple[str, ...]:
    """Return the names as they are now.

    Args:
        registry: of names, or a function that imports it.
    """
    return tuple(registry() if callable(registry) else registry)


@dataclass(frozen=True)
class OptionText:
    """What people read of an option."""

    help: str | Callable[[], str]
    """A phrase without a full stop; in a field also what makes it of a registry as it is."""
    unit: str = ""
    """As the command line's help names a value."""
    range: tuple[float, float] | None = None
    """Of a number."""
    example: float | None = None
    """Such a number."""
    choices: Names | None = None
    """The names that it takes."""


def option(default: Any, text: OptionText) -> Any:
    """Return a field that is an option.

    Args:
        default: of the field.
        text: what people read of it.
    """
    return field(default=default, metadata={"text": text})


def option_texts(record: type) -> dict[str, OptionText]:
    """Return what people read of the options that a record has, by name; phrases are of registries as they are now.

    Args:
        record: a dataclass.
    """
    texts: dict[str, OptionText] = {f.name: f.metadata["text"] for f in fields(record) if "text" in f.metadata}
    made = {name: replace(text, help=text.help()) for name, text in texts.items() if not isinstance(text.help, str)}
    return texts | made


def check_option(record: type, name: str, value: object) -> None:
    """Raise ParameterError for a value that an option does not take.

    Args:
        record: a dataclass that has the option.
        name: of the option.
        value: of it.
    """
    text: OptionText = next(f for f in fields(record) if f.name == name).metadata["text"]
    if text.range is not None:
        check_range(name, value, *text.range)
    names = None if text.choices is None else names_in(text.choices)
    if names is not None and not (isinstance(value, str) and value in names):
        predicate = f"is {reprlib.repr(value)}; the known ones are {', '.join(names)}."
        raise ParameterError.about(name, predicate, ErrorCode.UNKNOWN)


def _check_options(record: Any, *apart: str) -> None:
    """Raise ParameterError for values that options of a record do not take; None is one that is left open."""
    for each in fields(record):
        if "text" in each.metadata and each.name not in apart and (value := getattr(record, each.name)) is not None:
            check_option(type(record), each.name, value)


@dataclass(frozen=True)
class Adjustments:
    """What a user changes of a light by hand, under the same names everywhere. None: as it was.

    Raises ParameterError for a value out of range.
    """

    sun: tuple[float, float] | None = None
    """Azimuth, -360 to 360, and elevation, -4.2 to 90, deg."""
    exposure: float = option(0.0, OptionText("EV; 1 is twice as bright", "EV", EXPOSURE_RANGE, 0.5))
    """EV, -20 to 20: +1 is twice as bright."""
    haze: float | None = option(
        None, OptionText("turbidity: 2 is clear, 10 is hazy", "TURBIDITY", RANGES["turbidity"], 3.4)
    )
    """Turbidity, 1 to 10: 2 is very clear, 10 is hazy."""
    overcast: bool = option(False, OptionText("cover the sky with clouds: no sun, soft gray light"))
    """True covers the sky, and no sun shines."""
    pick: int | None = option(
        None,
        OptionText(
            "use this one of the suns that the answer lists: 2 or 3 in place of the first", "N", choices=("1", "2", "3")
        ),
    )
    """Number, 1 to 3, of the sun in `Lighting.sun_candidates` that shines; also as a text. None: the answer's."""

    def __post_init__(self) -> None:
        convert_numpy_numbers(self, "sun", "exposure", "haze", "pick")
        if self.sun is not None:
            if not isinstance(self.sun, tuple) or len(self.sun) != 2:
                predicate = "must be two numbers: azimuth and elevation."
                raise ParameterError.about("sun", predicate, ErrorCode.WRONG_TYPE)
            check_range("sun", self.sun[0], *_SUN_AZIMUTH_RANGE, subject="The sun's azimuth")
            check_range("sun", self.sun[1], *RANGES["sun_elevation"], subject="The sun's elevation")
        _check_options(self, "pick")
        _check_flag("overcast", self.overcast)
        if self.pick is not None:
            check_option(Adjustments, "pick", str(self.pick))
            object.__setattr__(self, "pick", int(self.pick))
            if self.sun is not None:
                raise ParameterError.about(
                    "pick", "chooses a sun, and sun sets one: give one of them.", ErrorCode.CONTRADICTION
                )


class MapKeywords(TypedDict, total=False):
    """The fields of MapOptions but the height, as keywords; and two that `around` replaces, until 0.4.0."""

    sun: bool | None
    yaw: float
    sky: str | None
    around: str | None
    backdrop: str | None
    disc: bool
    adjustments: Adjustments
    surroundings: bool | None
    detail: bool | None


@dataclass(frozen=True)
class MapOptions:
    """How an environment map of a light is rendered. A value out of range is a ParameterError."""

    height: int = option(
        512, OptionText("rows of the map, even; columns are twice that", "ROWS", (MIN_HEIGHT, MAX_HEIGHT), 512)
    )
    """Rows of the map, even, 16 to 8192; of previews, scenes, days and clips up to 4096."""
    sun: bool | None = option(None, OptionText("paint the sun; by default if it likely shines"))
    """Whether the sun is in the map; True also turns on one that did not shine. None: by `Lighting.sun_painted`."""
    yaw: float = option(
        0.0, OptionText("turn the map, with sun and record, to the right", "DEG", (-360.0, 360.0), 90.0)
    )
    """Deg, -360 to 360, by which the map is turned to the right, and the record with it."""
    sky: str | None = option(
        None,
        OptionText(
            lambda: f"the sky's shape: {format_sky_models(' or ')}, which are advanced", "MODEL", choices=SKY_MODELS
        ),
    )
    """One of `lighting.sky.SKY_MODELS`, which paints the sky. None: the record's."""
    around: str | None = option(
        None,
        OptionText(
            "around the photo: the place with its detail, the photo alone and smoothly on, or plain sky and ground; "
            "by default the place, where the network predicts it",
            "NAME",
            choices=tuple(kind.value for kind in Around),
        ),
    )
    """One of Around. None: "place" where the network predicts it, else "plain"."""
    backdrop: str | None = option(
        None, OptionText("the kind of place around the photo; by default what suits it", "NAME", choices=BACKDROPS)
    )
    """One of BACKDROPS, of which the detail around the photo is. None: what suits the photo."""
    disc: bool = option(True, OptionText("paint the sun's disc; without it the sun still lights the ground"))
    """False leaves the sun's disc for a light of its own; the sun still lights the ground."""
    adjustments: Adjustments = field(default_factory=Adjustments)
    """Of the light by hand, before it is rendered."""

    def __post_init__(self) -> None:
        _check_flag("sun", self.sun, None)
        _check_flag("disc", self.disc)
        check_height(self.height)
        convert_numpy_numbers(self, "yaw", "height")
        if isinstance(self.around, Around):
            object.__setattr__(self, "around", self.around.value)
        _check_options(self)
        if self.backdrop is not None and self.around not in (None, Around.PLACE.value):
            predicate = f'is for around "place", not "{self.around}".'
            raise ParameterError.about("backdrop", predicate, ErrorCode.CONTRADICTION)
        if not isinstance(self.adjustments, Adjustments):
            raise ParameterError.wrong_type("adjustments", "Adjustments", self.adjustments)

    @classmethod
    def of_keywords(cls, height: Any, keywords: Mapping[str, object]) -> Self:
        """Make the options of a call.

        Args:
            height: rows of the map.
            keywords: the other options, as MapKeywords; old ones warn.
        """
        values: Json = {**keywords}
        switches = {name: values.pop(name, None) for name in ("surroundings", "detail")}
        for name, value in switches.items():
            _check_flag(name, value, None)
            if value is not None:
                warn_of_old_name(f"lighting.MapOptions.{name}", stacklevel=4)
        if (around := around_of_switches(**switches)) is not None:
            values.setdefault("around", around)
        return cls(height, **values)

    @classmethod
    def of_json(cls, values: Json) -> Self:
        """Make options of an object of JSON, such as `dataclasses.asdict` makes.

        Args:
            values: by name.
        """
        stated = dict(values.get("adjustments") or {})
        sun = stated.get("sun")
        adjustments = Adjustments(**{**stated, "sun": sun and tuple(sun)})
        return cls(**{**values, "adjustments": adjustments})

    def of_record(self) -> Self:
        """Return the options without what is of a map alone: its turn, and the sky that it paints."""
        return replace(self, yaw=0.0, sky=None)

    def refuse(self, thing: str, *names: str) -> None:
        """Raise ParameterError for options that say nothing of a thing.

        Args:
            thing: such as "a preview".
            names: of the options.
        """
        for name in names:
            if getattr(self, name) != getattr(DEFAULT_MAP, name):
                raise ParameterError.about(name, f"is of maps; {thing} takes none.", ErrorCode.CONTRADICTION)


def around_of_switches(
    surroundings: bool | None, detail: bool | None, without_detail: str = Around.PHOTO.value
) -> str | None:
    """Return what `around` is by the two switches that it replaces; None where they leave it open.

    Args:
        surroundings: whether the map shows the place; None: not stated.
        detail: whether it then has detail; None: not stated.
        without_detail: what `detail` False stands for: of clips it was Around.PLAIN.
    """
    if surroundings is False:
        return Around.PLAIN.value
    if detail is False:
        return without_detail
    return Around.PLACE.value if surroundings else None


def check_height(height: int, most: int = MAX_HEIGHT) -> None:
    """Raise ParameterError for what is no number of rows of a map.

    Args:
        height: even, 16 to `most`.
        most: rows, up to 8192.
    """
    whole = isinstance(height, Integral) and not isinstance(height, bool)
    if not whole or height % 2 or not MIN_HEIGHT <= height <= most:
        predicate = f"is {height!r}; it must be an even number from {MIN_HEIGHT} to {most}."
        raise ParameterError.about("height", predicate, ErrorCode.OUT_OF_RANGE if whole else ErrorCode.WRONG_TYPE)


def _check_flag(name: str, value: object, *others: None) -> None:
    """Raise ParameterError for what is neither True nor False, nor another value that counts."""
    if isinstance(value, bool) or value in others or type(value).__name__ in ("bool", "bool_"):
        return
    hint = "; adjustments move it" if name == "sun" else ""
    predicate = f"must be True or False, not {reprlib.repr(value)}{hint}."
    raise ParameterError.about(name, predicate, ErrorCode.WRONG_TYPE)


def parse_sun(text: str) -> tuple[float, float]:
    """Read a sun's direction such as "40,25"; its range is checked by `Adjustments`.

    Args:
        text: azimuth and elevation in deg, with a comma between them.

    Raises:
        ParameterError: for any other text.
    """
    try:
        azimuth, elevation = map(float, text.split(","))
    except ValueError as error:
        predicate = f"is AZIMUTH,ELEVATION in degrees, such as 40,25, not {text!r}."
        raise ParameterError.about("sun", predicate, ErrorCode.MALFORMED) from error
    return azimuth, elevation


describe_fields(Adjustments, MapOptions)
DEFAULT_MAP = MapOptions()
