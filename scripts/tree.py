"""A Dockerfile's stages as trees of files, built by its own steps without a container engine.

Each stage is an overlay on this machine's Debian with this Python as /usr/local, in place of the base image. The rest
of the machine (/opt, /home, /tmp ...) is hidden, and what the stage adds lies apart from it. Needs root, and a mount
namespace that ends with this process.
"""

import ctypes
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from scripts.dockerfile import Stage, Step, UnsupportedError, context_files, expand

NEW_MOUNTS, NEW_NETWORK = 0x00020000, 0x40000000  # CLONE_NEWNS and CLONE_NEWNET of linux/sched.h

_SYSTEM = ("bin", "etc", "lib", "lib32", "lib64", "libx32", "sbin", "usr", "var")  # what stands for the base image
_BASE_ENVIRONMENT = {
    "PATH": "/usr/local/bin:/usr/local/sbin:/usr/sbin:/usr/bin:/sbin:/bin",
    "LANG": "C.UTF-8",
    "LD_LIBRARY_PATH": "/usr/local/lib",  # a Python that was built for another folder finds its library
}
_OF_THE_NETWORK = ("CERT", "PROXY", "SSL_")  # settings of this machine's network that a build needs too


@dataclass
class Tree:
    """A stage as files."""

    root: Path  # what a process in the stage sees
    layer: Path  # what the stage added to its base
    environment: dict[str, str] = field(default_factory=lambda: dict(_BASE_ENVIRONMENT))
    folder: str = "/"
    user: str = "0"  # UID or UID:GID

    def command(self, argv: list[str], **environment: str) -> list[str]:
        """The command line, for root, that runs `argv` in the tree as its user, without capabilities if it has one."""
        pairs = [f"{name}={value}" for name, value in {**self.environment, **environment}.items()]
        return ["chroot", str(self.root), *self._lowered(), "env", "-i", "-C", self.folder, *pairs, *argv]

    def _lowered(self) -> list[str]:
        if self.user == "0":
            return []
        uid, _, gid = self.user.partition(":")
        identity = [f"--reuid={uid}", f"--regid={gid or uid}", "--clear-groups"]
        return ["setpriv", *identity, "--no-new-privs", "--bounding-set=-all", "--inh-caps=-all"]


def unshare(namespaces: int) -> None:
    """Move this process to namespaces of its own; OSError where that is not allowed."""
    if ctypes.CDLL(None, use_errno=True).unshare(namespaces):
        raise OSError(ctypes.get_errno(), "unshare")


def mount(*arguments: str | Path) -> None:
    """mount(8)."""
    subprocess.run(["mount", *map(str, arguments)], check=True)


def build(stages: list[Stage], context: Path, space: Path) -> Tree:
    """Carry out every step of every stage in folders under `space`; the tree of the last stage."""
    unshare(NEW_MOUNTS)
    mount("--make-rprivate", "/")
    mount("-t", "tmpfs", "-o", "mode=755", "tmpfs", space)
    trees: dict[str, Tree] = {}
    for number, stage in enumerate(stages):
        name = stage.name or "last"
        trees[name] = _base(space / f"{number}-{name}", stage.base)
        for step in stage.steps:
            print(f"{name}: {step.word} {step.value if len(step.value) < 90 else step.value[:87] + '...'}", flush=True)
            _carry_out(step, trees[name], trees, context)
    return trees["last"]


def _base(place: Path, image: str) -> Tree:
    """A tree in which this machine stands in for the image that a FROM names."""
    tree = Tree(place / "root", place / "layer")
    for folder in (tree.root, tree.layer, place / "work"):
        folder.mkdir(parents=True)
    for entry in [*(e for e in Path("/").iterdir() if e.is_dir() and e.name not in _SYSTEM), Path("/usr/local")]:
        hidden = tree.layer / entry.relative_to("/")
        hidden.mkdir(parents=True)
        os.setxattr(hidden, "trusted.overlay.opaque", b"y")
    mount("-t", "overlay", "-o", f"lowerdir=/,upperdir={tree.layer},workdir={place / 'work'}", "overlay", tree.root)
    mount("-t", "proc", "proc", tree.root / "proc")
    mount("--rbind", "/dev", tree.root / "dev")
    mount("--bind", "-o", "ro", "/sys", tree.root / "sys")
    mount("-t", "tmpfs", "-o", "mode=1777", "tmpfs", tree.root / "tmp")
    if image.startswith("python:"):
        _check_python(image)
        mount("--bind", "-o", "ro", sys.base_prefix, tree.root / "usr/local")
    return tree


def _check_python(image: str) -> None:
    wanted = ".".join(image.removeprefix("python:").split(".")[:2])
    if wanted != f"{sys.version_info.major}.{sys.version_info.minor}":
        raise UnsupportedError(f"The image has Python {wanted}; run this check with that version.")
    if sys.base_prefix == "/usr":
        raise UnsupportedError("This check needs a Python that does not lie in /usr itself.")


def _carry_out(step: Step, tree: Tree, trees: dict[str, Tree], context: Path) -> None:
    value = expand(step.value, tree.environment)
    match step.word:
        case "RUN":
            _run(step, tree)
        case "COPY":
            source = trees[step.flags["from"]].root if "from" in step.flags else None
            _copy(value, source, tree, context)
        case "WORKDIR":
            tree.folder = str(PurePosixPath(tree.folder) / value)
            _inside(tree, tree.folder).mkdir(parents=True, exist_ok=True)
        case "ENV" | "ARG":
            tree.environment |= {name: expand(text, tree.environment) for name, text in step.pairs.items()}
        case "USER":
            tree.user = value
        case _:  # what is for the engine alone
            pass


def _run(step: Step, tree: Tree) -> None:
    network = {name: value for name, value in os.environ.items() if any(w in name.upper() for w in _OF_THE_NETWORK)}
    argv = step.argv if step.value.startswith("[") else ["/bin/sh", "-c", step.value]
    done = subprocess.run(tree.command(argv, HOME="/root", **network), capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"Line {step.line}: RUN ended with {done.returncode}.\n{done.stdout}{done.stderr}")


def _copy(value: str, source: Path | None, tree: Tree, context: Path) -> None:
    """Carry out COPY: a folder's contents go into the target; so do files, under their names, if it ends in a slash."""
    *names, target = value.split()
    goal = _inside(tree, str(PurePosixPath(tree.folder) / target))
    for name in names:
        if source is None:
            _copy_from_context(name, goal, context, into=target.endswith("/"))
        else:
            shutil.copytree(source / name.lstrip("/"), goal, symlinks=True, dirs_exist_ok=True)


def _copy_from_context(name: str, goal: Path, context: Path, *, into: bool) -> None:
    chosen = [file for file in context_files(context) if file.is_relative_to(name)]
    if not chosen:
        raise FileNotFoundError(f"COPY: the context holds no {name}.")
    for file in chosen:
        inner = file.relative_to(name)
        place = goal / file.name if inner == Path() and into else goal / inner
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(context / file, place)


def _inside(tree: Tree, path: str) -> Path:
    return tree.root / path.lstrip("/")
