"""What the requests of one app share."""

import pytest

from lighting.errors import ModelError, PhotoTooLargeError
from lighting.pipeline import Estimator
from server.problems import ProblemError
from server.service import Service
from server.settings import Settings
from tests.conftest import encode, scene


def test_a_service_without_a_network_is_not_ready_and_says_so() -> None:
    service = Service(Settings())
    assert (service.ready, service.model_name) == (False, "")
    with pytest.raises(ProblemError, match="not loaded yet"):
        _ = service.estimator


def test_a_service_is_ready_once_its_network_has_answered(estimator: Estimator) -> None:
    service = Service(Settings(), estimator)
    assert not service.ready
    service.answer_once()
    assert service.ready
    spec = estimator.model.spec
    assert service.model_name == f"{spec.name} {spec.version}"


def test_a_missing_network_is_a_model_error(tmp_path_factory: pytest.TempPathFactory) -> None:
    absent = tmp_path_factory.mktemp("none") / "absent.onnx"
    with pytest.raises(ModelError, match="There is no network at"):
        Service(Settings(model=absent)).load()


def test_photos_are_read_within_the_settings_limits_and_counted(estimator: Estimator) -> None:
    service = Service(Settings(max_pixels=10_000), estimator)
    with pytest.raises(PhotoTooLargeError, match="million pixels"):
        service.read(encode(scene(640, 480)))
    data = encode(scene(96, 64))
    assert service.read(data).pixels.shape == (64, 96, 3)
    counted = service.metrics.registry.get_sample_value
    assert counted("lighting_photo_bytes_total") == len(data)
    assert counted("lighting_photo_pixels_total") == 96 * 64
