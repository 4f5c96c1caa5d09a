"""A photo's scene from the command or from the service; nothing here needs Blender.

Either fills a folder with NEEDED: the numbers and the pictures of `lighting scene --for blender`. The script that comes
with them is never run; this extension has its own copy.
"""

import http.client
import io
import json
import os
import re
import shutil
import subprocess
import urllib.error
import urllib.parse
import urllib.request
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

NEEDED = ("scene.json", "plate.png", "environment.exr", "lit_ground.png", "lighting.json")
SECONDS = 120  # to wait for an answer
_SECONDS_OF_FINDING = 20  # that the command may take to say its version
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
_VERSION = re.compile(r"lighting, version (\d\S*)")
_PORTS = 4  # that `lighting serve` tries, from the address's own on, where another program has that


class AnswerError(Exception):
    """No scene came; the text is a sentence for the user."""


class NoCommandError(AnswerError):
    """The command is nowhere."""


@dataclass(frozen=True)
class Stated:
    """What the user knows of a photo."""

    marks: tuple[str, ...] = ()
    """Shadows, as the command takes them by --shadow."""
    pick: int = 0
    """The number of the sun that shines, from 1; 0: the answer's."""


def find_command(command: str) -> str | None:
    """The path of the first that works: as it was set, what built this extension, where installers put it."""
    names = [command]
    if command == "lighting":
        names += [_BUILT_BY.read_text(encoding="utf-8").strip()] if _BUILT_BY.is_file() else []
        names += _USUAL
    paths = filter(None, (shutil.which(os.path.expanduser(name)) for name in names))  # noqa: PTH111
    return next((path for path in paths if version_of(path)), None)


def version_of(program: str) -> str | None:
    """The version of a command; None where it does not start, or is another that is called `lighting`."""
    try:
        result = _run([program, "--version"], _SECONDS_OF_FINDING)
    except (OSError, subprocess.SubprocessError):
        return None
    told = _VERSION.match(result.stdout)
    return told[1] if told else None


def _run(arguments: list[str], seconds: int) -> "subprocess.CompletedProcess[str]":
    """A command without Blender's own Python in its environment."""
    environment = {name: value for name, value in os.environ.items() if name not in _OF_THIS_PYTHON}
    return subprocess.run(
        arguments, env=environment, capture_output=True, text=True, errors="replace", timeout=seconds, check=False
    )


def is_here(address: str) -> bool:
    """Whether an address is of this computer."""
    try:
        return _host(address.strip()) in _LOOPBACK
    except AnswerError:
        return False


def find_service(address: str, key: str) -> str | None:
    """The address of a service that works on this computer: as it was set, or a few ports on.

    An address elsewhere is not asked: nobody chose to send the photo there.
    """
    if not is_here(address):
        return None
    url = urllib.parse.urlsplit(address.strip().rstrip("/"))
    ports = range(url.port, url.port + _PORTS) if url.port else [url.port]
    host = f"[{url.hostname}]" if ":" in str(url.hostname) else url.hostname
    urls = [f"{url.scheme}://{host}{f':{port}' if port else ''}{url.path}" for port in ports]
    return next((base_url for base_url in urls if _is_service(base_url, key.strip())), None)


def _is_service(base_url: str, key: str) -> bool:
    """Whether what listens there makes scenes for Blender, and takes photos now."""
    opener = urllib.request.build_opener(_Stay)
    try:
        request = urllib.request.Request(f"{base_url}/v1/model", headers=_authorization(key))
        with opener.open(request, timeout=1) as answer:
            if "blender" not in json.loads(answer.read(1 << 16))["scene_tools"]:
                return False
        with opener.open(f"{base_url}/readyz", timeout=1) as answer:
            return bool(answer.status == 200)
    except (AnswerError, OSError, ValueError, KeyError, TypeError, http.client.HTTPException):
        return False


def from_command(command: str, photo: Path, folder: Path, stated: Stated = Stated()) -> None:
    """Have the command write the scene into a folder; raises AnswerError."""
    program = find_command(command)
    if program is None:
        raise NoCommandError(f"There is no command {command!r} that works; give its whole path in the preferences.")
    arguments = [program, "scene", str(photo), "--for", "blender", "-o", str(folder), "--quiet"]
    arguments += [part for mark in stated.marks for part in ("--shadow", mark)]
    arguments += ["--pick", str(stated.pick)] if stated.pick else []
    try:
        result = _run(arguments, SECONDS)
    except subprocess.TimeoutExpired as error:
        raise AnswerError(f"{command} took more than {SECONDS} seconds.") from error
    except OSError as error:
        raise AnswerError(f"{command} cannot be run: {error.strerror}.") from error
    if result.returncode:
        lines = result.stderr.strip().splitlines() or [f"{command} failed with status {result.returncode}."]
        raise AnswerError(lines[-1].removeprefix("Error: "))
    _check(folder)


def from_service(address: str, key: str, photo: Path, folder: Path, stated: Stated = Stated()) -> None:
    """Send the photo to a service and unpack its answer; raises AnswerError."""
    base_url = address.strip().rstrip("/")
    headers = _headers(photo, key.strip())
    host = _host(base_url)
    query = {"for": "blender"} | ({"shadow": ";".join(stated.marks)} if stated.marks else {})
    query |= {"pick": str(stated.pick)} if stated.pick else {}
    try:
        url = f"{base_url}/v1/scene?{urllib.parse.urlencode(query)}"
        request = urllib.request.Request(url, photo.read_bytes(), headers)
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
    return {"Content-Type": _KINDS.get(photo.suffix.lower(), "image/jpeg"), **_authorization(key)}


def _authorization(key: str) -> dict[str, str]:
    if not key:
        return {}
    if not re.fullmatch(r"[\t\x20-\x7e\x80-\xff]+", key):
        raise AnswerError("The API key has characters that no request can carry.")
    return {"Authorization": f"Bearer {key}"}


def _detail(error: urllib.error.HTTPError) -> str:
    """The service's own sentence, if it has one."""
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
