"""Scenes as folders and archives that appear only when they are whole, and files that several tools share."""

import json
import os
import re
import shutil
import sys
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from PIL import Image

from lighting.checksum import DATA_FOLDER
from lighting.color import SRGB_LINEAR, srgb_bytes
from lighting.errors import ErrorCode, SceneError
from lighting.fields import Json
from lighting.files import encode_envmap, output_folder_error
from lighting.files.deflate import encode_png
from lighting.ground import draw_ground_mask
from lighting.record_json import record_with_coefficients
from lighting.scene import ENVIRONMENT, EXPORTERS, GROUND, LIT_GROUND, PLATE, RECORD
from lighting.scene.records import Scene

_PREFIX = ".lighting-scene-"  # of temporary folders
_TEMPORARY = re.compile(rf"{re.escape(_PREFIX)}[0-9a-f]{{16}}")
_COMPRESSION = {".png": zipfile.ZIP_STORED, ".exr": zipfile.ZIP_STORED}  # compressed already


Files = dict[str, bytes]  # what a tool's files hold, by their names


def write_scene(
    scene: Scene, tool: str, folder: str | os.PathLike[str], *, overwrite: bool = False, **options: Any
) -> None:
    """Write the scene for one of EXPORTERS to a folder.

    Overwriting replaces the files that the scene consists of and leaves all others in the folder alone.

    Args:
        scene: made by `make_scene`.
        tool: its name in EXPORTERS.
        folder: new or empty unless `overwrite`.
        overwrite: whether files in the folder may be replaced.
        options: go to the tool's `encode`.

    Raises:
        SceneError: the tool or the scene is none, or the folder cannot be written. It is raised too if the folder holds
            a scene for another tool in other light. That scene would be left with this one's map.
    """
    target = check_scene_target(tool, folder, overwrite=overwrite)
    try:
        files = _encode(scene, tool, options)
        _check_other_scenes(files, target, tool)
        with _temporary_folder(target) as built:
            for name, data in files.items():
                (built / name).write_bytes(data)
            if target.is_dir():
                for name in sorted(files):
                    (built / name).replace(target / name)
            else:
                built.replace(target)
    except OSError as error:
        raise SceneError(f"{target} cannot be written: {error.strerror or error}.") from error


def encode_scene_file(scene: Scene, tool: str, **options: Any) -> bytes:
    """Return the file of a tool whose scenes are one.

    Args:
        scene: made by `make_scene`.
        tool: its name in EXPORTERS.
        options: go to the tool's `encode`.

    Raises:
        SceneError: the tool or the scene is none.
    """
    (data,) = _encode(scene, tool, options).values()
    return data


def zip_scene(scene: Scene, tool: str, **options: Any) -> bytes:
    """The same files as a ZIP archive, made in memory.

    The same scene makes the same bytes.

    Args:
        scene: made by `make_scene`.
        tool: its name in EXPORTERS.
        options: go to the tool's `encode`.

    Raises:
        SceneError: the tool or the scene is none.
    """
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, data in _encode(scene, tool, options).items():
            info = zipfile.ZipInfo(name)  # of 1980, so that the same scene makes the same bytes
            info.external_attr = 0o644 << 16
            archive.writestr(info, data, _COMPRESSION.get(Path(name).suffix, zipfile.ZIP_DEFLATED))
    return stream.getvalue()


def check_scene_target(tool: str, folder: str | os.PathLike[str], *, overwrite: bool) -> Path:
    """Return the full path of a scene's folder, before any work, where a scene for a tool can be written to it.

    Args:
        tool: its name in EXPORTERS.
        folder: of the scene.
        overwrite: whether it may hold files already.

    Raises:
        SceneError: the tool is unknown, the folder cannot be written, or is not empty and `overwrite` is false.
    """
    _check_tool(tool)
    if not isinstance(folder, str | os.PathLike):
        sentence = f"A scene is written to a folder, not to {type(folder).__name__}."
        raise SceneError(sentence, "folder", ErrorCode.WRONG_TYPE)
    target = Path(folder).resolve()
    check_scene_folder(target, overwrite=overwrite)
    return target


def check_scene_folder(target: Path, *, overwrite: bool) -> None:
    """Check that a scene can be written to a folder.

    Args:
        target: the folder.
        overwrite: whether it may hold files already.

    Raises:
        SceneError: it cannot be written, or is not empty and `overwrite` is false.
    """
    if objection := output_folder_error(target, overwrite=overwrite, what="the scene", need="a scene is a folder"):
        raise SceneError(objection)


def _encode(scene: Scene, tool: str, options: Mapping[str, object]) -> Files:
    """A scene's files; SceneError for one that the tool's entry does not list: no check kept the user's from it."""
    _check_tool(tool)
    if not isinstance(scene, Scene):
        sentence = f"A Scene is needed, not {type(scene).__name__}; make_scene makes one."
        raise SceneError(sentence, code=ErrorCode.WRONG_TYPE)
    files: Files = EXPORTERS[tool].encode(scene, **options)
    if others := files.keys() - set(EXPORTERS[tool].files):
        raise SceneError(f"The exporter for {tool} wrote {', '.join(sorted(others))}, which its entry does not list.")
    return files


def _check_tool(tool: str) -> None:
    if not isinstance(tool, str):
        raise SceneError(
            f"A tool has a name such as 'blender', not {type(tool).__name__}.", "tool", ErrorCode.WRONG_TYPE
        )
    if tool not in EXPORTERS:
        sentence = f"The tool {tool!r} is not known; it must be one of {', '.join(EXPORTERS)}."
        raise SceneError(sentence, "tool", ErrorCode.UNKNOWN)


@contextmanager
def _temporary_folder(target: Path) -> Iterator[Path]:
    """A temporary folder next to the target, removed at the end unless it was renamed; also what killed ones left."""
    built = target.parent / f"{_PREFIX}{os.urandom(8).hex()}"
    built.mkdir()  # with the permissions of any folder that the process makes
    lock = _lock_folder(built)
    try:
        _remove_leftovers(built)
        yield built
    finally:
        shutil.rmtree(built, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def _remove_leftovers(built: Path) -> None:
    """Remove older temporary folders beside one that no process locks, unless they hold what is no scene's."""
    names = {name for entry in EXPORTERS.values() for name in entry.files}
    for path in built.parent.glob(f"{_PREFIX}*"):
        if not _TEMPORARY.fullmatch(path.name) or (lock := _lock_folder(path)) is None:
            continue
        is_older = path.stat().st_mtime < built.stat().st_mtime - 1.0  # another may have made it and not locked it yet
        if is_older and {file.relative_to(path).as_posix() for file in path.rglob("*") if not file.is_dir()} <= names:
            shutil.rmtree(path, ignore_errors=True)
        os.close(lock)


def _lock_folder(folder: Path) -> int | None:
    """The descriptor that locks a folder, which ends with the process; None where another has it, or on Windows."""
    if sys.platform == "win32":
        return None
    import fcntl

    try:
        lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError:
        return None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(lock)
        return None
    return lock


def _check_other_scenes(files: Files, target: Path, tool: str) -> None:
    """Raise SceneError where the map and plate of another tool's scene would become those of another light."""
    record = target / RECORD
    if RECORD not in files or (record.is_file() and record.read_bytes() == files[RECORD]):
        return
    for other, entry in EXPORTERS.items():
        main = entry.files[0]
        if other != tool and RECORD in entry.files and (target / main).is_file():
            raise SceneError(f"{target} holds a scene for {other} in other light, {main}; choose another folder.")


# Files that several tools share.


def encode_shared_files(scene: Scene) -> Files:
    """SHARED_FILES.

    Args:
        scene: made by `make_scene`.
    """
    return {
        PLATE: encode_png(scene.plate),
        ENVIRONMENT: encode_envmap(scene.environment, scene.lighting, probe=scene.light_probe),
        RECORD: encode_record(scene),
        LIT_GROUND: encode_lit_ground(scene),
        GROUND: encode_ground_mask(scene),
    }


def encode_record(scene: Scene) -> bytes:
    """What RECORD holds.

    Args:
        scene: made by `make_scene`.
    """
    return encode_json(record_with_coefficients(scene.lighting, scene.light_probe))


def encode_json(content: Json) -> bytes:
    """A file of JSON, indented.

    Args:
        content: of the file.
    """
    return (json.dumps(content, indent=2) + "\n").encode()


def encode_lit_ground(scene: Scene, *, movable: bool = False) -> bytes:
    """Where the sun's shadow of an object falls on the plate, as PNG of one channel: 255 on lit ground, 0 elsewhere.

    Elsewhere is shade, and what stands before the ground; of an object in shade, all. Above the horizon the value means
    nothing.

    Args:
        scene: made by `make_scene`.
        movable: whether the object may move out of the shade, so that its own place does not count.
    """
    share = 0.0 if scene.spot_in_shade and not movable else 1.0
    return encode_png(np.round(255 * share * scene.shadow_receivers).astype(np.uint8))


def encode_ground_mask(scene: Scene) -> bytes:
    """What is known of the plate's ground, as PNG, by `draw_ground_mask`.

    Args:
        scene: made by `make_scene`.
    """
    return encode_png(draw_ground_mask(scene.lit_ground, scene.lighting, scene.segments))


def encode_projected_ground(scene: Scene) -> tuple[bytes, bytes]:
    """The photo as a surface and as light, two PNGs of the plate's size, for renderers without shadow catchers.

    Projected from the camera onto the ground, they show the plate where nothing shades it. What shades lit ground takes
    the sun, or the sky, from the first; the second is what stays: shade, and what stands before the ground.

    Args:
        scene: made by `make_scene`.
    """
    photo = SRGB_LINEAR.take(scene.plate)
    lit = np.zeros(photo.shape[:2], np.float32)
    if not scene.spot_in_shade:
        small = Image.fromarray(scene.shadow_receivers)
        lit = np.asarray(small.resize((scene.width, scene.height), Image.Resampling.BILINEAR)).clip(0.0, 1.0)
    direct = scene.sun_irradiance * max(float(scene.sun_direction[1]), 0.0)
    white = ((scene.sky_irradiance + direct) / np.pi).astype(np.float32)  # radiance of white ground
    surface = np.divide(lit[..., None] * photo, white, out=np.zeros_like(photo), where=white > 0.0).clip(0.0, 1.0)
    surface = SRGB_LINEAR.take(srgb_bytes(surface))  # as it is written
    parts = (surface, np.maximum(photo - surface * white, 0.0))
    albedo, emission = (encode_png(srgb_bytes(part)) for part in parts)
    return albedo, emission


def read_data(name: str) -> bytes:
    """What a file in lighting/data/ holds.

    Args:
        name: of the file.
    """
    return (DATA_FOLDER / name).read_bytes()


def fill_template(name: str, values: Mapping[str, object]) -> bytes:
    """What a text in lighting/data/ holds with its $placeholders replaced.

    Args:
        name: of the file.
        values: of all placeholders, by name.
    """
    return Template(read_data(name).decode()).substitute(values).encode()
