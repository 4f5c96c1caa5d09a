"""What is gathered of a clip while it is read, and what is known beside its pixels."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import timedelta

from lighting.evidence import Given, Known, camera_evidence, known, known_later
from lighting.geometry import Floats
from lighting.photo import PhotoFacts
from lighting.photo.exif import HeadingReference
from lighting.records import Prediction
from lighting.video.follow import Key, Step
from lighting.video.telemetry import Gimbal


@dataclass(frozen=True, eq=False)
class Seen:
    """What one frame shows by itself."""

    prediction: Prediction  # its sky in the colour that the frame shows
    ground: Floats | None = None  # (3,) reflectance, where the frame shows enough of it
    by_lens: "Seen | None" = None  # the same by a camera with the clip's known lens, where it has one


@dataclass(frozen=True, eq=False)
class Watched:
    """What was gathered of a clip, or of one shot of it."""

    size: tuple[int, int]  # width and height of the frames, pixels
    steps: Sequence[Step]  # one a frame
    keys: dict[int, Key]  # by number
    looks: dict[int, Seen]  # by the frame's index

    def through_known_lens(self) -> "Watched":
        """The same where the lens that is known is that of all frames: it was not zoomed."""
        return replace(self, looks={frame: seen.by_lens or seen for frame, seen in self.looks.items()})


@dataclass(frozen=True, eq=False)
class Circumstances:
    """What is known of a clip beside its pixels."""

    facts: PhotoFacts = field(default_factory=PhotoFacts)  # of the clip's first moment
    gimbal: Gimbal = field(default_factory=Gimbal)
    given: Given = field(default_factory=Given)
    subject: str = "clip"  # what warnings call it

    @property
    def vertical_fov(self) -> float | None:
        """Of the lens [deg] by the user or the metadata."""
        return camera_evidence(self.facts, self.given).vertical_fov

    def known_at(self, seconds: float, heading: float | None = None) -> Known:
        """What is known of a frame at a time [s]; `heading` is where the gimbal points it, deg clockwise from north.

        Raises ParameterError where the user's own time and place are of night at 0 s; later they are not used then.
        """
        later = timedelta(seconds=seconds)
        moved = {
            name: moment + later
            for name in ("local_time", "utc_time")
            if (moment := getattr(self.facts, name)) is not None
        }
        facts = replace(self.facts, **moved)
        given = self.given if self.given.time is None else replace(self.given, time=self.given.time + later)
        if heading is not None:
            facts = replace(facts, heading=heading, heading_reference=HeadingReference.TRUE)
        elif seconds > 0.0:  # the one that is known is of the clip's first frame
            facts, given = replace(facts, heading=None), replace(given, heading=None)
        tell = known if seconds == 0.0 else known_later
        return tell(facts, given, self.subject)
