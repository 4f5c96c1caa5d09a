"""The network: an ONNX file that carries its own description, run by onnxruntime.

Input `photo`, float32 (N, 3, H, W), is what `preprocess` makes. Output `sun_probability`, float32 (N, G), sums to 1
over the cells of the sun grid; output `parameters`, float32 (N, 6), holds PARAMETERS in final units. Further outputs
are optional. `light`, float32 (N, 8), holds _LIGHT_OUTPUT in final units; `around`, float32 (N, 12, 24, 3), the
radiance of the surroundings without the sun. `segments`, float32 (N, H/8, W/8, 10), holds the probabilities of what the
canvas shows. The metadata key `spec` holds a ModelSpec as JSON.
"""

import os
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lighting.checksum import DATA_FOLDER
from lighting.errors import ErrorCode, ModelError, ParameterError
from lighting.geometry import fit_in_box
from lighting.onnx_session import OnnxSession, create_session, describe_onnx_error, packaged_network, weights_path
from lighting.prediction import CELL_PIXELS, Light, ModelSpec, Prediction, SurfaceClass
from lighting.records import SURROUNDINGS_SHAPE
from lighting.sun_grid import grid_directions

PARAMETERS = ("turbidity", "exposure", "camera_elevation", "camera_roll", "vertical_fov", "sun_visibility")
# Of output `light`: irradiances in the photo's linear units, then two shares.
_LIGHT_OUTPUT = ("sun_red", "sun_green", "sun_blue", "sky_red", "sky_green", "sky_blue", "cover", "suitable")
OUTPUTS = ("sun_probability", "parameters")
_OPTIONAL_OUTPUTS = ("light", "around", "segments")  # of which `around` needs `light`
MODEL_CARD, METRICS = "MODEL_CARD.md", "metrics.json"  # beside a network's file; a user's may have neither


class Picture(Protocol):
    """What the network sees, such as a Photo."""

    @property
    def pixels(self) -> NDArray[np.uint8]:
        """(h, w, 3) sRGB, upright; perhaps fewer than in the file."""

    @property
    def width(self) -> int:
        """Columns in the file, pixels."""

    @property
    def height(self) -> int:
        """Rows in the file, pixels."""


class Model:
    """A loaded network; one may be shared by several threads."""

    def __init__(self, session: OnnxSession, spec: ModelSpec) -> None:
        self.session = session
        self.spec = spec
        names = {port.name for port in session.get_outputs()}
        self.outputs = (*OUTPUTS, *(name for name in _OPTIONAL_OUTPUTS if name in names))

    @classmethod
    def load(
        cls, path: str | os.PathLike[str] | None = None, threads: int = 0, *, for_one_photo: bool = False
    ) -> "Model":
        """Read the network in an ONNX file.

        A model for one photo is loaded sooner and is slower from the second photo on. Both give the same answer to the
        last bit, with any number of threads.

        Args:
            path: the file; None is the network in this package.
            threads: that work on one photo; 0 is one for each CPU that this process may use.
            for_one_photo: whether it is to run once.

        Raises:
            ModelError: the file is missing, damaged, or of another layout than this module's.
        """
        if not isinstance(path, str | os.PathLike | None):
            raise ModelError(f"A network is read from a path, not {type(path).__name__}.", code=ErrorCode.WRONG_TYPE)
        file = packaged_model() if path is None else Path(path)
        return cls.from_session(create_session(file, threads, for_one_run=for_one_photo), file)

    @classmethod
    def from_session(cls, session: OnnxSession, file: Path) -> "Model":
        """Make the network of an open session.

        Args:
            session: an onnxruntime.InferenceSession.
            file: that it was opened from, for errors.

        Raises:
            ModelError: the file's layout is not this module's.
        """
        metadata = session.get_modelmeta().custom_metadata_map
        if "spec" not in metadata:
            raise ModelError(f"{file} is not a lighting network: its metadata has no 'spec'.")
        spec = ModelSpec.from_json(metadata["spec"])
        _check_layout(session, spec, file)
        return cls(session, spec)

    def predict(self, batch: NDArray[np.float32]) -> list[Prediction]:
        """Run the network on a batch of photos, and return its prediction for each.

        Args:
            batch: (N, 3, H, W), as `preprocess` returns it; N may be 0.

        Raises:
            ValueError: the batch has another shape.
            ModelError: the network fails, or its answer is none.
        """
        height, width = self.spec.height, self.spec.width
        if batch.ndim != 4 or batch.shape[1:] != (3, height, width):
            raise ValueError(f"The network takes a batch of shape (N, 3, {height}, {width}), not {batch.shape}.")
        if len(batch) == 0:
            return []
        outputs = self._run(batch)
        return [_prediction(self.spec, dict(zip(self.outputs, row, strict=True))) for row in zip(*outputs, strict=True)]

    def predict_one(self, photo: Picture) -> Prediction:
        """Run the network on one photo.

        Args:
            photo: of any size.

        Raises:
            ModelError: the network fails, or its answer is none.
        """
        return self.predict(preprocess(photo, self.spec))[0]

    def _run(self, batch: NDArray[np.float32]) -> list[NDArray[np.float32]]:
        try:
            outputs: list[NDArray[np.float32]] = self.session.run(self.outputs, {"photo": batch})
        except Exception as error:  # onnxruntime's errors share no public base class
            raise ModelError(f"The network failed: {describe_onnx_error(error)}") from error
        shapes = _shapes(self.spec)
        actual, expected = [o.shape for o in outputs], [(len(batch), *shapes[name]) for name in self.outputs]
        if actual != expected:
            raise ModelError(f"The network answered in shapes {actual}, not {expected}.")
        if not all(np.isfinite(o).all() for o in outputs):
            raise ModelError("The network's answer is not finite.")
        return outputs


def model_or_packaged(model: object) -> Model:
    """Return a Model, or for None the one in this package.

    Args:
        model: what a caller passed.

    Raises:
        ModelError: the network in this package cannot be read.
        ParameterError: it is neither.
    """
    if model is None:
        return Model.load()
    if not isinstance(model, Model):
        sentence = f"A Model is needed, not {type(model).__name__}; in lighting.model, Model.load reads a file."
        raise ParameterError(sentence, code=ErrorCode.WRONG_TYPE)
    return model


def packaged_model() -> Path:
    """Return the network in this package.

    Raises:
        ModelError: there is not exactly one.
    """
    return packaged_network(DATA_FOLDER, "outdoor")


def network_sha256(network: Path) -> str:
    """Return the SHA-256, in hex, of a network's file and of the weights beside it, if they lie there.

    Args:
        network: the ONNX file.
    """
    import hashlib  # 2 ms, which a command for one photo is spared

    weights = weights_path(network)
    digest = hashlib.sha256(network.read_bytes())
    if weights.is_file():
        digest.update(weights.read_bytes())
    return digest.hexdigest()


def _shapes(spec: ModelSpec) -> dict[str, tuple[int, ...]]:
    """The shape of each output for one photo."""
    return {
        "sun_probability": (len(grid_directions(spec.sun_grid)),),
        "parameters": (len(PARAMETERS),),
        "light": (len(_LIGHT_OUTPUT),),
        "around": SURROUNDINGS_SHAPE,
        "segments": (spec.height // CELL_PIXELS, spec.width // CELL_PIXELS, len(SurfaceClass)),
    }


def _check_layout(session: OnnxSession, spec: ModelSpec, file: Path) -> None:
    actual = {port.name: port.shape[1:] for port in [*session.get_inputs(), *session.get_outputs()]}
    optional = [name for name in _OPTIONAL_OUTPUTS if name in actual]
    shapes = _shapes(spec)
    expected = {"photo": [3, spec.height, spec.width], **{name: list(shapes[name]) for name in (*OUTPUTS, *optional)}}
    if actual != expected or ("around" in optional and "light" not in optional):
        raise ModelError(f"{file} is a network of another layout: {actual} where {expected} is expected.")


def _prediction(spec: ModelSpec, outputs: dict[str, NDArray[np.float32]]) -> Prediction:
    parameters = dict(zip(PARAMETERS, map(float, outputs["parameters"]), strict=True))
    light = _light(outputs["light"], outputs.get("around")) if "light" in outputs else None
    sun, segments = outputs["sun_probability"], outputs.get("segments")
    return Prediction(spec=spec, sun_probability=sun, **parameters, light=light, segments=segments)


def _light(row: NDArray[np.float32], panorama: NDArray[np.float32] | None) -> Light:
    """The Light in a row of the outputs, with every value in its range."""
    positive = np.maximum(row.astype(np.float64), 0.0)
    cover, suitable = np.minimum(positive[6:], 1.0)
    surroundings = None if panorama is None else np.maximum(panorama, np.float32(0))
    return Light(positive[:3], positive[3:6], float(cover), float(suitable), surroundings)


# The photo as the input.


def fit_size(width: int, height: int, spec: ModelSpec) -> tuple[int, int]:
    """The largest (width, height) of the photo's aspect ratio inside the network's canvas, at least 1 x 1.

    Args:
        width: of the photo, pixels.
        height: of the photo, pixels.
        spec: of the network.
    """
    return fit_in_box(width, height, spec.width, spec.height)


def pad_to_input(pixels: NDArray[np.uint8], spec: ModelSpec) -> NDArray[np.float32]:
    """Canvas (3, H, W) with the normalised pixels at its center, and 0, the mean color, beside them.

    An odd margin puts the extra row or column after the photo.

    Args:
        pixels: (h, w, 3) sRGB, no larger than the canvas, else ValueError.
        spec: of the network.
    """
    height, width = pixels.shape[:2]
    if width > spec.width or height > spec.height:
        raise ValueError(f"{width} x {height} pixels do not fit the canvas of {spec.width} x {spec.height}.")
    top, left = (spec.height - height) // 2, (spec.width - width) // 2
    canvas = np.zeros((3, spec.height, spec.width), dtype=np.float32)
    inside = canvas[:, top : top + height, left : left + width]
    mean, std = (np.asarray(value, dtype=np.float32)[:, None, None] for value in (spec.mean, spec.std))
    np.multiply(pixels.transpose(2, 0, 1), 1 / (np.float32(255.0) * std), out=inside)
    inside -= mean / std
    return canvas


def resize_to_input(photo: Picture, spec: ModelSpec) -> NDArray[np.uint8]:
    """The photo's pixels (h, w, 3) sRGB resized without aliasing to `fit_size`.

    Args:
        photo: of any size.
        spec: of the network.
    """
    from PIL import Image

    size = fit_size(photo.width, photo.height, spec)
    return np.asarray(Image.fromarray(photo.pixels).resize(size, Image.Resampling.HAMMING, reducing_gap=1.0))


def preprocess(photo: Picture, spec: ModelSpec) -> NDArray[np.float32]:
    """The network's input (1, 3, H, W): the resized photo on its canvas.

    Args:
        photo: of any size.
        spec: of the network.
    """
    return pad_to_input(resize_to_input(photo, spec), spec)[None]
