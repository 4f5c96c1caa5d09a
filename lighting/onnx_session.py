"""An ONNX file opened by onnxruntime on the CPU, and the one that a package holds."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from lighting.checksum import verify_checksum
from lighting.errors import ModelError
from lighting.runtime import available_cpus

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_ERRORS_ONLY = 3  # onnxruntime's scale of log severities

# What onnxruntime would change in a graph: this adds in another order, and these take one run longer than they save.
_REORDERING = ("MatMulScaleFusion",)
_SLOW = (
    *("CommonSubexpressionElimination", "ConstantSharing", "GatherSliceToSplitFusion", "QuickGeluFusion"),
    *("Level1_RuleBasedTransformer", "Level2_RuleBasedTransformer"),
    *("FuseFp16InitializerToFp32NodeTransformer", "TransposeOptimizer_CPUExecutionProvider"),
)
OMITTED_CHANGES = (*_REORDERING, *_SLOW)  # of a graph, in a session for one run


class _Port(Protocol):
    @property
    def name(self) -> str: ...
    @property
    def shape(self) -> Sequence[int | str | None]: ...


class _Description(Protocol):
    @property
    def custom_metadata_map(self) -> Mapping[str, str]: ...


class OnnxSession(Protocol):
    """A network that onnxruntime, which has no types, has opened, as far as one is used here."""

    def get_inputs(self) -> Sequence[_Port]: ...
    def get_outputs(self) -> Sequence[_Port]: ...
    def get_modelmeta(self) -> _Description: ...
    def run(
        self, names: Sequence[str] | None, feeds: Mapping[str, "NDArray[np.float32]"]
    ) -> "list[NDArray[np.float32]]": ...


def create_session(file: Path, threads: int, *, for_one_run: bool = False) -> OnnxSession:
    """Open an ONNX file in a session of onnxruntime on the CPU.

    Sessions for one run and for many add in one order, on any number of threads: both block the channels of
    convolutions, and neither packs the weights of products. `export.networks.onnx_export` prepares the graph for it.

    Args:
        file: the network.
        threads: that work on one run; 0 is one for each CPU that this process may use.
        for_one_run: leave weights that are stored as bytes until they are needed, and the graph mostly as it is.

    Raises:
        ModelError: the file is missing, no network, or one of this package's that is damaged.
    """
    onnxruntime = import_onnxruntime()
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads or available_cpus()
    options.inter_op_num_threads = 1
    options.log_severity_level = _ERRORS_ONLY
    if not for_one_run:
        options.add_session_config_entry("session.disable_quant_qdq", "1")  # weights are widened once, not in each run
    options.add_session_config_entry("session.disable_prepacking", "1")
    options.enable_mem_pattern = not for_one_run  # is for further runs
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")  # idle threads leave the CPU to others
    if not file.is_file():
        raise ModelError(f"There is no network at {file}.")
    for part in (file, weights_path(file)):
        verify_checksum(part)
    try:
        disabled = set(OMITTED_CHANGES if for_one_run else _REORDERING)
        providers = ["CPUExecutionProvider"]
        session: OnnxSession = onnxruntime.InferenceSession(
            str(file), options, providers=providers, disabled_optimizers=disabled
        )
    except Exception as error:  # onnxruntime's errors share no public base class
        raise ModelError(f"{file} is not an ONNX network that can be read: {describe_onnx_error(error)}") from error
    return session


def weights_path(network: Path) -> Path:
    """Return where a network's weights lie unless its own file holds them; its graph names this file.

    Args:
        network: the ONNX file.
    """
    return network.with_name(f"{network.name}.data")


def import_onnxruntime() -> Any:
    """Import onnxruntime so that it does not report its use."""
    os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")  # read at import; its wheels report usage otherwise
    import onnxruntime

    return onnxruntime


def describe_onnx_error(error: Exception) -> str:
    """Return the last clause of onnxruntime's message; codes and the path come before it.

    Args:
        error: that onnxruntime raised.
    """
    lines = str(error).strip().splitlines() or [type(error).__name__]
    return lines[0].rsplit("failed:", 1)[-1].strip().rstrip(".") + "."


def packaged_network(folder: Path, name: str) -> Path:
    """Return the one `name`-<version>.onnx in a folder.

    Args:
        folder: of this package.
        name: of the network.

    Raises:
        ModelError: there is none, or a choice.
    """
    files = sorted(folder.glob(f"{name}-*.onnx"))
    if len(files) != 1:
        raise ModelError(f"{folder} must hold exactly one {name}-<version>.onnx; it holds {len(files)}.")
    return files[0]
