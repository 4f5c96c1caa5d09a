"""The networks in torch, the runs that trained them, and the ONNX file that ships."""

from export.networks.averaging import merge
from export.networks.checkpoints import CHECKPOINT, averaged_weights, check_new, read_checkpoint, read_network
from export.networks.layers import Said
from export.networks.network import build, load_weights
from export.networks.onnx import write_onnx
from export.networks.parameters import LIGHT, binned, decode, encode, expected
from export.networks.runs import RECORD, history, read_record, read_spec
from export.networks.specs import TARGET_WIDTH, specs

__all__ = [
    "CHECKPOINT",
    "LIGHT",
    "RECORD",
    "TARGET_WIDTH",
    "Said",
    "averaged_weights",
    "binned",
    "build",
    "check_new",
    "decode",
    "encode",
    "expected",
    "history",
    "load_weights",
    "merge",
    "read_checkpoint",
    "read_network",
    "read_record",
    "read_spec",
    "specs",
    "write_onnx",
]
