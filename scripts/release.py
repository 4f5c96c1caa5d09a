"""Build a release: python -m scripts.release [-o dist] [--tag vX.Y.Z]

The folder gets the sdist, the wheel that is built from it, Blender's extension, NOTES.md out of CHANGELOG.md, and
SHA256SUMS. Then the wheel is installed in a clean environment, where README's commands run. Nothing is published.
Without a tag it is a dry run: the newest changes may still lack a version. It needs uv.
"""

import argparse
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from lighting.version import __version__
from scripts import blender_extension
from scripts.book import ROOT, read_code_blocks

NOTES, SUMS = "NOTES.md", "SHA256SUMS"
_SECTION = re.compile(r"^## (.+)\n", re.MULTILINE)
_TRIED = ("try", "command line", "python")  # marks of README's blocks, in their order
_NEEDED = (
    "data",
    "network",
    "answer",
    "scenes",
    "day",
    "files",
    "page",
    "book",
)  # what `lighting doctor` finds in a good wheel


def main() -> None:
    """Build, try and say what is there; what is wrong ends the program with one sentence."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("-o", "--output", type=Path, default=Path("dist"), help="new or empty folder")
    parser.add_argument("--tag", help="of the release, v and the version; without it this is a dry run")
    chosen = parser.parse_args()
    folder: Path = chosen.output.resolve()
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        sys.exit(f"{folder} is not an empty folder.")
    notes = release_notes((ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), __version__, chosen.tag)
    subprocess.run(["uv", "build", "--quiet", "--out-dir", folder, ROOT], check=True)  # the wheel from the sdist
    (wheel,) = folder.glob("*.whl")
    blender_extension.build(folder / blender_extension.release_name())
    (folder / NOTES).write_text(notes, encoding="utf-8")
    try_wheel(wheel)
    (folder / ".gitignore").unlink(missing_ok=True)  # of uv
    files = sorted(path for path in folder.iterdir())
    (folder / SUMS).write_text("".join(f"{_digest(path)}  {path.name}\n" for path in files), encoding="utf-8")
    for path in [*files, folder / SUMS]:
        print(f"{path.stat().st_size / 1e6:8.2f} MB  {path}")


def release_notes(changelog: str, version: str, tag: str | None) -> str:
    """Return the newest section of the changelog, without its heading; SystemExit where it is not of the version.

    Args:
        changelog: the text of CHANGELOG.md.
        version: of the package.
        tag: of the release; None of a dry run, whose changes may be without a version.
    """
    _, heading, body, *_ = _SECTION.split(changelog)
    dated = re.fullmatch(rf"{re.escape(version)} \(\d{{4}}-\d\d-\d\d\)", heading)
    if tag is not None and tag != f"v{version}":
        sys.exit(f"The tag is {tag}, and the package's version is {version}.")
    if not dated and (tag is not None or heading != "Unreleased"):
        sys.exit(f"The newest section of CHANGELOG.md is {heading}; it must be {version} with its date.")
    return body.strip() + "\n"


def try_wheel(wheel: Path) -> None:
    """Install a wheel as README says, in a folder of its own, and run README's commands there.

    Args:
        wheel: its file.
    """
    blocks = {block.mark: block for block in read_code_blocks((ROOT / "README.md").read_text(encoding="utf-8"))}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copytree(ROOT / "examples", folder / "examples")
        shutil.copy(ROOT / "constraints.txt", folder)
        for mark in _TRIED:
            text = blocks[mark].text
            if mark == "try":
                text = re.sub(r"(?<= )\.(?= )", lambda _: str(wheel), text, count=1)
                assert str(wheel) in text, "README's first line installs no folder"
            if blocks[mark].language == "python":
                (folder / "six_lines.py").write_text(text, encoding="utf-8")
                text = "python six_lines.py"
            script = f'export PATH="$PWD/.venv/bin:$PATH"\n{text}'
            own = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
            subprocess.run(["bash", "-euxo", "pipefail", "-c", script], cwd=folder, env=own, check=True)
        bin_folder = folder / ".venv" / "bin"
        told = subprocess.run(
            [bin_folder / "lighting", "doctor", "--json"], cwd=folder, capture_output=True, check=True
        )
        missing = {*_NEEDED} - {finding["name"] for finding in json.loads(told.stdout) if finding["found"]}
        if missing:
            sys.exit(f"The wheel lacks {', '.join(sorted(missing))}: lighting doctor says why.")
        subprocess.run([bin_folder / "lighting-server", "--version"], check=True)


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


if __name__ == "__main__":
    main()
