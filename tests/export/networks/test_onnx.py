"""The ONNX file against torch."""

import json
import shutil
from pathlib import Path

import numpy as np
import onnx
import pytest

from export.networks.averaging import merge
from export.networks.checkpoints import read_network
from export.networks.onnx import ROUNDED, parity, write_onnx
from export.networks.runs import read_spec
from export.networks.served import Served
from lighting.errors import LightingError
from lighting.model import Model, weights_path


def test_onnx_and_torch_agree(trained: Path, trained_network: Path) -> None:
    model = Model.load(trained_network)
    metadata = model.session.get_modelmeta().custom_metadata_map
    assert parity(Served([read_network(trained)], read_spec(trained).sun_grid, 1.3).eval(), trained_network) < ROUNDED
    assert float(metadata["parity"]) < ROUNDED
    assert metadata["license"] == "Apache-2.0"
    assert "16 crops" in model.spec.training_data
    (settings,) = json.loads(metadata["training"])
    assert [(run["crops"], run["learning_rate"], run["commit"]) for run in settings] == [(16, 8e-4, metadata["commit"])]
    assert str(trained) not in metadata["training"]
    for count in (1, 3):
        answers = model.predict(np.zeros((count, 3, model.spec.height, model.spec.width), np.float32))
        assert [a.sun_probability.sum() for a in answers] == pytest.approx([1.0] * count, rel=1e-5)


def test_two_runs_answer_together_in_one_file(trained: Path, trained_network: Path, tmp_path: Path) -> None:
    """The same run twice says what it says alone, and nothing is computed or stored twice."""
    target = tmp_path / "two.onnx"
    write_onnx([trained, trained], target, temperature=1.3, version="2.0.0")
    one, two = Model.load(trained_network), Model.load(target)
    photo = np.random.default_rng(0).normal(size=(2, 3, 224, 224)).astype(np.float32)
    for a, b in zip(one.predict(photo), two.predict(photo), strict=True):
        np.testing.assert_allclose(a.sun_probability, b.sun_probability, rtol=1e-3)
    assert two.spec.version == "2.0.0"
    assert weights_path(target).stat().st_size < 1.05 * weights_path(trained_network).stat().st_size
    files = [onnx.load(path).graph for path in (trained_network, target)]
    assert len(files[1].initializer) == len(files[0].initializer)
    stored = {tensor.data_type for tensor in files[1].initializer}
    assert {onnx.TensorProto.INT8, onnx.TensorProto.FLOAT16} <= stored
    assert not any(node.metadata_props for node in files[1].node)
    assert any(node.op_type == "DequantizeLinear" for node in files[1].node)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["two.onnx", "two.onnx.data"]
    assert target.stat().st_size < weights_path(target).stat().st_size / 5


def test_runs_of_different_networks_do_not_answer_together(trained: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    shutil.copytree(trained, other)
    record = json.loads((other / "config.json").read_text())
    record["spec"]["mean"] = [0.1, 0.2, 0.3]
    (other / "config.json").write_text(json.dumps(record))
    with pytest.raises(LightingError, match="expect different photos"):
        write_onnx([trained, other], tmp_path / "x.onnx", temperature=1.0)
    assert not (tmp_path / "x.onnx").exists()
    with pytest.raises(LightingError, match="have no mean"):
        merge([trained, other], tmp_path / "merged")
    assert not (tmp_path / "merged").exists()


def test_a_wrong_export_is_refused(
    trained: Path, trained_network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file on disk is traced at another temperature than the network that it is compared with."""
    model = onnx.load(trained_network)
    model.ClearField("metadata_props")
    monkeypatch.setattr("export.networks.onnx.trace", lambda *_: model)
    with pytest.raises(LightingError, match="differ"):
        write_onnx([trained], tmp_path / "x.onnx", temperature=3.0)
    assert list(tmp_path.iterdir()) == []
