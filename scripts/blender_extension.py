"""Build the Blender extension: python -m scripts.blender_extension [-o light_from_photo.zip]

It then finds the command `lighting` of the environment that built it; a release's does not know one.

The zip holds blender/light_from_photo and, copied here so that they exist once, the script that builds scenes in
Blender and the parts of `lighting` that paint a sky, their imports made relative as Blender's rules want it.
"""

import argparse
import re
import shutil
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).parent.parent
SOURCE = ROOT / "blender" / "light_from_photo"
SCRIPT = "lighting/data/blender_scene.py"
TABLES = tuple(f"lighting/data/{name}" for name in ("hosek_wilkie.f32", "prague.f16", "CHECKSUMS"))  # of the skies
_IMPORT = re.compile(r"^(\s*)from lighting\.([\w.]+) import ", re.MULTILINE)
_MODULE = re.compile(r"^(\s*)import lighting\.(?:([\w.]+)\.)?(\w+) as ", re.MULTILINE)
_TYPES_ONLY = re.compile(r"^if TYPE_CHECKING:\n(?:(?: .*)?\n)+", re.MULTILINE)
_USED = re.compile(r"^\s*(?:from \.?|import )lighting\.([\w.]+) (?:import|as) ", re.MULTILINE)
_EPOCH = (1980, 1, 1, 0, 0, 0)  # so that the same files make the same zip


def main() -> None:
    """Build and say where."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("-o", "--output", type=Path, default=Path("light_from_photo.zip"))
    beside = shutil.which("lighting", path=str(Path(sys.executable).parent))
    print(build(parser.parse_args().output, beside))


def build(target: Path, command: str | None = None) -> Path:
    """Write the zip, in it the path of a command that estimates; returns its own path."""
    own = [("command.txt", f"{command}\n".encode())] if command else []
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in sorted([*members(), *own]):
            info = zipfile.ZipInfo(name, _EPOCH)
            info.compress_type, info.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            archive.writestr(info, data)
    return target


def release_name() -> str:
    """The name of a release's zip, as Blender names extensions: by the id and version of the manifest."""
    manifest = tomllib.loads((SOURCE / "blender_manifest.toml").read_text(encoding="utf-8"))
    return f"{manifest['id']}-{manifest['version']}.zip"


def members() -> Iterator[tuple[str, bytes]]:
    """The name and the bytes of each file of the zip."""
    for path in SOURCE.iterdir():
        if path.suffix in (".py", ".toml"):
            yield path.name, path.read_bytes()
    for name in ("LICENSE", "NOTICE"):
        yield name, (ROOT / name).read_bytes()
    yield "scene.py", (ROOT / SCRIPT).read_bytes()
    for name in TABLES:
        yield name, (ROOT / name).read_bytes()
    yield "lighting/__init__.py", b'"""The parts of outdoor-lighting that paint a sky."""\n'
    for name, text in sky_modules().items():
        yield name, relative(text, len(PurePosixPath(name).parts) - 1).encode()


def sky_modules() -> dict[str, str]:
    """The name and the text of each module of `lighting` that the extension imports, or that such a module does."""
    modules: dict[str, str] = {}
    texts = [path.read_text(encoding="utf-8") for path in SOURCE.glob("*.py")]
    while texts:
        used = _USED.findall(_TYPES_ONLY.sub("", texts.pop()))
        for name in [name for module in used for name in _files(module)]:
            if name not in modules:
                modules[name] = (ROOT / name).read_text(encoding="utf-8")
                texts.append(modules[name])
    return modules


def _files(module: str) -> list[str]:
    """The names of a module of `lighting` and, if it is in a folder or is one, of that folder's __init__.py."""
    name = f"lighting/{module.replace('.', '/')}"
    if (ROOT / name).is_dir():
        return [f"{name}/__init__.py"]
    return [f"{name}.py", *([f"{name.rpartition('/')[0]}/__init__.py"] if "." in module else [])]


def relative(text: str, depth: int) -> str:
    """A module's text with its imports of `lighting` relative; it lies `depth` folders below the extension."""
    dots = "." * depth
    return _MODULE.sub(rf"\1from {dots}\2 import \3 as ", _IMPORT.sub(rf"\1from {dots}\2 import ", text))


if __name__ == "__main__":
    main()
