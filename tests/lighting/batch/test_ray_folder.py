"""The folder of a batch on Ray, which needs pyarrow alone."""

from pathlib import Path

import pytest

from lighting.batch.job import BatchJob
from lighting.batch.ray import _filesystem_at, _open_results
from lighting.errors import BatchError


@pytest.fixture
def job(tmp_path: Path, network: Path) -> BatchJob:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "batch.json").write_text("{}\n")
    return BatchJob(str(tmp_path), str(tmp_path / "out"), str(network), engine="ray")


@pytest.mark.parametrize(
    ("name", "content", "refused"),
    [
        ("lighting.jsonl", '{"file": "a.jpg", "error": "No."}\n', False),
        ("lighting.jsonl", '{"file": "a.jpg", "lighting": {}}\n', True),
        ("lighting.parquet/part.parquet", "", True),
        ("lighting.parquet", "", True),
    ],
)
def test_results_of_other_settings_are_refused(job: BatchJob, name: str, content: str, refused: bool) -> None:
    file = Path(job.out, name)
    file.parent.mkdir(exist_ok=True)
    file.write_text(content)
    if refused:
        with pytest.raises(BatchError, match="other settings"):
            _open_results(*_filesystem_at(job.out), job, overwrite=False)
    else:
        _open_results(*_filesystem_at(job.out), job, overwrite=False)
        assert '"engine": "ray"' in Path(job.out, "batch.json").read_text()
    assert file.read_text() == content
