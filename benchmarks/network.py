"""The network by number format, threads, batch, graph optimisation and provider: size, latency, and accuracy on `val`.

    python -m benchmarks.network [--data FOLDER --labels FILE [--panoramas N]] [--runs 20]

float32 is the network in the package, whose weights are stored small and computed with as floats; float16 and
static int8 (per channel, calibrated on crops of training panoramas, or on the example photos where there is no data)
are made from it on the spot. OpenVINO's provider is measured where the installed onnxruntime has it
(onnxruntime-openvino, in an environment of its own).
"""

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
from numpy.typing import NDArray

from benchmarks.common import ROOT, describe_machine, measure_milliseconds
from lighting.model import Model, packaged_model, preprocess
from lighting.photo.reader import read_photo

Batch = NDArray[np.float32]

LEVELS = {
    "none": onnxruntime.GraphOptimizationLevel.ORT_DISABLE_ALL,
    "basic": onnxruntime.GraphOptimizationLevel.ORT_ENABLE_BASIC,
    "extended": onnxruntime.GraphOptimizationLevel.ORT_ENABLE_EXTENDED,
    "all": onnxruntime.GraphOptimizationLevel.ORT_ENABLE_ALL,
}
CPU, OPENVINO = "CPUExecutionProvider", "OpenVINOExecutionProvider"
BATCHES = (1, 8, 32)
CALIBRATION = 16  # training panoramas, of 8 crops each
_BATCH = 16  # crops that a network is asked about at once


@dataclass(frozen=True)
class Data:
    """Where panoramas and labels are, and how many of `val` are scored."""

    folder: Path
    labels: Path
    panoramas: int | None


def packaged() -> onnx.ModelProto:
    """The packaged network with its small weights widened, as onnxruntime does when it loads it."""
    model = onnx.load(packaged_model())
    values = {t.name: onnx.numpy_helper.to_array(t) for t in model.graph.initializer}
    nodes = []
    for node in model.graph.node:
        if node.op_type not in ("Cast", "DequantizeLinear") or not all(name in values for name in node.input):
            nodes.append(node)
            continue
        stored, *scale = (values.pop(name) for name in node.input)
        wide = stored.astype(np.float32)
        if scale:  # of each row; nothing else of this network is stored as bytes
            wide *= scale[0].reshape(-1, *[1] * (wide.ndim - 1))
        values[node.output[0]] = wide
    del model.graph.node[:], model.graph.initializer[:]
    model.graph.node.extend(nodes)
    model.graph.initializer.extend(onnx.numpy_helper.from_array(value, name) for name, value in values.items())
    return model


def to_float16(target: Path) -> Path:
    """The packaged network with half-precision weights and arithmetic; inputs and outputs stay float32."""
    from onnxruntime.transformers.float16 import convert_float_to_float16

    model = convert_float_to_float16(packaged(), keep_io_types=True)
    onnx.save(model, target)
    return target


def to_int8(target: Path, calibration: Batch) -> Path:
    """The packaged network with convolutions in 8 bits, weights per channel, activations by their calibrated range."""
    from onnxruntime.quantization import CalibrationDataReader, QuantFormat, QuantType, quantize_static
    from onnxruntime.quantization.shape_inference import quant_pre_process

    class Reader(CalibrationDataReader):  # type: ignore[misc]
        def __init__(self) -> None:
            self.left: Iterator[Batch] = iter(np.array_split(calibration, max(1, len(calibration) // 8)))

        def get_next(self) -> dict[str, Batch] | None:
            batch = next(self.left, None)
            return None if batch is None else {"photo": batch}

    wide, prepared = target.with_name("wide.onnx"), target.with_name("prepared.onnx")
    onnx.save(packaged(), wide)
    quant_pre_process(str(wide), str(prepared), skip_symbolic_shape=True)
    quantize_static(
        str(prepared), str(target), Reader(), quant_format=QuantFormat.QDQ, per_channel=True, reduce_range=True,
        activation_type=QuantType.QUInt8, weight_type=QuantType.QInt8, op_types_to_quantize=["Conv", "Add"],
    )  # fmt: skip
    model = onnx.load(target)
    metadata = {entry.key: entry.value for entry in onnx.load(packaged_model()).metadata_props}
    onnx.helper.set_model_props(model, metadata)
    onnx.save(model, target)
    return target


def training_crops(data: Data) -> Batch:
    """Crops of a few training panoramas, as training takes them."""
    from export.crops.crops import load_sources
    from export.data.panoramas import read_index
    from export.evaluation.predictions import protocol_views

    panoramas = read_index(data.folder, "train")
    sources = load_sources(panoramas[:: len(panoramas) // CALIBRATION][:CALIBRATION], data.labels)
    return np.concatenate([batch for batch, _ in _batches(protocol_views(sources, "phone"))])


def example_photos() -> Batch:
    """The example photos and their mirror images."""
    spec = Model.load().spec
    photos = np.concatenate([preprocess(read_photo(path), spec) for path in sorted(ROOT.glob("examples/*.jpg"))])
    return np.concatenate([photos, photos[..., ::-1]])


def median_errors(files: dict[str, Path], data: Data) -> dict[str, float]:
    """Median sun error [deg] on the scored crops of `val`, taken as in CVPR 2017, of each network."""
    from export.crops.crops import load_sources
    from export.data.panoramas import read_index
    from export.evaluation.metrics import median, sun_error
    from export.evaluation.predictions import collect_truth, decode_answers, protocol_views

    models = {name: Model.load(file) for name, file in files.items()}
    predicted: dict[str, list[Any]] = {name: [] for name in files}
    views = protocol_views(load_sources(read_index(data.folder, "val")[: data.panoramas], data.labels), "paper")
    crops = []
    for batch, part in _batches(views):
        crops += part
        for name, model in models.items():
            predicted[name] += model.predict(batch)
    truth = collect_truth([source.panorama for source, _ in views], crops)
    errors = {name: sun_error(truth, decode_answers(predictions, truth.sun)) for name, predictions in predicted.items()}
    return {name: median(error[truth.scored]) for name, error in errors.items()}


def _batches(crops: Any) -> Iterator[tuple[Batch, list[Any]]]:
    """The network's inputs and the crops that they show."""
    from export.crops.crops import crop_panorama
    from lighting.color import tone_map
    from lighting.model import pad_to_input

    spec = Model.load().spec
    for first in range(0, len(crops), _BATCH):
        part = [crop_panorama(source, camera, spec) for source, camera in crops[first : first + _BATCH]]
        yield np.stack([pad_to_input(tone_map(crop.linear), spec) for crop in part]), part


def session(file: Path, threads: int, level: str = "all", spinning: bool = True, provider: str = CPU) -> Any:
    """An onnxruntime session with everything that is compared set."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.graph_optimization_level = LEVELS[level]
    options.log_severity_level = 3
    options.add_session_config_entry("session.intra_op.allow_spinning", "1" if spinning else "0")
    provider_settings = {"device_type": "CPU", "num_of_threads": str(threads)} if provider == OPENVINO else {}
    return onnxruntime.InferenceSession(str(file), options, providers=[provider], provider_options=[provider_settings])


def latencies(sessions: dict[str, Any], batch: int, runs: int) -> dict[str, float]:
    """Milliseconds a photo of each session at a batch size."""
    spec = Model.load().spec
    photos = np.random.default_rng(0).normal(size=(batch, 3, spec.height, spec.width)).astype(np.float32)
    took = measure_milliseconds({name: partial(s.run, None, {"photo": photos}) for name, s in sessions.items()}, runs)
    return {name: value / batch for name, value in took.items()}


def print_formats(files: dict[str, Path], errors: dict[str, float], runs: int) -> None:
    """A row for each format, number of threads and provider."""
    providers = [p for p in (CPU, OPENVINO) if p in onnxruntime.get_available_providers()]
    print(f"{'format':<10}{'provider':<10}{'threads':>8}{'MB':>7}", end="")
    print("".join(f"{f'ms, {batch}':>9}" for batch in BATCHES) + f"{'median':>10}{'moved by':>10}")
    for provider in providers:
        for threads in (1, 2):
            sessions = {name: session(file, threads, provider=provider) for name, file in files.items()}
            took = [latencies(sessions, batch, runs) for batch in BATCHES]
            for name, file in files.items():
                print(f"{name:<10}{provider.removesuffix('ExecutionProvider'):<10}{threads:>8}", end="")
                print(f"{file.stat().st_size / 1e6:7.1f}" + "".join(f"{t[name]:9.2f}" for t in took), end="")
                moved = [errors[name], errors[name] - errors["float32"]] if errors else []
                print("".join(f"{value:9.2f}°" for value in moved))


def print_settings(runs: int) -> None:
    """Graph optimisation and spinning, one photo at a time, as `Model.load` sets the rest."""
    file = packaged_model()
    for threads in (1, 2):
        sessions = {f"optimisation {level}": session(file, threads, level) for level in LEVELS}
        sessions["all, threads sleep between"] = session(file, threads, spinning=False)
        for name, took in latencies(sessions, 1, runs).items():
            print(f"{name:<28}{threads} threads{took:9.2f} ms")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--data", type=Path)
    parser.add_argument("--labels", type=Path)
    parser.add_argument("--panoramas", type=int)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--accuracy-only", action="store_true")
    options = parser.parse_args()
    data = Data(options.data, options.labels, options.panoramas) if options.data else None
    with tempfile.TemporaryDirectory() as folder:
        files = {
            "float32": packaged_model(),
            "float16": to_float16(Path(folder) / "float16.onnx"),
            "int8": to_int8(Path(folder) / "int8.onnx", training_crops(data) if data else example_photos()),
        }
        errors = median_errors(files, data) if data else {}
        print(
            f"onnxruntime {onnxruntime.__version__}, {describe_machine()}; "
            f"ms a photo by batch size, fastest of {options.runs}\n"
        )
        if options.accuracy_only:
            for name, error in errors.items():
                print(f"{name:<10}{files[name].stat().st_size / 1e6:7.1f} MB{error:8.2f}°")
            return
        print_formats(files, errors, options.runs)
        print()
        print_settings(options.runs)


if __name__ == "__main__":
    main()
