"""The segmentation network: its labels, variants, training and file."""

from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

import export.training.segmentation as segmentation
from export.data.panoramas import DataError, read_table
from export.reports.ground import _describe_answers, _GroundAnswer
from export.training.segmentation import (
    LabelledPicture,
    _join_heads,
    _predict_grid,
    _raise_odds,
    _SegmentationNetwork,
    _vary_picture,
    read_labelled_pictures,
)
from lighting.segmentation import Segmenter, SurfaceClass

HEADER = "file,split,columns,rows,grid,weak,panorama,note\n"
GRID = "/".join(["S" * 12] * 4 + ["G" * 6 + "W" * 6] * 5)


def write_data(folder: Path, *rows: str) -> None:
    """A folder of pictures: sky over grey ground and blue water."""
    (folder / "ground.csv").write_text(HEADER + "".join(f"{row}\n" for row in rows))
    (folder / "photos.csv").write_text("file,group\na.png,anna_1\nb.png,anna_2\n")
    picture = np.full((90, 120, 3), (150, 190, 240), dtype=np.uint8)
    picture[40:, :60], picture[40:, 60:] = (120, 110, 100), (20, 60, 120)
    for name in ("a.png", "b.png", "c.png"):
        Image.fromarray(picture).save(folder / name)


def labelled(folder: Path) -> list[LabelledPicture]:
    write_data(folder, f"a.png,train,12,9,{GRID},,,", f"b.png,train,12,9,{GRID},yes,,", f"c.png,val,12,9,{GRID},,,")
    return read_labelled_pictures(folder, "train")


def test_pictures_are_read_with_their_grids_and_groups(tmp_path: Path) -> None:
    one, other = labelled(tmp_path)
    assert (one.group, other.group, one.weak, other.weak) == ("anna", "anna", False, True)
    assert one.grid.shape == (9, 12)
    assert one.grid[0, 0] == SurfaceClass.SKY
    assert one.grid[8, [0, 11]].tolist() == [SurfaceClass.GROUND, SurfaceClass.WATER]
    (val,) = read_labelled_pictures(tmp_path, "val")
    assert val.group == "c.png"


def test_more_pictures_are_those_that_the_folder_has(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    labelled(tmp_path)
    table = tmp_path / "more.csv"
    table.write_text(f"file,columns,rows,grid\nb.png,12,9,{GRID}\nmissing.png,12,9,{GRID}\n")
    monkeypatch.setattr(segmentation, "_MORE", table)
    (picture,) = segmentation._read_more_pictures(tmp_path)
    assert (picture.group, picture.weak, picture.grid.shape) == ("anna", False, (9, 12))


def test_the_grids_that_lie_beside_the_program_are_whole() -> None:
    rows = read_table(segmentation._MORE, ("file", "columns", "rows", "grid"))
    assert len(rows) == len({row["file"] for row in rows}) == 132
    for row in rows:
        lines = row["grid"].split("/")
        assert (len(lines), {len(line) for line in lines}) == (int(row["rows"]), {int(row["columns"])})
        assert set(row["grid"]) <= {*segmentation.LETTERS, "/"}


@pytest.mark.parametrize("grid", ["SSS", GRID.replace("W", "X"), GRID[:-1]])
def test_a_grid_of_another_kind_is_refused(grid: str, tmp_path: Path) -> None:
    write_data(tmp_path, f"a.png,train,12,9,{grid},,,")
    with pytest.raises(DataError, match=r"the grid of a.png is not 12 x 9 letters"):
        read_labelled_pictures(tmp_path, "train")


def test_a_variant_keeps_its_labels(tmp_path: Path) -> None:
    """Cells of ground are brown, of water blue, whatever part is shown and whether it is mirrored."""
    picture, rng = labelled(tmp_path)[0], np.random.default_rng(1)
    for _ in range(12):
        pixels, target = _vary_picture(picture, rng)
        rows, columns = target.shape[:2]
        assert pixels.shape == (16 * rows, 16 * columns, 3)
        assert target.sum(axis=2) == pytest.approx(1.0)
        cells = pixels.reshape(rows, 16, columns, 16, 3).astype(float).mean(axis=(1, 3))
        warm = cells[..., 0] - cells[..., 2]
        sure = target > 0.99
        ground, water = sure[..., SurfaceClass.GROUND], sure[..., SurfaceClass.WATER]
        if ground.any() and water.any():
            assert warm[ground].mean() > warm[water].mean() - 1


@pytest.mark.slow
def test_training_learns_and_the_file_answers_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(segmentation, "_VARIANTS", 8)
    monkeypatch.setattr(segmentation, "_BATCH", 4)
    monkeypatch.setattr(segmentation, "_EPOCHS", 8)
    (picture, _) = labelled(tmp_path)
    said = segmentation.train_segmentation(tmp_path, tmp_path / "segments-1.0.0.onnx")
    assert said.startswith(str(tmp_path / "segments-1.0.0.onnx: 1."))
    shares = Segmenter(tmp_path / "segments-1.0.0.onnx")(picture.pixels)
    cells = shares.reshape(9, 2, 12, 2, -1).mean(axis=(1, 3))
    ground, water, sky = (cells[row, column] for row, column in ((7, 2), (7, 9), (1, 5)))  # within each
    assert cells.sum(axis=2) == pytest.approx(1.0, abs=1e-4)
    assert ground[SurfaceClass.GROUND] > 2 * sky[SurfaceClass.GROUND]  # after a few steps
    assert water[SurfaceClass.WATER] > 2 * sky[SurfaceClass.WATER]
    assert sky.argmax() == SurfaceClass.SKY


def test_predictions_are_probabilities_of_a_grid() -> None:
    torch.manual_seed(0)
    network = _SegmentationNetwork(pretrained=False).eval()
    shares = _predict_grid(network, np.zeros((90, 60, 3), dtype=np.uint8), (12, 9))
    assert shares.shape == (12, 9, 10)
    assert shares.sum(axis=2) == pytest.approx(1.0)


def test_joined_heads_answer_with_the_mean_of_their_logits() -> None:
    torch.manual_seed(0)
    one, other = (_SegmentationNetwork(pretrained=False).eval() for _ in range(2))
    for stage in ("stem", "middle", "deep"):
        getattr(other, stage).load_state_dict(getattr(one, stage).state_dict())
    picture = torch.randint(0, 256, (1, 64, 96, 3), dtype=torch.uint8)
    joined = _join_heads([one, other], [0.3, 0.7])
    with torch.inference_mode():
        mean = 0.3 * one(picture) + 0.7 * other(picture)
        assert torch.allclose(joined(picture), mean, atol=1e-4)
        _raise_odds(joined, SurfaceClass.WATER, 2.0)
        assert torch.allclose(
            (joined(picture) - mean)[0, :, 0, 0], 0.6931 * torch.eye(10)[SurfaceClass.WATER], atol=1e-3
        )


def test_the_report_counts_spots_refusals_and_cells() -> None:
    grid = np.full((9, 12), SurfaceClass.SKY)
    grid[5:] = SurfaceClass.GROUND
    with_ground = LabelledPicture("a", False, np.zeros((9, 12, 3), np.uint8), grid.astype(np.intp))
    without = LabelledPicture("b", False, with_ground.pixels, np.full((9, 12), SurfaceClass.SKY, dtype=np.intp))
    right = np.eye(10, dtype=np.float32)[grid.repeat(2, axis=0).repeat(2, axis=1)]
    text = _describe_answers(
        [with_ground, with_ground, without, without],
        [
            _GroundAnswer(right, (0.5, 0.8)),
            _GroundAnswer(right, (0.5, 0.2)),
            _GroundAnswer(right, None),
            _GroundAnswer(np.eye(10, dtype=np.float32)[np.full((18, 24), SurfaceClass.SKY)], (0.5, 0.5)),
        ],
    )
    assert "Of 2 pictures with ground, the spot of 1 lies on it (50 %)." in text
    assert "Of 2 without, 1 have no spot." in text
    assert "IoU of 0.667" in text
