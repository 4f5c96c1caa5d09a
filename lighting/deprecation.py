"""Names that have changed: the old ones work until a release that is named here; those of Python warn."""

import warnings
from dataclasses import dataclass
from importlib import import_module


@dataclass(frozen=True)
class _RenamedName:
    """Where a public name is now, and the first release without the old one."""

    module: str
    name: str  # of an attribute of a class: Class.attribute
    gone_in: str  # release


RENAMED = {  # by the old name; that of an attribute of a class calls `warn_of_old_name` itself
    "lighting.Estimator.together": _RenamedName("lighting", "Estimator.estimate_views", "0.3.0"),
    "lighting.Given": _RenamedName("lighting", "UserInput", "0.3.0"),
    "lighting.UserInput.use_exif": _RenamedName("lighting", "UserInput.metadata", "0.3.0"),
    "lighting.photo.photo_of": _RenamedName("lighting.photo.reader", "photo_from_array", "0.3.0"),
    "lighting.photo.read_photo": _RenamedName("lighting", "read_photo", "0.3.0"),
    "lighting.photo.read_time": _RenamedName("lighting.photo.clock", "parse_time", "0.3.0"),
    "lighting.photo.reader.Photo.facts": _RenamedName("lighting.photo.reader", "Photo.metadata", "0.3.0"),
    "lighting.probe.probes_in": _RenamedName("lighting.probe.bracket", "probes_in", "0.3.0"),
    "lighting.video.Tracker": _RenamedName("lighting.video.stream", "Tracker", "0.3.0"),
    "lighting.video.stream.Tracker.given": _RenamedName("lighting.video.stream", "Tracker.user_input", "0.3.0"),
}

# What people type, without dashes, in commands, URLs and forms alike. The old names go in 0.3.0, the short ones stay.
OLD_NAMES = {"exif": "metadata", "tool": "for"}
SHORT_FORMS = {"lat": "latitude", "lon": "longitude", "fov": "vertical_fov"}


def replacement(package: str, name: str) -> object:
    """Warn of an old public name of a package, and return what it means now.

    Args:
        package: full name, such as lighting.photo; its `__getattr__` calls this.
        name: the old name in it.

    Raises:
        AttributeError: the name has never been public.
    """
    old = f"{package}.{name}"
    if old not in RENAMED:
        raise AttributeError(f"module {package!r} has no attribute {name!r}")
    warn_of_old_name(old, stacklevel=4)
    return getattr(import_module(RENAMED[old].module), RENAMED[old].name)


def warn_of_old_name(old: str, stacklevel: int = 3) -> None:
    """Warn that a name has another in its place, and when the old one goes.

    Args:
        old: a key of RENAMED.
        stacklevel: whose line the warning names; 3 is the caller of the function that calls this.
    """
    new = RENAMED[old]
    sentence = f"{old} is now {new.module}.{new.name}; the old name goes in {new.gone_in}."
    warnings.warn(sentence, DeprecationWarning, stacklevel)
