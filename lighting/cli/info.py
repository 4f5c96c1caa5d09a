"""The commands that describe a file, and that say what of an installation works."""

import csv
import hashlib
import json
import platform
import subprocess
import sys
from base64 import urlsafe_b64encode
from codecs import BOM_UTF8
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from datetime import date, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution, packages_distributions, version
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING

import click

from lighting.cli import cli
from lighting.cli import options as common
from lighting.cli.console import (
    escape_control_chars,
    format_error,
    parse_lighting,
    prefix_errors,
    read_lighting,
    read_picture_bytes,
    record_with_probe,
)
from lighting.cli.options import FileName
from lighting.confinement import describe_confinement
from lighting.errors import ErrorCode, LightingError, PhotoError, install_command
from lighting.files import escape_undecodable
from lighting.scene import EXPORTERS
from lighting.start import silence_libraries
from lighting.version import __version__

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from lighting.fields import Json
    from lighting.photo.metadata import PhotoMetadata
    from lighting.photo.reader import Photo
    from lighting.photo_estimate import Estimate
    from lighting.records import Lighting


@cli.command(
    "info",
    epilog="""
    lighting info photo.jpg                             # its metadata, and the time that is believed
    lighting info photo.exr                             # size, and the record in the header
    lighting info light.json
    """,
)
@click.argument("file", type=FileName())
@click.option("--json", is_flag=True, expose_value=False, help="JSON, which is all that it prints.")
@click.option("-q", "--quiet", is_flag=True, expose_value=False, help="No effect: it prints no warnings.")
def _info(file: str) -> None:
    """Describe an EXR, HDR, network, record or photo as JSON."""
    describe = _BY_SUFFIX.get(Path(file).suffix.lower(), _describe_picture)
    click.echo(json.dumps({"file": escape_undecodable(file), **describe(file)}, indent=2))


def _describe_record(file: str) -> "Json":
    return _describe_lighting(read_lighting(file))


def _describe_lighting(lighting: "Lighting") -> "Json":
    return {"kind": "lighting record", "lighting": record_with_probe(lighting)}


def _describe_network(file: str) -> "Json":
    from lighting.model import Model

    return {"kind": "network", **json.loads(Model.load(file).spec.to_json())}


def _describe_picture(file: str) -> "Json":
    from lighting.files.exr import EXR_MAGIC
    from lighting.files.radiance_hdr import HDR_MAGIC, decode_hdr

    data = read_picture_bytes(file)
    if data.startswith(EXR_MAGIC):
        return _describe_map(file, data)
    if data.startswith(HDR_MAGIC) or Path(file).suffix.lower() == ".hdr":
        with prefix_errors(file):
            return _describe_image(decode_hdr(data))
    if data.removeprefix(BOM_UTF8).lstrip().startswith(b"{"):
        return _describe_lighting(parse_lighting(data, file))
    with prefix_errors(file):
        photo = _read_photo(data, file)
    size: Json = {"format": photo.format, "width": photo.width, "height": photo.height}
    if photo.crop is not None:
        size["crop"] = asdict(photo.crop)
    return {"kind": "photo", **size, "metadata": _describe_metadata(photo.metadata)}


def _read_photo(data: bytes, file: str) -> "Photo":
    """The photo; the error about a file of no known kind names all that could be described."""
    from lighting.photo.reader import read_photo

    try:
        return read_photo(data, path=None if file == "-" else file)
    except PhotoError as error:
        if data and error.code is ErrorCode.UNREADABLE and _is_of_no_kind(data):
            sentence = "This is no photo, EXR, Radiance HDR, network (.onnx) or record (.json), which info describes."
            raise PhotoError(sentence) from error
        raise


def _is_of_no_kind(data: bytes) -> bool:
    """Whether nothing more is known of a file that cannot be read than that it may be a text."""
    from lighting.photo.formats import UNREADABLE, kind_name, unreadable_sentence
    from lighting.photo.tiff import is_raw

    return not is_raw(data) and (unreadable_sentence(data) == UNREADABLE or kind_name(data) == "a text")


def _describe_metadata(metadata: "PhotoMetadata") -> "Json":
    """The metadata that estimates use; of the place only whether it is known, since output may be passed on."""
    from lighting.fusion.instants import resolve_instants
    from lighting.fusion.user_input import NO_USER_INPUT

    values = {**asdict(metadata), "location": metadata.latitude is not None}
    del values["latitude"], values["longitude"], values["locations"]
    likeliest = resolve_instants(metadata, NO_USER_INPUT).likeliest
    values["utc_time"], values["time_source"] = (likeliest.utc_time, likeliest.source) if likeliest else (None, None)
    return {name: value.isoformat() if isinstance(value, datetime) else value for name, value in values.items()}


def _describe_map(file: str, data: bytes) -> "Json":
    """What a map is, and its header's record; the light probe in it is that of the map, with the place."""
    from lighting.files.exr import read_exr, read_exr_attributes

    with prefix_errors(file), silence_libraries():
        image, lighting = read_exr(BytesIO(data))
        header = read_exr_attributes(BytesIO(data))
    if lighting is None:
        return {**_describe_image(image), "lighting": None}
    probe = json.loads(header["lighting.json"]).get("light_probe")
    record = record_with_probe(lighting)
    return {**_describe_image(image), "lighting": record | ({"light_probe": probe} if probe else {})}


def _describe_image(image: "NDArray[np.float32]") -> "Json":
    """What an HDR picture (H, W, 3) is by its shape, and its size."""
    height, width = image.shape[:2]
    return {"kind": "environment map" if width == 2 * height else "picture", "width": width, "height": height}


_BY_SUFFIX = {".onnx": _describe_network, ".json": _describe_record, ".jsonl": _describe_record}


_PACKAGE = "outdoor-lighting"
_LIBRARIES = ("numpy", "onnxruntime", "Pillow", "pi-heif", "OpenEXR", "tzdata", "tzfpy")  # whose versions reports need
_EXTRAS = (  # what is optional: the module, what it is for, and how it is installed
    ("cv2", "OpenCV", "overlapping photos and clips", install_command("all")),
    ("av", "PyAV", "clips", install_command("all")),
    ("rawpy", "rawpy", "RAW photos", install_command("all")),
    ("scipy", "SciPy", "measured skies and photometric stereo", install_command("all")),
    ("pyarrow", "PyArrow", "Parquet", install_command("all")),
    ("mcp", "MCP", "assistants, by `lighting mcp`", install_command("mcp")),
    ("ray", "Ray", "batches on several machines", install_command("ray")),
    ("torch", "PyTorch", "training", install_command("train")),
    ("bpy", "bpy", "`scene --blend` without Blender", "pip install bpy, in Python 3.11 or 3.13"),
    ("comfyui_frontend_package", "ComfyUI's frontend", "nodes", "see ComfyUI in the book"),
)
_SECONDS = 20.0  # that Blender may take to say its version


@dataclass(frozen=True)
class _Finding:
    """What was found of one thing."""

    name: str
    found: bool
    text: str  # its version, or what to do
    needed: bool = False  # without it hardly anything works


@cli.command(
    "doctor",
    epilog="""
    lighting doctor
    lighting doctor --json                              # for a report of a fault
    lighting doctor --quiet && echo all that is needed works
    """,
)
@common.json_option
@click.option("-q", "--quiet", is_flag=True, help="Only what is broken and needed.")
@click.pass_context
def _doctor(ctx: click.Context, /, as_json: bool, quiet: bool) -> None:
    """Say what works here: network, scenes, page, extras, Blender.

    The exit status is 1 where something is missing or damaged that every photo needs.
    """
    findings = list(_findings())
    if as_json:
        click.echo(json.dumps([asdict(finding) for finding in findings], indent=2))
    for finding in () if as_json else findings:
        if not quiet or (finding.needed and not finding.found):
            mark = "ok" if finding.found else "BROKEN" if finding.needed else "-"
            click.echo(f"{mark:7}  {finding.name}: {escape_control_chars(finding.text)}")
    ctx.exit(1 if any(finding.needed and not finding.found for finding in findings) else 0)


def _findings() -> Iterator[_Finding]:
    from lighting.checksum import verify_checksums

    system = f"{platform.system()} {platform.machine()}, {Path(sys.prefix)}"
    yield _Finding("lighting", True, f"{__version__}, Python {platform.python_version()}, {system}", needed=True)
    yield _Finding("libraries", True, ", ".join(f"{name} {_version(name)}" for name in _LIBRARIES))
    yield _check("data", lambda: f"{verify_checksums()} networks and tables are intact")
    yield from _find_changed_files()
    yield _check("network", _check_network)
    yield _check("answer", _estimate_gray)
    yield _check("scenes", _write_scenes, needed=False)
    yield _check("day", _plan_day, needed=False)
    yield _Finding("sandbox", True, f"{describe_confinement()}; see SECURITY.md")
    yield from _find_pages()
    modules = packages_distributions()
    for module, name, use, command in _EXTRAS:
        found = find_spec(module) is not None
        release = _version(modules[module][0]) if found and module in modules else ""
        yield _Finding(name, found, f"{release} for {use}".lstrip() if found else f"for {use}: {command}")
    yield _find_blender()


def _version(distribution: str) -> str:
    """Of an installed package."""
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "is missing"


def _find_changed_files() -> Iterator[_Finding]:
    """Whether the package's files are those that were installed, where pip or its like listed them; not of a clone."""
    try:
        installed = distribution(_PACKAGE)
    except PackageNotFoundError:
        return
    # Not `files`, which leaves out what is missing from Python 3.12 on.
    rows = csv.reader((installed.read_text("RECORD") or "").splitlines())
    listed = {name: digest for name, digest, _ in rows if digest and not name.endswith(".pyc")}
    package = Path(__file__).parents[1]
    if not any(Path(str(installed.locate_file(name))) == package / "__init__.py" for name in listed):
        return
    changed = [n for n, digest in listed.items() if not _is_as_installed(Path(str(installed.locate_file(n))), digest)]
    if changed:
        names = ", ".join(map(str, changed[:3])) + (f" and {len(changed) - 3} more" if len(changed) > 3 else "")
        yield _Finding("files", False, f"{names} changed since the installation; install it again", needed=True)
    else:
        yield _Finding("files", True, f"{len(listed)} are as they were installed")


def _is_as_installed(file: Path, listed: str) -> bool:
    """Whether a file has the digest of a wheel's RECORD, such as sha256=..."""
    mode, _, value = listed.partition("=")
    try:
        digest = hashlib.new(mode, file.read_bytes()).digest()
    except OSError:
        return False
    return urlsafe_b64encode(digest).rstrip(b"=").decode() == value


def _check(name: str, describe: Callable[[], str], *, needed: bool = True) -> _Finding:
    """A thing whose description fails where it does not work."""
    try:
        return _Finding(name, True, describe(), needed)
    except (LightingError, OSError, ImportError) as error:
        return _Finding(name, False, format_error(error), needed)


def _check_network() -> str:
    from lighting.model import Model

    spec = Model.load().spec
    return f"{spec.name} {spec.version}"


@cache
def _gray_estimate() -> "Estimate":
    import numpy as np

    from lighting.estimator import Estimator
    from lighting.photo.reader import photo_from_array

    return Estimator()(photo_from_array(np.full((96, 128, 3), 128, dtype=np.uint8)))


def _estimate_gray() -> str:
    """Whether the whole way works, on a gray picture."""
    began = monotonic()
    _gray_estimate()
    return f"a gray picture took {monotonic() - began:.1f} s, the network's loading in it"


def _write_scenes() -> str:
    """Whether every tool's scene can be written, in memory."""
    from lighting.map_options import MapOptions
    from lighting.scene.writer import zip_scene

    scene = _gray_estimate().make_scene(MapOptions(height=64))
    for tool in EXPORTERS:
        zip_scene(scene, tool)
    return f"`scene --for` writes {', '.join(EXPORTERS)}"


def _plan_day() -> str:
    """Whether sun and clocks of another day are known, in Rome."""
    from lighting.sun_study import plan_study

    light = replace(_gray_estimate().lighting, latitude=41.89, longitude=12.48, camera_heading=0.0)
    first, *_ = plan_study(light, date(2026, 12, 21), 60.0).hours
    return f"`day` knows a place's clocks, such as {first.time:%Z} in Rome"


def _find_pages() -> Iterator[_Finding]:
    """The built page and the book, whose places are known without an import of the service."""
    spec = find_spec("server")
    if spec is None or not spec.submodule_search_locations:
        yield _Finding("page", False, "the service is not installed")
        return
    server = Path(next(iter(spec.submodule_search_locations)))
    is_built = (server / "web" / "dist" / "index.html").is_file()
    missing = "it is not built: run npm ci && npm run build in server/web"
    yield _Finding("page", is_built, "built; `lighting open` shows it" if is_built else missing)
    books = (server.parent / "docs" / "README.md", server / "book_pages" / "README.md")  # of a clone, of a wheel
    is_there = any(book.is_file() for book in books)
    yield _Finding("book", is_there, "at /book/ of `lighting serve`" if is_there else "its pages are missing")


def _find_blender() -> _Finding:
    from lighting.scene.blender import find_blender_program

    program = find_blender_program()
    if program is None:
        return _Finding("Blender", False, "not found; get it from blender.org to open scenes, and for `scene --blend`")
    try:
        told = subprocess.run([program, "--version"], capture_output=True, text=True, timeout=_SECONDS, check=False)
    except (OSError, subprocess.SubprocessError) as error:
        return _Finding("Blender", False, f"{program} does not start: {error}")
    version = told.stdout.splitlines()[0] if told.stdout else "of an unknown version"
    return _Finding("Blender", True, f"{version}, {program}")
