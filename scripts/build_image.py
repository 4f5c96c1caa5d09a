"""The Dockerfile, built by Debian's `buildah` without a daemon and without a registry.

No registry gives the base images to a build without a network, so one base is made of Debian packages by `mmdebstrap`
and stands for all of them. What pip needs to reach its index on this machine goes to the stages that build, never to
the last one. Needs Linux and root.
"""

import ast
import ctypes
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

NEW_MOUNTS, NEW_NETWORK = 0x00020000, 0x40000000  # CLONE_NEWNS and CLONE_NEWNET of linux/sched.h

_SUITE = "bookworm"
_PACKAGES = ("python3", "python-is-python3", "python3-pip", "ca-certificates", "netbase", "tzdata")
_LEFT_OUT = ("/usr/share/doc/*", "/usr/share/locale/*", "/usr/share/man/*")
_PATH = "/usr/local/bin:/usr/local/sbin:/usr/sbin:/usr/bin:/sbin:/bin"
_BASE = "localhost/base"
_OF_PIP = ("index-url", "extra-index-url", "trusted-host", "proxy", "cert", "client-cert", "timeout")
_OF_ENVIRONMENT = ("REQUESTS_CA_BUNDLE", "SSL_CERT_DIR", "SSL_CERT_FILE")


class UnavailableError(Exception):
    """This machine cannot build an image; the message says why."""


@dataclass(frozen=True)
class Engine:
    """`buildah` with a storage of its own."""

    storage: Path

    def argv(self, *arguments: str) -> list[str]:
        """The command line of one of buildah's commands."""
        storage = ["--root", str(self.storage / "root"), "--runroot", str(self.storage / "run")]
        return ["buildah", *storage, "--storage-driver", "vfs", *arguments]

    def run(self, *arguments: str, text: str = "") -> str:
        """Carry out one of buildah's commands, `text` as its input; what it printed. RuntimeError if it fails."""
        return _run(self.argv(*arguments), text)

    def build(self, context: Path, dockerfile: str, *options: str) -> None:
        """Build a Dockerfile's text, as Docker's own format, which knows health checks."""
        self.run(
            "bud", "--isolation", "chroot", "--format", "docker", *options, "-f", "-", str(context), text=dockerfile
        )


def _run(argv: list[str], text: str = "") -> str:
    result = subprocess.run(argv, input=text, capture_output=True, text=True)
    if result.returncode:
        lines = (result.stdout + result.stderr).strip().splitlines()[-30:]
        raise RuntimeError("\n".join([f"{argv[0]} ended with {result.returncode}:", *lines]))
    return result.stdout


def unshare(namespaces: int) -> None:
    """Move this process to namespaces of its own; OSError where that is not allowed."""
    if ctypes.CDLL(None, use_errno=True).unshare(namespaces):
        raise OSError(ctypes.get_errno(), "unshare")


def enter_mount_namespace(*programs: str) -> None:
    """Keep what this process mounts to itself; UnavailableError where that, or one of the programs, is missing."""
    if os.geteuid():
        raise UnavailableError("it needs root")
    if lacking := [name for name in programs if not shutil.which(name)]:
        raise UnavailableError(f"there is no {' and no '.join(lacking)}")
    try:
        unshare(NEW_MOUNTS)
        subprocess.run(["mount", "--make-rprivate", "/"], check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        raise UnavailableError("it needs mount namespaces") from None


def load_base(engine: Engine, cache: Path) -> None:
    """Give the engine the base image, and run a program in it; UnavailableError if that does not work here."""
    try:
        tar = make_debian(cache, _SUITE, _PACKAGES, [f"--dpkgopt=path-exclude={pattern}" for pattern in _LEFT_OUT])
        recipe = f'FROM scratch\nADD {tar.name} /\nENV PATH={_PATH}\nRUN ["python", "--version"]\n'
        engine.build(cache, recipe, "--tag", _BASE)
    except RuntimeError as error:
        raise UnavailableError(_last_words(error)) from error


def _last_words(error: RuntimeError) -> str:
    """What a failed program was, and its own reason."""
    first, *lines = str(error).splitlines()
    return f"{first} {next((line for line in lines if line.startswith('E: ')), lines[-1] if lines else '')}"


def make_debian(cache: Path, suite: str, packages: Sequence[str], options: Sequence[str] = ()) -> Path:
    """Debian's smallest system with those packages as a tar file, of earlier if there is one.

    Args:
        cache: folder that keeps it.
        suite: code name of the release.
        packages: by Debian's names.
        options: of mmdebstrap.

    Raises:
        UnavailableError: mmdebstrap cannot make it here.
    """
    argv = ["--quiet", "--variant=minbase", *options, f"--include={','.join(packages)}", suite]
    tar = cache / f"{suite}-{hashlib.sha256(repr(argv).encode()).hexdigest()[:8]}.tar"
    if not tar.exists():
        part = tar.with_suffix(".part.tar")
        part.unlink(missing_ok=True)
        try:
            _run(["mmdebstrap", *_apt_proxies(), *argv, str(part), *_mirrors(suite)])
        except RuntimeError as error:
            raise UnavailableError(_last_words(error)) from error
        part.replace(tar)
    return tar


def _mirrors(suite: str) -> list[str]:
    """This machine's own mirrors of the suite; with none, mmdebstrap knows Debian's."""
    line = "deb $(REPO_URI) $(RELEASE) $(COMPONENT)"
    printed = _run(["apt-get", "indextargets", "--format", line, "Created-By: Packages", "Origin: Debian"])
    return sorted({line for line in printed.splitlines() if line.split()[2].startswith(suite)})


def _apt_proxies() -> list[str]:
    names = [f"Acquire::{scheme}::Proxy" for scheme in ("http", "https")]
    printed = _run(["apt-config", "dump", "--no-empty", "--format", '%f "%v"%n', *names])
    return [f"--aptopt={line}" for line in printed.splitlines() if line]


def replace_bases(dockerfile: str, environment: dict[str, str]) -> str:
    """The Dockerfile with the one base in place of every FROM; stages that have a name, which build, get ENVs."""
    pairs = "".join(f"\nENV {name}={json.dumps(value)}".replace("$", r"\$") for name, value in environment.items())
    named = re.sub(
        r"^FROM \S+( AS \S+)$", lambda match: f"FROM {_BASE}{match[1]}{pairs}", dockerfile, flags=re.MULTILINE
    )
    return re.sub(r"^FROM \S+$", f"FROM {_BASE}", named, flags=re.MULTILINE)


def network_environment() -> dict[str, str]:
    """How pip reaches its index from here: proxies, mirrors and certificates, as variables.

    Indexes that are folders are left out: a build has no such folder.
    """
    pip = _pip_settings(_run([sys.executable, "-m", "pip", "config", "list"]))
    found = {f"PIP_{name.upper().replace('-', '_')}": pip.get(name) for name in _OF_PIP}
    found |= {name: os.environ.get(name) for name in _OF_ENVIRONMENT}
    return {name: value for name, value in found.items() if value and "file:" not in value}


def _pip_settings(listed: str) -> dict[str, str]:
    """The settings that `pip config list` prints as section.name='value'; the environment's count most."""
    lines = [re.match(r"(global|install|:env:)\.([a-z-]+)=(.*)$", line) for line in listed.splitlines()]
    sections = ("global", "install", ":env:")
    matches = sorted((match for match in lines if match), key=lambda match: sections.index(match[1]))
    return {match[2]: str(ast.literal_eval(match[3])) for match in matches}


def shared_files(environment: dict[str, str]) -> list[str]:
    """The files and folders that the variables name, as buildah's options that show them to the stages."""
    paths = sorted({value for value in environment.values() if value.startswith("/") and Path(value).exists()})
    return [f"--volume={path}:{path}:ro" for path in paths]


def build_image(engine: Engine, context: Path, tag: str, *arguments: str) -> None:
    """Build the context's Dockerfile on the base, with build arguments NAME=VALUE; RuntimeError if a step fails."""
    dockerfile = (context / "Dockerfile").read_text(encoding="utf-8")
    environment = network_environment()
    shared = shared_files(environment)
    options = [*shared, *(f"--build-arg={argument}" for argument in arguments)]
    engine.build(context, replace_bases(dockerfile, environment), "--pull=never", *options, "--tag", tag)
