"""metrics.json: all that a report prints, read back as numbers."""

from pathlib import Path

import pytest

from export.data.panoramas import DataError
from export.evaluation.metrics_file import collect_metrics, read_metrics, read_sections, write_metrics
from lighting.model import network_sha256

REPORT = """## Protocol `paper`: 8 crops

Sun [deg, nat]

|  | crops | median | in 90 % region |
| --- | --- | --- | --- |
| tiny | 8 | 17.8 | 91.6 |
| zenith | 8 | 59.5 | - |

Median sun error with 95 % intervals

|  | median | over panoramas | ours minus this | over places | ours minus this |
| --- | --- | --- | --- | --- | --- |
| tiny | 17.8 | 16.3 to 19.0 |  | 15.2 to 20.2 |  |
| zenith | 59.5 | 49.9 to 61.6 | -44.2 to -32.1 | 47.2 to 65.4 | -48.0 to -28.7 |

## Light: 4 crops

Medians over
crops.

|  | sun | size | sun painted | ground | size |
| --- | --- | --- | --- | --- | --- |
| tiny | -0.34 | 0.63 | 87 % | +0.05 | 0.36 |

|  | diffuse: RMSE | scaled |
| --- | --- | --- |
| tiny | 0.50 | 0.24 |

Nothing more.
"""


def test_every_figure_of_a_report_is_a_number_under_its_row_and_column() -> None:
    protocol, light = read_sections(REPORT)
    sun, intervals = protocol.tables
    assert (protocol.title, sun.caption) == ("Protocol `paper`: 8 crops", "Sun [deg, nat]")
    assert sun.rows["tiny"] == {"crops": 8.0, "median": 17.8, "in 90 % region": 91.6}
    assert sun.rows["zenith"]["in 90 % region"] is None
    assert intervals.rows["zenith"]["over panoramas"] == [49.9, 61.6]
    assert intervals.rows["zenith"]["over panoramas, ours minus this"] == [-44.2, -32.1]
    assert intervals.rows["tiny"]["over places, ours minus this"] is None
    strengths, objects = light.tables
    assert strengths.caption == "Medians over crops."
    assert strengths.rows["tiny"] == {
        "sun": -0.34,
        "sun, size": 0.63,
        "sun painted": 87.0,
        "ground": 0.05,
        "ground, size": 0.36,
    }
    assert objects.rows["tiny"] == {"diffuse: RMSE": 0.5, "scaled": 0.24}
    assert light.notes == ("Nothing more.",)


def test_what_is_written_is_read_back(data: Path, network: Path, tmp_path: Path) -> None:
    metrics = collect_metrics(
        network, data, REPORT, {"paper": {"sun_median": 17.8}, "phone": {"sun_median": None}}, "tiny"
    )
    path = write_metrics(metrics, tmp_path)
    assert read_metrics(path) == metrics
    assert "[49.9, 61.6]" in path.read_text(encoding="utf-8")
    assert (metrics.name, metrics.version, metrics.accuracy) == ("tiny", "0.0.1", {"paper": {"sun_median": 17.8}})
    assert metrics.network["sha256"] == network_sha256(network)
    assert metrics.data["train"] + metrics.data["val"] == 12
    assert metrics.figure("Protocol `paper`", "Median", "tiny", "median") == 17.8
    assert metrics.figure("Protocol `paper`", "Sun", "nobody", "median") is None


def test_another_file_is_refused_in_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="cannot be read"):
        read_metrics(tmp_path / "metrics.json")
    for text in ("{}", "[1]", "no"):
        (tmp_path / "metrics.json").write_text(text, encoding="utf-8")
        with pytest.raises(DataError, match="holds no figures of an evaluation"):
            read_metrics(tmp_path / "metrics.json")
