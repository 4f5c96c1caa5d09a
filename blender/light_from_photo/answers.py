"""A photo's scene from the command or from the service; nothing here needs Blender.

Either fills a folder with NEEDED: the numbers and the pictures of `lighting scene --for blender`. The script that comes
with them is never run; this extension has its own copy.
"""

import http.client
import io
import os
import re
import shutil
import subprocess
import urllib.error
import urllib.parse
import urllib.request
import zipfile
import zlib
from pathlib import Path
from typing import Any

NEEDED = ("scene.json", "plate.png", "environment.exr", "lit_ground.png", "lighting.json")
SECONDS = 120  # to wait for an answer
MOST_BYTES = 1 << 28  # of an answer, packed or not
PHOTOS = (
    ".jpg", ".jpeg", ".jpe", ".jfif", ".mpo", ".png", ".webp", ".heic", ".heif", ".hif", ".tif", ".tiff", ".avif",
    ".arw", ".cr2", ".cr3", ".dng", ".nef", ".nrw", ".orf", ".pef", ".raf", ".rw2", ".rwl", ".x3f",
)  # fmt: skip
_KINDS = {
    **{".png": "image/png", ".webp": "image/webp", ".tif": "image/tiff", ".tiff": "image/tiff", ".avif": "image/avif"},
    **dict.fromkeys((".heic", ".heif", ".hif"), "image/heic"),
}
_NO_ADDRESS = "The service's address is not one such as http://127.0.0.1:8000."
_OF_THIS_PYTHON = ("PYTHONHOME", "PYTHONPATH")  # Blender's, which would mislead another


_BUILT_BY = Path(__file__).with_name("command.txt")  # the command beside the Python that built this extension
_USUAL = (  # where installers put commands that no desktop's PATH has
    "~/.local/bin/lighting",
    "/opt/homebrew/bin/lighting",
    "/usr/local/bin/lighting",
    "~/.local/bin/lighting.exe",
)
_LOOPBACK = ("127.0.0.1", "localhost", "::1")


class AnswerError(Exception):
    """No scene came; the text is a sentence for the user."""


class NoCommandError(AnswerError):
    """The command is nowhere."""


def find_command(command: str) -> str | None:
    """The path of the command: as it was set, else what built this extension, else where installers put it."""
    names = [command]
    if command == "lighting":
        names += [_BUILT_BY.read_text(encoding="utf-8").strip()] if _BUILT_BY.is_file() else []
        names += _USUAL
    return next(filter(None, (shutil.which(os.path.expanduser(name)) for name in names)), None)  # noqa: PTH111


def is_serving_here(address: str) -> bool:
    """Whether a service answers at an address, which must be of this computer: nobody chose to send the photo."""
    base_url = address.strip().rstrip("/")
    try:
        if _host(base_url) not in _LOOPBACK:
            return False
        with urllib.request.build_opener(_Stay).open(f"{base_url}/readyz", timeout=1) as answer:
            return bool(answer.status == 200)
    except (AnswerError, OSError, ValueError, http.client.HTTPException):
        return False


def from_command(command: str, photo: Path, folder: Path) -> None:
    """Have the command write the scene into a folder; raises AnswerError."""
    program = find_command(command)
    if program is None:
        raise NoCommandError(f"There is no command {command!r}; give its whole path in the preferences.")
    environment = {name: value for name, value in os.environ.items() if name not in _OF_THIS_PYTHON}
    arguments = [program, "scene", str(photo), "--for", "blender", "-o", str(folder), "--quiet"]
    try:
        result = subprocess.run(
            arguments, env=environment, capture_output=True, text=True, errors="replace", timeout=SECONDS, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise AnswerError(f"{command} took more than {SECONDS} seconds.") from error
    except OSError as error:
        raise AnswerError(f"{command} cannot be run: {error.strerror}.") from error
    if result.returncode:
        lines = result.stderr.strip().splitlines() or [f"{command} failed with status {result.returncode}."]
        raise AnswerError(lines[-1].removeprefix("Error: "))
    _check(folder)


def from_service(address: str, key: str, photo: Path, folder: Path) -> None:
    """Send the photo to a service and unpack its answer; raises AnswerError."""
    base_url = address.strip().rstrip("/")
    headers = _headers(photo, key.strip())
    host = _host(base_url)
    try:
        request = urllib.request.Request(f"{base_url}/v1/scene?for=blender", photo.read_bytes(), headers)
        with urllib.request.build_opener(_Stay).open(request, timeout=SECONDS) as answer:
            data = answer.read(MOST_BYTES + 1)
    except urllib.error.HTTPError as error:
        raise AnswerError(_detail(error)) from error
    except urllib.error.URLError as error:
        raise AnswerError(f"{host} cannot be reached: {error.reason}.") from error
    except OSError as error:
        raise AnswerError(f"The photo was not answered: {error}.") from error
    except (http.client.InvalidURL, ValueError) as error:
        raise AnswerError(_NO_ADDRESS) from error
    except http.client.HTTPException as error:
        raise AnswerError(f"{host} answers, but not as a service does.") from error
    _unpack(data, folder)


def _host(address: str) -> str:
    """The host of a service's address."""
    try:
        url = urllib.parse.urlsplit(address)
        _ = url.port  # refused here if it is none
    except ValueError as error:
        raise AnswerError(_NO_ADDRESS) from error
    if url.scheme not in ("http", "https") or not url.hostname:
        raise AnswerError("The service's address must begin with http:// or https://.")
    return url.hostname


class _Stay(urllib.request.HTTPRedirectHandler):
    """A photo and a key go to the address that was set, and nowhere else."""

    def redirect_request(self, *_: Any) -> None:
        return None


def _headers(photo: Path, key: str) -> dict[str, str]:
    """The service reads the kind of photo from its bytes; the type only has to be one of a photo."""
    headers = {"Content-Type": _KINDS.get(photo.suffix.lower(), "image/jpeg")}
    if not key:
        return headers
    if not re.fullmatch(r"[\t\x20-\x7e\x80-\xff]+", key):
        raise AnswerError("The API key has characters that no request can carry.")
    return headers | {"Authorization": f"Bearer {key}"}


def _detail(error: urllib.error.HTTPError) -> str:
    """The service's own sentence, if it has one."""
    import json

    try:
        return str(json.loads(error.read(1 << 16))["detail"])
    except (ValueError, KeyError, TypeError, OSError):
        return f"The service answered {error.code} {error.reason}."


def _unpack(data: bytes, folder: Path) -> None:
    """Write the files that are needed, and no others."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            sizes = {info.filename: info.file_size for info in archive.infolist()}
            if sum(sizes.get(name, 0) for name in NEEDED) > MOST_BYTES or len(data) > MOST_BYTES:
                raise AnswerError("The service's answer is too large.")
            for name in NEEDED:
                if name in sizes:
                    (folder / name).write_bytes(archive.read(name))
    except (zipfile.BadZipFile, zlib.error, EOFError, ValueError, NotImplementedError, RuntimeError) as error:
        raise AnswerError("The service's answer is not a scene.") from error
    _check(folder)


def _check(folder: Path) -> None:
    missing = [name for name in NEEDED if not (folder / name).is_file()]
    if missing:
        raise AnswerError(f"The answer has no {', '.join(missing)}.")
