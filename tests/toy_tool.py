"""A scene tool as a contributor writes one: a text with the sun, and the photo."""

from lighting.scene import Exporter, ExporterOption
from lighting.scene.records import Scene
from lighting.scene.writer import Folder, encode_plate

TEXT, PICTURE = "toy.txt", "toy.png"


def write(scene: Scene, folder: Folder, *, unit: str = "m") -> None:
    """Write TEXT and PICTURE."""
    height = scene.camera_position[1] * {"m": 1, "cm": 100}[unit]
    lines = [f"sun {scene.lighting.sun_azimuth:g} {scene.lighting.sun_elevation:g}", f"camera {height:g} {unit}"]
    (folder / TEXT).write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / PICTURE).write_bytes(encode_plate(scene))


TOY = Exporter(write, files=(TEXT, PICTURE), options={"unit": ExporterOption(("m", "cm"), default="m")}, has_map=False)
