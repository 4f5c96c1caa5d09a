"""From a 12-megapixel JPEG to a 1024 x 512 EXR: each part compared with its floor, measured in the same run.

    python -m benchmarks.latency [--runs 15] [--cpu] [--against FOLDER]

A floor is what the libraries alone need for the part: Pillow's decoding at reduced scale, Pillow's resizing to the
network's input and onnxruntime's run of the same graph, a small gray picture and its gradient by numpy, a copy of the
map, Pillow's resizing of the photo and of the coarse panorama to the map's scale, its decoding and resizing of the
panorama that lends its detail and a product with the map, OpenEXR's writing of the same array into memory. Every EXR
is a new file: replacing one costs the file system milliseconds. `--against FOLDER` has another checkout make the map by
turns in a warm process of its own, and prints the median ratio of processor time.
The whole is what `lighting envmap` does: the photo's own sky and ground in the answer, and a map with the place. Two
floors are of less than the part does, for numpy's gradient finds no lines and a copy paints no sky. So the whole also
stands beside floors with OpenCV's line segments and with Mitsuba's `sunsky` above the horizon in their place, where
opencv-python-headless and mitsuba are installed (Mitsuba in LLVM mode, where LLVM 15 or newer is found). Then the
command as a process of its own, its peak memory, and what it imports; `python -m benchmarks.processes` measures
processes from a wheel.
"""

import argparse
import io
import re
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from contextlib import ExitStack
from ctypes.util import find_library
from dataclasses import replace
from importlib.util import find_spec
from itertools import count
from pathlib import Path
from statistics import median
from typing import Any

from lighting.start import prepare_process

prepare_process("envmap")  # as the command does, before numpy is imported

import numpy as np
import OpenEXR
from numpy.typing import NDArray
from PIL import Image

from benchmarks.common import (
    ROOT,
    TWELVE_MEGAPIXELS,
    describe_machine,
    make_photo,
    measure_milliseconds,
    measure_peak_memory,
    median_ratio,
    run_lighting,
    take_turns,
    warm_worker,
)
from lighting.calibration import calibrate_from_lines, shrink_to_gray
from lighting.envmap.detail_library import DetailChoice, load_detail_library
from lighting.envmap.projection import photo_camera, size_in_envmap
from lighting.envmap.render import render
from lighting.envmap.surroundings import PhotoContext, render_with_surroundings
from lighting.estimator import Estimator
from lighting.files.exr import write_exr
from lighting.geometry import latlong_directions
from lighting.map_options import MapOptions
from lighting.model import preprocess, resize_to_input
from lighting.photo.reader import TARGET, read_photo
from lighting.photo.sandbox import read_photo_isolated
from lighting.records import Lighting

PARTS = ("decode", "network", "lines", "sky and sun", "place", "detail", "EXR")


def decode_by_pillow(path: Path) -> Image.Image:
    """Pillow's decoding at the scale that read_photo asks for."""
    image = Image.open(path)
    image.draft(None, (TARGET, TARGET * image.height // image.width))
    image.load()
    return image


def compute_gradient(pixels: NDArray[np.uint8]) -> None:
    """The small gray picture of pixels (h, w, 3), and numpy's gradient of it."""
    np.gradient(shrink_to_gray(pixels).astype(np.float32))


def opencv_detector(pixels: NDArray[np.uint8]) -> Callable[[], Any] | None:
    """The small gray picture of pixels (h, w, 3), and OpenCV's line segments in it; None without OpenCV."""
    if find_spec("cv2") is None:
        return None
    import cv2

    detector = cv2.createLineSegmentDetector()
    return lambda: detector.detect(shrink_to_gray(pixels))


def write_by_openexr(image: NDArray[np.float32]) -> None:
    """OpenEXR's writing of the array as half floats in ZIP, into memory."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": image.astype(np.float16)}).write(io.BytesIO())


def enlarge_by_pillow(photo: NDArray[np.uint8], size: tuple[int, int], cells: NDArray[np.float32], height: int) -> None:
    """Pillow's resizing of the photo (h, w, 3), and of cells (R, 2R, 3) to a map of `height` rows."""
    Image.fromarray(photo).resize(size)
    for channel in np.moveaxis(cells, 2, 0):
        Image.fromarray(channel).resize((2 * height, height), Image.Resampling.BILINEAR)


def paint_library_by_pillow(choice: DetailChoice, image: NDArray[np.float32]) -> None:
    """Pillow's decoding and resizing of the panorama that lends a map (H, 2H, 3) its detail, and their product."""
    picture = Image.open(io.BytesIO(load_detail_library().read_picture(choice.index))).convert("RGB")
    image * np.asarray(picture.resize(image.shape[1::-1]), dtype=np.float32)


def mitsuba_evaluator(light: Lighting, directions: NDArray[Any]) -> tuple[str, Callable[[], Any]] | None:
    """Mitsuba's variant, and its evaluation of the same sky and disc in directions (..., 3)."""
    variant = _mitsuba_variant()
    if variant is None:
        return None
    import drjit
    import mitsuba

    mitsuba.set_variant(variant)
    emitter = mitsuba.load_dict({
        "type": "sunsky", "sun_direction": _z_up(light.sun_direction).tolist(), "turbidity": light.turbidity,
        "albedo": light.ground_albedo, "complex_sun": True,
    })  # fmt: skip
    interaction = drjit.zeros(mitsuba.SurfaceInteraction3f, directions.size // 3)
    towards = -_z_up(directions.reshape(-1, 3)).astype(np.float32)
    interaction.wi = mitsuba.Vector3f(*(np.ascontiguousarray(axis) for axis in towards.T))
    drjit.eval(interaction)

    def evaluate() -> Any:
        return np.array(emitter.eval(interaction))

    return variant, evaluate


def _mitsuba_variant() -> str | None:
    """Mitsuba's LLVM variant if LLVM 19 is installed: with an old one, it ends the process."""
    if find_spec("mitsuba") is None or find_library("LLVM-19") is None:
        return None
    return "llvm_ad_rgb"


def _z_up(vector: Any) -> NDArray[Any]:
    """Our axes in Mitsuba's sky, which has Z up."""
    v = np.asarray(vector)
    return np.stack([v[..., 0], -v[..., 2], v[..., 1]], axis=-1)


def import_profile(command: list[str]) -> dict[str, float]:
    """Milliseconds to import each package, without the packages that it imports."""
    profiled = [sys.executable, "-X", "importtime", "-m", "lighting", *command]
    lines = subprocess.run(profiled, capture_output=True, text=True, check=True).stderr.splitlines()
    spent: defaultdict[str, float] = defaultdict(float)
    for line in lines:
        if answer := re.match(r"import time:\s+(\d+) \|\s+\d+ \|\s+([\w.]+)", line):
            top = answer[2].split(".")[0]
            name = "Python's own" if top in sys.stdlib_module_names or top == "site" else top
            spent[name] += int(answer[1]) / 1000
    return spent


def measure_parts(
    jpeg: Path, folder: Path, height: int, runs: int, clock: Callable[[], float]
) -> tuple[dict[str, float], str | None]:
    """Milliseconds of the whole, of each part, of its floor as "PART floor", and Mitsuba's variant."""
    estimator = Estimator()
    photo = read_photo(jpeg)
    tensor = preprocess(photo, estimator.model.spec)
    prediction = estimator.model.predict(tensor)[0]
    estimate = estimator(photo)
    light = estimate.lighting
    context = PhotoContext(photo.pixels, estimate.surroundings)
    image = render_with_surroundings(light, context, height, sun=True)
    detailed = estimate.context()
    assert estimate.surroundings is not None
    assert detailed is not None
    coarse, size = estimate.surroundings, size_in_envmap(photo_camera(light, *photo.pixels.shape[1::-1]), height)
    exr = (folder / f"{number}.exr" for number in count())

    def whole() -> None:
        estimator(read_photo(jpeg)).render(MapOptions(height, sun=True)).write(next(exr))

    directions = latlong_directions(height)
    mitsuba, above = mitsuba_evaluator(light, directions), mitsuba_evaluator(light, directions[: height // 2])
    work: dict[str, Callable[[], Any]] = {
        "whole": whole,
        "decode": lambda: read_photo(jpeg),
        "decode floor": lambda: decode_by_pillow(jpeg),
        "decode here": lambda: read_photo(jpeg.read_bytes()),
        "decode apart": lambda: read_photo_isolated(jpeg.read_bytes()),
        "network": lambda: estimator(photo),
        "network floor": lambda: (
            resize_to_input(photo, estimator.model.spec),
            estimator.model.session.run(None, {"photo": tensor}),
        ),
        "lines": lambda: calibrate_from_lines(prediction, shrink_to_gray(photo.pixels)),
        "lines floor": lambda: compute_gradient(photo.pixels),
        "sky and sun": lambda: render(light, height, sun=True),
        "sky and sun floor": image.copy,
        "place": lambda: render_with_surroundings(light, context, height, sun=True),
        "place floor": lambda: enlarge_by_pillow(photo.pixels, size, coarse, height),
        "detail": lambda: render_with_surroundings(light, replace(detailed), height, sun=True),
        "detail floor": lambda: paint_library_by_pillow(detailed.own_choice, image),
        "EXR": lambda: write_exr(next(exr), image, light),
        "EXR floor": lambda: write_by_openexr(image),
    }
    if segments := opencv_detector(photo.pixels):
        work["opencv"] = segments
    if mitsuba and above:
        work |= {"mitsuba": mitsuba[1], "mitsuba above": above[1]}
    times = measure_milliseconds(work, runs, clock)
    times["detail"] -= times["place"]
    times["place"] -= times["sky and sun"]  # which it paints first
    times["network"] -= times["lines"]  # whose answer holds them
    return times, mitsuba[0] if mitsuba else None


def print_parts(times: dict[str, float], variant: str | None) -> None:
    """The table of parts and floors, and the three ratios that matter."""
    print(f"{'':<14}{'ours':>9}{'floor':>9}   ms")
    for part in PARTS:
        print(f"{part:<14}{times[part]:9.1f}{times[f'{part} floor']:9.1f}")
    floors = sum(times[f"{part} floor"] for part in PARTS)
    print(f"{'whole':<14}{times['whole']:9.1f}{floors:9.1f}   {times['whole'] / floors:.2f} times the floors")
    isolated = times["decode apart"] - times["decode here"]
    print(f"decoding in a process of its own, as the service does: {isolated:+.1f} ms")
    if "opencv" in times:
        print(f"OpenCV's line segments of the same picture, without a camera by them: {times['opencv']:.1f} ms")
    if variant:
        for name, which in (("mitsuba", "all directions of the map"), ("mitsuba above", "those above the horizon")):
            ratio = times[name] / times["sky and sun"]
            print(f"Mitsuba's sunsky, {variant}, {which}: {times[name]:.1f} ms, {ratio:.2f} times our map")
    else:
        print("Mitsuba's sunsky: not measured; it needs mitsuba and LLVM 15 or newer")
    if variant and "opencv" in times:
        doing = floors + times["opencv"] - times["lines floor"] + times["mitsuba above"] - times["sky and sun floor"]
        print(f"with those two in place of the floors of lines and sky: {times['whole'] / doing:.2f} times the floors")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--height", type=int, default=512)
    parser.add_argument("--cpu", action="store_true", help="Processor time of all threads, for a busy machine.")
    parser.add_argument("--against", type=Path, metavar="FOLDER", help="A checkout of another version.")
    options = parser.parse_args()
    clock = time.process_time if options.cpu else time.perf_counter
    with tempfile.TemporaryDirectory() as folder:
        jpeg, exr = make_photo(Path(folder) / "photo.jpg"), Path(folder) / "sky.exr"
        width, rows = TWELVE_MEGAPIXELS
        size = f"{width} x {rows} ({jpeg.stat().st_size / 1e6:.1f} MB)"
        print(f"JPEG of {size} to a map of {2 * options.height} x {options.height}")
        print(f"fastest of {options.runs} runs, {'processor' if options.cpu else 'wall'} time; {describe_machine()}\n")
        print_parts(*measure_parts(jpeg, Path(folder), options.height, options.runs, clock))
        if options.against:
            print_pairs(options.against.resolve(), jpeg, Path(folder), options.height, options.runs)
        command = ["envmap", str(jpeg), "-o", str(exr), "--overwrite", "--height", str(options.height)]
        print_process(command, options.runs)


_WHOLE = """
import sys
from pathlib import Path
import lighting
photo, folder, height = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])
estimator = lighting.Estimator()
def job():
    (folder / "pair.exr").unlink(missing_ok=True)
    estimator(lighting.read_photo(photo)).save(folder / "pair.exr", height, sun=True)
"""


def print_pairs(other: Path, jpeg: Path, folder: Path, height: int, runs: int) -> None:
    """The whole by this checkout and by another, each in a warm process, by turns."""
    folders = [folder / name for name in ("ours", "other")]
    for one in folders:
        one.mkdir()
    with ExitStack() as workers:
        works = [
            workers.enter_context(warm_worker(package, _WHOLE, jpeg, one, height))
            for package, one in zip((ROOT, other), folders, strict=True)
        ]
        ours, theirs = take_turns(works, runs)
    ratio = median_ratio(ours, theirs)
    print(f"whole in a warm process: {median(ours):.0f} CPU ms, {ratio:.2f} times the {median(theirs):.0f} of {other}")


def print_process(command: list[str], runs: int) -> None:
    """Print the time of the command in a process of its own, and of its imports."""
    costs = [run_lighting(*command) for _ in range(runs)]
    seconds, busy = min(cost.seconds for cost in costs), min(cost.processor_seconds for cost in costs)
    print(f"\nlighting envmap as a process: {1000 * seconds:.0f} ms, of the processors {1000 * busy:.0f} ms")
    print(f"its peak memory: {measure_peak_memory(*command):.0f} MB")
    print("this is the checkout: modules that are not compiled yet cost 65 ms; benchmarks.processes measures a wheel")
    profile = import_profile(command)
    print(f"of that importing, as python -X importtime sees it: {sum(profile.values()):.0f} ms")
    for name, spent in sorted(profile.items(), key=lambda item: -item[1])[:8]:
        print(f"  {name:<14}{spent:7.1f} ms")


if __name__ == "__main__":
    main()
