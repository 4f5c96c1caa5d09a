"""Public names that have changed: the old ones work, with a warning, until a release that is named here."""

import warnings
from dataclasses import dataclass
from importlib import import_module


@dataclass(frozen=True)
class _RenamedName:
    """Where a public name is now, and the first release without the old one."""

    module: str
    name: str
    gone_in: str


RENAMED = {  # by the old module and name
    "lighting.Given": _RenamedName("lighting.fusion.user_input", "UserInput", "0.3.0"),
    "lighting.photo.photo_of": _RenamedName("lighting.photo.reader", "photo_from_array", "0.3.0"),
    "lighting.photo.read_photo": _RenamedName("lighting.photo.reader", "read_photo", "0.3.0"),
    "lighting.photo.read_time": _RenamedName("lighting.photo.metadata", "parse_time", "0.3.0"),
    "lighting.probe.probes_in": _RenamedName("lighting.probe.bracket", "probes_in", "0.3.0"),
    "lighting.video.Tracker": _RenamedName("lighting.video.stream", "Tracker", "0.3.0"),
}


def replacement(package: str, name: str) -> object:
    """What an old public name of a package means now; warns of it.

    Raises AttributeError for a name that has never been public.
    """
    new = RENAMED.get(f"{package}.{name}")
    if new is None:
        raise AttributeError(f"module {package!r} has no attribute {name!r}")
    warn_renamed(f"{package}.{name}", f"{new.module}.{new.name}", new.gone_in)
    return getattr(import_module(new.module), new.name)


def warn_renamed(old: str, new: str, gone_in: str, stacklevel: int = 4) -> None:
    """Warn a caller that a name has another in its place.

    Args:
        old: the full name that the caller used.
        new: the full name to use instead.
        gone_in: the first release without the old name.
        stacklevel: calls between this warning and the caller, both counted; 3 for a property.
    """
    warnings.warn(f"{old} is now {new}; the old name goes in {gone_in}.", DeprecationWarning, stacklevel=stacklevel)
