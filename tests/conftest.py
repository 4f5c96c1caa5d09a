"""Pictures and a tiny network that several test modules share."""

import gc
import os
import signal
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from hypothesis import settings
from numpy.typing import NDArray
from onnx import GraphProto, NodeProto, TensorProto, helper, numpy_helper
from PIL import ExifTags, Image

from benchmarks.common import register_heif_writer
from lighting.prediction import ModelSpec
from lighting.sun_grid import grid_directions
from tests.helpers import requirements

signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it, and so would children

settings.register_profile("repeatable", deadline=None, derandomize=True, max_examples=60)
settings.load_profile("repeatable")


register_heif_writer()


def pytest_configure(config: pytest.Config) -> None:
    """Also one thread for arrays: those of several workers would wait for each other, and small ones gain nothing."""
    config.pluginmanager.register(requirements)
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    gc.disable()


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop() -> None:
    """What was collected stays to the end: to look through it for cycles, again and again, takes 0.4 s each time."""
    gc.freeze()
    gc.enable()


TINY = ModelSpec(
    name="tiny",
    version="0.0.1",
    width=48,
    height=32,
    mean=(0.5, 0.4, 0.3),
    std=(0.2, 0.25, 0.3),
    sun_grid="rings:3x8",
)


def scene(width: int, height: int) -> NDArray[np.uint8]:
    """A smooth picture (h, w, 3) that looks different each way up: red grows to the right, green downwards."""
    picture = np.full((height, width, 3), 90, np.uint8)
    picture[..., 0] = np.linspace(0, 255, width).round()
    picture[..., 1] = np.linspace(0, 255, height).round()[:, None]
    return picture


def encode(image: Image.Image | NDArray[Any], file_format: str = "JPEG", **options: Any) -> bytes:
    """The bytes of a picture file."""
    picture = image if isinstance(image, Image.Image) else Image.fromarray(image)
    stream = BytesIO()
    picture.save(stream, file_format, **options)
    return stream.getvalue()


def exif(camera: dict[int, Any] | None = None, position: dict[int, Any] | None = None) -> Image.Exif:
    """An EXIF block with those tags about the camera and its position."""
    block = Image.Exif()
    block.get_ifd(ExifTags.IFD.Exif).update(camera or {})
    block.get_ifd(ExifTags.IFD.GPSInfo).update(position or {})
    return block


def munich(**other: Any) -> Image.Exif:
    """What a phone notes on a June morning in Munich, the sun 36 deg high in the east; None leaves a tag out.

    Others are tags of the camera's and the GPS directory; `Make` and its like belong to the main one.
    """
    base, gps = ExifTags.Base, ExifTags.GPS
    camera = {"DateTimeOriginal": "2024:06:01 09:10:00", "OffsetTimeOriginal": "+02:00", "FocalLengthIn35mmFilm": 26}
    position = {
        "GPSLatitudeRef": "N",
        "GPSLatitude": (48.0, 8.0, 15.0),
        "GPSLongitudeRef": "E",
        "GPSLongitude": (11.0, 34.0, 30.0),
        "GPSImgDirectionRef": "M",
        "GPSImgDirection": 60.0,
    }
    tags = {name: value for name, value in {**camera, **position, **other}.items() if value is not None}
    return exif(
        {base[name]: value for name, value in tags.items() if not name.startswith("GPS")},
        {gps[name]: value for name, value in tags.items() if name.startswith("GPS")},
    )


def _constant(name: str) -> list[NodeProto]:
    """Nodes that give each photo the same values: nothing (N, 1, ...) plus the values."""
    return [
        helper.make_node("Reshape", ["nothing", f"{name}_shape"], [f"{name}_nothing"]),
        helper.make_node("Add", [f"{name}_nothing", f"{name}_value"], [name]),
    ]


def write_network(
    path: Path,
    spec: ModelSpec = TINY,
    *,
    cells: int | None = None,
    metadata: dict[str, str] | None = None,
    bias: float = 0.0,
    more: Mapping[str, NDArray[np.float64]] | None = None,
) -> Path:
    """An ONNX file of the real layout: a softmax and six numbers, both linear in the mean color of the canvas.

    `more` are further outputs by name, the same for every photo.
    """
    count = len(grid_directions(spec.sun_grid)) if cells is None else cells
    graph = _graph(spec, count, bias, dict(more or {}))
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=10)
    helper.set_model_props(model, {"spec": spec.to_json()} if metadata is None else metadata)
    onnx.checker.check_model(model)
    path.write_bytes(model.SerializeToString())
    return path


def _graph(spec: ModelSpec, count: int, bias: float, constant: Mapping[str, NDArray[np.float64]]) -> GraphProto:
    """The network, the sun's probability having `count` cells."""
    random = np.random.default_rng(7)
    constants = {
        "sun_weight": random.normal(0, 3, (3, count)),
        "parameter_weight": random.normal(0, 0.05, (3, 6)),
        "parameter_bias": np.array([3.0, 0.1, 4.0, -1.0, 50.0, 0.8]) + bias,
    }
    return helper.make_graph(
        [
            helper.make_node("ReduceMean", ["photo"], ["colour"], axes=[2, 3], keepdims=0),
            helper.make_node("MatMul", ["colour", "sun_weight"], ["logits"]),
            helper.make_node("Softmax", ["logits"], ["sun_probability"], axis=1),
            helper.make_node("MatMul", ["colour", "parameter_weight"], ["slope"]),
            helper.make_node("Add", ["slope", "parameter_bias"], ["parameters"]),
            helper.make_node("ReduceMean", ["slope"], ["mean"], axes=[1], keepdims=1),
            helper.make_node("Sub", ["mean", "mean"], ["nothing"]),
            *(node for name in constant for node in _constant(name)),
        ],
        "tiny",
        [helper.make_tensor_value_info("photo", TensorProto.FLOAT, ["N", 3, spec.height, spec.width])],
        [
            helper.make_tensor_value_info("sun_probability", TensorProto.FLOAT, ["N", count]),
            helper.make_tensor_value_info("parameters", TensorProto.FLOAT, ["N", 6]),
            *(helper.make_tensor_value_info(k, TensorProto.FLOAT, ["N", *v.shape]) for k, v in constant.items()),
        ],
        [numpy_helper.from_array(v.astype(np.float32), k) for k, v in constants.items()]
        + [numpy_helper.from_array(v[None].astype(np.float32), f"{k}_value") for k, v in constant.items()]
        + [numpy_helper.from_array(np.array([-1] + [1] * v.ndim, np.int64), f"{k}_shape") for k, v in constant.items()],
    )


@pytest.fixture(scope="session")
def network(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The path of a tiny network that is valid in every respect."""
    return write_network(tmp_path_factory.mktemp("network") / "outdoor-0.0.1.onnx")


AROUND = np.random.default_rng(5).uniform(0.01, 0.8, (12, 24, 3))
LIT = {  # outputs of a network that says how strong the light is
    "light": np.array([1.9, 1.5, 0.9, 0.4, 0.5, 0.8, 0.2, 0.97]),
    "around": AROUND,
}


@pytest.fixture(scope="session")
def lit_network(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The path of a tiny network that also says how strong the light is and what lies around."""
    return write_network(tmp_path_factory.mktemp("lit") / "outdoor-0.0.2.onnx", more=LIT)


@pytest.fixture
def photo_path(tmp_path: Path) -> Path:
    """A JPEG on disk, 320 x 240."""
    path = tmp_path / "photo.jpg"
    path.write_bytes(encode(scene(320, 240)))
    return path
