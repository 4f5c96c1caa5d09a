"""Settings of a run."""

import json
from dataclasses import asdict, fields

from export.networks.outdoor import TARGET_WIDTH
from export.training.config import MAY_CHANGE, TrainConfig


def test_settings_are_plain_values_that_json_keeps() -> None:
    config = TrainConfig("data", "labels.csv", "out")
    assert TrainConfig(**json.loads(json.dumps(asdict(config)))) == config
    assert config.target_width == TARGET_WIDTH["outdoor"]


def test_what_may_change_decides_no_crop_and_no_weight() -> None:
    assert set(MAY_CHANGE) <= {field.name for field in fields(TrainConfig)}
    assert not set(MAY_CHANGE) & {"data", "crops", "batch", "learning_rate", "start", "synthetic"}
