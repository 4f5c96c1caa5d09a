"""The same job under LitServe with its defaults, for benchmarks/load.py: a form with a photo in, an EXR out.

PYTHONPATH=. PYTHON_WITH_LITSERVE benchmarks/litserve_app.py PORT
"""

import sys
from typing import Any

import litserve
import onnxruntime
from fastapi import Request, Response

from lighting.decoding import lighting_from
from lighting.envmap import render
from lighting.files import encode_envmap
from lighting.model import OUTPUTS, PARAMETERS, packaged_model
from lighting.photo import Photo, read_photo, to_tensor
from lighting.records import ModelSpec, Prediction


class EnvmapAPI(litserve.LitAPI):
    """This project's functions around a bare session on the same network."""

    def setup(self, device: str) -> None:
        """Load the network."""
        del device
        self.session = onnxruntime.InferenceSession(str(packaged_model()), providers=["CPUExecutionProvider"])
        self.spec = ModelSpec.from_json(self.session.get_modelmeta().custom_metadata_map["spec"])

    def decode_request(self, request: Request) -> Photo:
        """The photo of the form."""
        return read_photo(request["photo"].file.read())

    def predict(self, photo: Photo) -> bytes:
        """Its environment map as an EXR."""
        probability, parameters = self.session.run(OUTPUTS, {"photo": to_tensor(photo, self.spec)})
        named: dict[str, Any] = dict(zip(PARAMETERS, map(float, parameters[0]), strict=True))
        light = lighting_from(Prediction(spec=self.spec, sun_probability=probability[0], **named))
        return encode_envmap(render(light), light)

    def encode_response(self, output: bytes) -> Response:
        """The EXR as it is."""
        return Response(output, media_type="image/x-exr")


if __name__ == "__main__":
    server = litserve.LitServer(EnvmapAPI())
    server.run(host="127.0.0.1", port=int(sys.argv[1]), generate_client_file=False)
