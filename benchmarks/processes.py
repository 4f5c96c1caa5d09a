"""Commands as processes of an installed wheel: their time, processor time and peak memory.

    python -m benchmarks.processes [COMMAND ...] [--against FOLDER] [--runs 21]

A wheel of this checkout is built and unpacked with compiled modules; its dependencies are those of this environment. A
checkout that Python has not compiled yet takes 65 ms more. With `--against`, a checkout of another version takes turns
with it, and ratios are medians over the pairs. The scene is of a photo of 12 megapixels. `plain script` is what Pillow
and onnxruntime take by their defaults to read the photo and run the network. The last line is what it takes to check
every network and table; a command checks those that it reads, while it loads the network.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import median

from benchmarks.common import (
    EXAMPLE,
    ROOT,
    ProcessCost,
    describe_machine,
    make_photo,
    median_ratio,
    run_apart,
    run_lighting,
    run_python,
)
from lighting.checksum import verify_checksums
from lighting.model import packaged_model

COMMANDS: dict[str, tuple[str, ...]] = {
    "--help": ("--help",),
    "estimate": ("estimate", str(EXAMPLE)),
    "envmap": ("envmap", str(EXAMPLE), "-o", "sky.exr", "-q"),
    "preview": ("preview", str(EXAMPLE), "-o", "preview.png", "--overwrite", "-q"),
    "scene --for blender": ("scene", "photo.jpg", "--for", "blender", "-o", "scene", "--overwrite", "-q"),
    "envmap --height 4096": ("envmap", str(EXAMPLE), "-o", "sky.exr", "-q", "--height", "4096"),
}
_PLAIN_SCRIPT = """
import sys
import numpy as np
import onnxruntime
from PIL import Image
onnxruntime.set_default_logger_severity(3)
session = onnxruntime.InferenceSession(sys.argv[1], providers=["CPUExecutionProvider"])
(port,) = session.get_inputs()
image = Image.open(sys.argv[2]).convert("RGB").resize(port.shape[:1:-1])
session.run(None, {port.name: np.asarray(image, np.float32).transpose(2, 0, 1)[None] / 255})
"""
_FEWER = 5  # times fewer runs of a command that takes seconds
_SECONDS = 2.0  # that one takes


def install_wheel(checkout: Path, folder: Path) -> Path:
    """Build the wheel of a checkout and install it alone below `folder`; returns where it lies."""
    pip, site = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"], folder / "site"
    subprocess.run([*pip, "wheel", "--no-deps", "--wheel-dir", str(folder), str(checkout)], check=True)
    (wheel,) = folder.glob("*.whl")
    subprocess.run([*pip, "install", "--no-deps", "--target", str(site), str(wheel)], check=True)
    return site


def run_process(site: Path, arguments: Sequence[str], folder: Path) -> ProcessCost:
    """Run a `lighting` command of an installed wheel in `folder`."""
    (folder / "sky.exr").unlink(missing_ok=True)  # no file is replaced unasked
    return run_lighting(*arguments, package=site, folder=folder)


def run_pairs(sites: Sequence[Path], arguments: Sequence[str], folder: Path, runs: int) -> list[list[ProcessCost]]:
    """The cost of a command by each installed wheel, in turns; the first runs fill the caches and do not count."""
    first = [run_process(site, arguments, folder) for site in sites]
    if first[0].seconds > _SECONDS:
        runs = max(1, runs // _FEWER)
    turns = [[run_process(site, arguments, folder) for site in sites] for _ in range(runs)]
    return [list(costs) for costs in zip(*turns, strict=True)]


def print_costs(name: str, costs: Sequence[Sequence[ProcessCost]]) -> None:
    """One line: medians of this checkout, and of its ratios to the other."""
    ours = costs[0]
    line = (
        f"{name:<22}{1000 * median(c.seconds for c in ours):8.0f}"
        f"{1000 * median(c.processor_seconds for c in ours):10.0f}{max(c.peak for c in ours):8.0f}"
    )
    if len(costs) > 1:
        wall = median_ratio(*([cost.seconds for cost in column] for column in costs))
        busy = median_ratio(*([cost.processor_seconds for cost in column] for column in costs))
        line += f"{wall:10.2f}{busy:10.2f}{max(c.peak for c in costs[1]):10.0f}"
    print(line, flush=True)


def run_plain_script(runs: int) -> list[ProcessCost]:
    """What Pillow and onnxruntime take of the example; the first run fills the caches and does not count."""
    return [run_python("-c", _PLAIN_SCRIPT, packaged_model(), EXAMPLE) for _ in range(runs + 1)][1:]


def time_checksums(runs: int) -> tuple[float, float]:
    """Seconds and processor seconds of checking every network and table, medians; a command reads some of them."""
    costs = []
    for _ in range(runs + 1):
        began, busy = time.perf_counter(), time.process_time()
        verify_checksums()
        costs.append((time.perf_counter() - began, time.process_time() - busy))
    return median(cost for cost, _ in costs[1:]), median(cost for _, cost in costs[1:])


def main() -> None:
    """Build, measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("commands", nargs="*", metavar="COMMAND", help=f"{', '.join(COMMANDS)}; all by default")
    parser.add_argument("--against", type=Path, metavar="FOLDER", help="A checkout of another version.")
    parser.add_argument("--runs", type=int, default=21)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        checkouts = [ROOT, *([options.against] if options.against else [])]
        folders = [Path(name, str(number)) for number in range(len(checkouts))]
        sites = [install_wheel(checkout, folder) for checkout, folder in zip(checkouts, folders, strict=True)]
        run_apart(make_photo, Path(name, "photo.jpg"))
        print(f"medians of {options.runs} runs from a wheel; {describe_machine()}")
        print(f"{'':<22}{'ms':>8}{'CPU ms':>10}{'MB':>8}{'  x time  x CPU ms  other MB' if options.against else ''}")
        for command in options.commands or COMMANDS:
            print_costs(command, run_pairs(sites, COMMANDS[command], Path(name), options.runs))
    print_costs("plain script", [run_plain_script(options.runs)])
    wall, busy = time_checksums(options.runs)
    print(f"{'checksums of all data':<22}{1000 * wall:8.1f}{1000 * busy:10.1f}")


if __name__ == "__main__":
    main()
