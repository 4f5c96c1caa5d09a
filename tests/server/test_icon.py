"""The icon that browsers ask for."""

from io import BytesIO

from PIL import Image
from starlette.testclient import TestClient


def test_browsers_get_a_picture(client: TestClient) -> None:
    answer = client.get("/favicon.ico")
    assert (answer.status_code, answer.headers["content-type"]) == (200, "image/png")
    assert Image.open(BytesIO(answer.content)).size == (32, 32)
    assert "max-age" in answer.headers["cache-control"]
