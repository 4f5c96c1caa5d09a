"""The same job under LitServe with its defaults, for benchmarks/load.py: a form with a photo in, an EXR out.

PYTHONPATH=. PYTHON_WITH_LITSERVE benchmarks/litserve_app.py PORT
"""

import sys

import litserve
import onnxruntime
from fastapi import Request, Response

from lighting.estimator import Estimator
from lighting.map_options import MapOptions
from lighting.model import Model, packaged_model
from lighting.photo.reader import read_photo
from lighting.prediction import ModelSpec

HEIGHT = 512


class EnvmapAPI(litserve.LitAPI):  # type: ignore[misc]  # known in an environment of its own alone
    """This project's functions around a bare session on the same network."""

    def setup(self, device: str) -> None:
        """Load the network."""
        del device
        options = onnxruntime.SessionOptions()
        options.add_session_config_entry("session.disable_quant_qdq", "1")  # weights are widened once
        session = onnxruntime.InferenceSession(str(packaged_model()), options, providers=["CPUExecutionProvider"])
        spec = ModelSpec.from_json(session.get_modelmeta().custom_metadata_map["spec"])
        self.estimator = Estimator(Model(session, spec))

    def decode_request(self, request: Request) -> bytes:
        """The photo of the form."""
        data: bytes = request["photo"].file.read()
        return data

    def predict(self, data: bytes) -> bytes:
        """Its environment map as an EXR, with the place as the service has it."""
        return self.estimator(read_photo(data)).render(MapOptions(HEIGHT)).encode()

    def encode_response(self, output: bytes) -> Response:
        """The EXR as it is."""
        return Response(output, media_type="image/x-exr")


if __name__ == "__main__":
    server = litserve.LitServer(EnvmapAPI())
    server.run(host="127.0.0.1", port=int(sys.argv[1]), generate_client_file=False)
