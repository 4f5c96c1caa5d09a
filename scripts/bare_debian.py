"""Run commands as a stranger would: as an ordinary user, in a clone, on Debian's smallest system.

    python -m scripts.bare_debian SUITE FOLDER REPOSITORY COMMAND...

SUITE is trixie (Debian 13, Python 3.13) or bookworm (12, 3.11); the system is unpacked in FOLDER, which is new. In it
are Python with venv, git and certificates, and of this machine nothing but what a package client needs to reach its
registry. Each COMMAND is a script of bash. The first runs at home, where $ADDRESS is that of REPOSITORY, a folder with
a repository; the others in `lighting`, its clone. Prints how long each took, and the size of the virtual environment.

A tar file of the system stays in ~/.cache/outdoor-lighting (300 MB); delete it to have newer packages. What is mounted
goes with this process, and no other one ever sees it. Needs root, mmdebstrap and mount namespaces: without them, one
line and exit status 0. Else the status of the command that failed.
"""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

from scripts.build_image import UnavailableError, enter_mount_namespace, make_debian, network_environment

PACKAGES = ("python3", "python3-venv", "git", "ca-certificates")
USER = 1000
HOME = "/home/you"
ADDRESS = "file:///srv/repository"
_PROXIES = ("HTTP_PROXY", "HTTPS_PROXY", "NO_PROXY", "http_proxy", "https_proxy", "no_proxy")


def main() -> None:
    """Make the system, run the commands."""
    suite, folder, repository, *commands = sys.argv[1:]
    cache = Path.home() / ".cache/outdoor-lighting"
    try:
        enter_mount_namespace("mmdebstrap")
        cache.mkdir(parents=True, exist_ok=True)
        tar = make_debian(cache, suite, PACKAGES)
    except UnavailableError as reason:
        print(f"skipped: no bare {suite} can be made here: {reason}")
        return
    root = Path(folder).absolute()
    root.mkdir()
    sys.exit(run_commands(root, prepare(root, tar, Path(repository)), commands))


def prepare(root: Path, tar: Path, repository: Path) -> dict[str, str]:
    """Unpack a system, add a user and a repository, and mount what programs need; returns the user's variables."""
    subprocess.run(["tar", "--extract", "--file", tar, "--directory", root, "--exclude=./dev/*"], check=True)
    _mount("-t", "proc", "proc", root / "proc")
    _mount("--rbind", "/dev", root / "dev")
    with (root / "etc/passwd").open("a", encoding="ascii") as users:
        users.write(f"you:x:{USER}:{USER}::{HOME}:/bin/bash\n")
    shutil.copytree(repository, root / "srv/repository", symlinks=True)
    (root / HOME.lstrip("/")).mkdir(parents=True)
    for owned in (HOME, "/srv"):
        subprocess.run(["chown", "--recursive", f"{USER}:{USER}", root / owned.lstrip("/")], check=True)
    environment = network_environment() | {name: os.environ[name] for name in _PROXIES if name in os.environ}
    for path in {"/etc/resolv.conf", "/etc/hosts", *environment.values()}:
        _share(Path(path), root)
    return environment | {"HOME": HOME, "USER": "you", "LANG": "C.UTF-8", "PATH": "/usr/local/bin:/usr/bin:/bin"}


def _share(path: Path, root: Path) -> None:
    """Show a file or folder of this machine at the same place; what is no such path is left out."""
    if not path.is_absolute() or not path.exists():
        return
    place = root / path.relative_to("/")
    place.parent.mkdir(parents=True, exist_ok=True)
    if path.is_dir():
        place.mkdir(exist_ok=True)
    else:
        place.touch()
    _mount("--bind", path.resolve(), place)


def _mount(*arguments: str | Path) -> None:
    subprocess.run(["mount", *map(str, arguments)], check=True)


def run_commands(root: Path, environment: dict[str, str], commands: list[str]) -> int:
    """Run each command, as the module's text says; the exit status of the first that fails, else 0."""
    variables = [f"{name}={value}" for name, value in environment.items()]
    enter = ["chroot", f"--userspec={USER}:{USER}", str(root), "env", "--ignore-environment", *variables]
    for number, command in enumerate(commands):
        folder = f"{HOME}/lighting" if number else HOME
        began = time.monotonic()
        script = f"cd {folder}; export ADDRESS={ADDRESS}; {command}"
        status = subprocess.run([*enter, "bash", "-euo", "pipefail", "-c", script]).returncode
        venv = root / HOME.lstrip("/") / "lighting/.venv"
        size = sum(path.lstat().st_blocks for path in venv.rglob("*")) * 512 / 1e6
        print(f"   {time.monotonic() - began:.0f} s, a virtual environment of {size:.0f} MB: {command}", flush=True)
        if status:
            return status
    return 0


if __name__ == "__main__":
    main()
