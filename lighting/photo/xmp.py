"""The texts in a picture's XMP packet, which is hostile input: a large one or one with entities counts as absent."""

from typing import Any
from xml.parsers import expat

MOST_BYTES = 1 << 18  # of a packet that is read; what fits into one segment of a JPEG is a quarter of it


def properties(packet: Any) -> dict[str, str]:
    """What attributes and elements hold by "namespace name", the first of each; empty for what is no XMP.

    A namespace stands without the slash at its end, since writers disagree about it. Never raises.
    """
    if not isinstance(packet, bytes) or len(packet) > MOST_BYTES:
        return {}
    reader = _Reader()
    try:
        reader.parser.Parse(packet.rstrip(b"\0 \t\r\n"), True)
    except (expat.ExpatError, ValueError, LookupError):  # LookupError: an encoding that nobody knows
        return {}
    return reader.found


class _Reader:
    """Collects the properties while expat reads; nothing of it nests, however deep the packet is."""

    def __init__(self) -> None:
        self.found: dict[str, str] = {}
        self._text: list[str] = []
        self.parser = expat.ParserCreate(namespace_separator=" ")
        self.parser.buffer_text = True
        self.parser.StartDoctypeDeclHandler = self._refuse  # without a document type there are no entities to expand
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._text.append

    def _refuse(self, *_: object) -> None:
        raise ValueError("A packet has no document type.")

    def _start(self, _: str, attributes: dict[str, str]) -> None:
        self._text.clear()
        for name, value in attributes.items():
            self._keep(name, value)

    def _end(self, name: str) -> None:
        self._keep(name, "".join(self._text))
        self._text.clear()

    def _keep(self, name: str, value: str) -> None:
        namespace, _, local = name.rpartition(" ")
        if text := value.strip():
            self.found.setdefault(f"{namespace.rstrip('/')} {local}", text)
