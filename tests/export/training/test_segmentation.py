"""The head that says what photos show: its labels, variants and training."""

from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from onnx import TensorProto, helper, numpy_helper
from PIL import Image

import export.training.segmentation as segmentation
from export.data.panoramas import DataError, read_table
from export.networks.backbone import Backbone
from export.networks.outdoor import network_specs
from export.networks.segmentation import SegmentationBranch, SegmentationHead
from export.reports.ground import GroundAnswer, describe_answers
from export.training.segmentation import (
    LabelledPicture,
    _cut_part,
    _raise_odds,
    _taught_part,
    _vary_picture,
    cross_validate_segmentation,
    read_labelled_pictures,
    teach_views,
)
from lighting.model import pad_to_input, preprocess
from lighting.photo.reader import photo_from_array
from lighting.prediction import SurfaceClass
from tests.helpers.panoramas import ROW, write_index

HEADER = "file,split,columns,rows,grid,weak,panorama,note\n"
GRID = "/".join(["S" * 12] * 4 + ["G" * 6 + "W" * 6] * 5)


def write_data(folder: Path, *rows: str) -> None:
    """A folder of pictures: sky over gray ground and blue water."""
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


def canvas_cells(pixels: np.ndarray) -> np.ndarray:
    """The mean colors (28, 28, 3) of the canvas's cells."""
    canvas = pad_to_input(pixels, segmentation._SPEC).transpose(1, 2, 0)
    return np.asarray(canvas.reshape(28, 8, 28, 8, 3).mean(axis=(1, 3)))


def test_a_variant_keeps_its_labels(tmp_path: Path) -> None:
    """Cells of ground are brown, of water blue, whatever part is shown and whether it is mirrored."""
    picture, rng = labelled(tmp_path)[0], np.random.default_rng(1)
    for _ in range(12):
        part = _vary_picture(picture, rng)
        assert max(part.pixels.shape) == 224
        assert part.target.sum() * 64 == pytest.approx(part.pixels.size / 3, rel=0.03)
        cells = canvas_cells(part.pixels)
        warm = cells[..., 0] - cells[..., 2]
        sure = part.target > 0.99
        ground, water = sure[..., SurfaceClass.GROUND], sure[..., SurfaceClass.WATER]
        if ground.any() and water.any():
            assert warm[ground].mean() > warm[water].mean() - 0.01


def test_cells_beside_the_picture_have_no_label(tmp_path: Path) -> None:
    part = _cut_part(labelled(tmp_path)[0], np.zeros(2), np.ones(2))
    inside = part.target.sum(axis=2)
    assert part.pixels.shape == (168, 224, 3)
    assert inside[:, 5].tolist() == [0.0] * 3 + [0.5] + [1.0] * 20 + [0.5] + [0.0] * 3
    assert part.target[24, 3].argmax() == SurfaceClass.GROUND
    assert part.target[24, 25].argmax() == SurfaceClass.WATER


def write_teacher(path: Path) -> Path:
    """A network that calls bright cells sky, and dark ones ground."""
    weights = np.zeros((10, 3, 1, 1), np.float32)
    weights[SurfaceClass.GROUND], weights[SurfaceClass.SKY] = -0.1, 0.1
    bias = np.zeros(10, np.float32)
    bias[SurfaceClass.GROUND], bias[SurfaceClass.SKY] = 50, -50
    nodes = [
        helper.make_node("Cast", ["photo"], ["x"], to=TensorProto.FLOAT),
        helper.make_node("Transpose", ["x"], ["y"], perm=[0, 3, 1, 2]),
        helper.make_node("AveragePool", ["y"], ["cells"], kernel_shape=[16, 16], strides=[16, 16]),
        helper.make_node("Conv", ["cells", "weights", "bias"], ["logits"]),
        helper.make_node("Softmax", ["logits"], ["shares"], axis=1),
        helper.make_node("Transpose", ["shares"], ["segments"], perm=[0, 2, 3, 1]),
    ]
    tensors = [numpy_helper.from_array(weights, "weights"), numpy_helper.from_array(bias, "bias")]
    photo = helper.make_tensor_value_info("photo", TensorProto.UINT8, [1, "h", "w", 3])
    segments = helper.make_tensor_value_info("segments", TensorProto.FLOAT, [1, "r", "c", 10])
    graph = helper.make_graph(nodes, "teacher", [photo], [segments], tensors)
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9), path)
    return path


def write_unlabelled(folder: Path) -> None:
    write_index(folder, ROW | {"file": "panorama.png"})
    (folder / "a.png").rename(folder / "panorama.png")
    (folder / "photos_train.csv").write_text("file,group\nc.png,anna_1\n")


def test_a_teacher_answers_for_photos_and_views_of_panoramas(tmp_path: Path) -> None:
    write_unlabelled(tmp_path)
    labelled(tmp_path)
    taught = list(teach_views(write_teacher(tmp_path / "teacher.onnx"), tmp_path, 1))
    assert len(taught) == 4
    view, segments = taught[0]
    assert (view.shape, segments.shape) == ((300, 400, 3), (18, 24, 10))
    part = _taught_part(view, segments, np.random.default_rng(1))
    assert part.pixels.shape == (168, 224, 3)
    assert part.target[5, 14].argmax() == SurfaceClass.SKY
    assert part.target[20].sum(axis=1) == pytest.approx(1.0, abs=1e-4)
    assert part.target[1].max() == 0.0


@pytest.mark.slow
def test_training_learns_and_the_run_answers_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (("_VARIANTS", 4), ("_STEPS", 20), ("_TAUGHT", 2)):
        monkeypatch.setattr(segmentation, name, value)
    write_unlabelled(tmp_path)
    (picture, _) = labelled(tmp_path)
    teacher = write_teacher(tmp_path / "teacher.onnx")
    said = segmentation.train_segmentation(tmp_path, teacher, tmp_path / "run")
    assert said.startswith(f"{tmp_path / 'run'}: a branch")
    with pytest.raises(DataError, match="already holds a run"):
        segmentation.train_segmentation(tmp_path, teacher, tmp_path / "run")
    branch, frozen = SegmentationBranch.read(tmp_path / "run").eval(), Backbone.pretrained().eval()
    canvas = torch.from_numpy(preprocess(photo_from_array(picture.pixels), network_specs("0")["outdoor"]))
    with torch.inference_mode():
        shares = branch(frozen.frozen_features(canvas)).softmax(dim=1)[0].permute(1, 2, 0).numpy()
    ground, water, sky = (shares[row, column] for row, column in ((20, 7), (20, 20), (6, 14)))  # within each
    assert shares.sum(axis=2) == pytest.approx(1.0, abs=1e-4)
    assert ground[SurfaceClass.GROUND] > 2 * sky[SurfaceClass.GROUND]  # after a few steps
    assert water[SurfaceClass.WATER] > 2 * sky[SurfaceClass.WATER]
    assert sky.argmax() == SurfaceClass.SKY


def test_no_head_learns_of_the_groups_it_is_judged_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Anna's pictures show ground, but for a weak one that no head learns of; the picture of another is all sky."""
    learned: list[set[bool]] = []

    def train_head(variants: list[segmentation._Variant], taught: list[segmentation._Variant]) -> SegmentationHead:
        learned.append({bool(variant.target[SurfaceClass.GROUND].any()) for variant in variants})
        assert not taught
        return SegmentationHead().eval()

    monkeypatch.setattr(segmentation, "_train_head", train_head)
    sky = "/".join(["S" * 12] * 9)
    write_data(tmp_path, f"a.png,train,12,9,{GRID},,,", f"b.png,train,12,9,{GRID},yes,,", f"c.png,val,12,9,{sky},,,")
    answers = list(cross_validate_segmentation(tmp_path, 2))
    assert [picture.group for picture, _ in answers] == ["anna", "anna", "c.png"]
    assert all(canvas.shape == (28, 28, 10) for _, canvas in answers)
    assert learned == [{False}, {True}]
    with pytest.raises(DataError, match="2 photographers and places cannot fall into 3 folds"):
        list(cross_validate_segmentation(tmp_path, 3))


def test_a_class_is_made_likelier_everywhere() -> None:
    torch.manual_seed(0)
    head = SegmentationHead().eval()
    maps = torch.rand(1, 40, 8, 6), torch.rand(1, 112, 4, 3), torch.rand(1, 192, 2, 2)
    with torch.inference_mode():
        before = head(*maps)
        assert before.shape == (1, 10, 8, 6)
        _raise_odds(head, SurfaceClass.WATER, 2.0)
        more = (head(*maps) - before)[0, :, 0, 0]
    torch.testing.assert_close(more, 0.6931 * torch.eye(10)[SurfaceClass.WATER], atol=1e-3, rtol=0)


def test_the_report_counts_spots_refusals_and_cells() -> None:
    grid = np.full((9, 12), SurfaceClass.SKY)
    grid[5:] = SurfaceClass.GROUND
    with_ground = LabelledPicture("a", False, np.zeros((9, 12, 3), np.uint8), grid.astype(np.intp))
    without = LabelledPicture("b", False, with_ground.pixels, np.full((9, 12), SurfaceClass.SKY, dtype=np.intp))
    right = np.eye(10, dtype=np.float32)[grid.repeat(2, axis=0).repeat(2, axis=1)]
    text = describe_answers(
        [with_ground, with_ground, without, without],
        [
            GroundAnswer(right, (0.5, 0.8)),
            GroundAnswer(right, (0.5, 0.2)),
            GroundAnswer(right, None),
            GroundAnswer(np.eye(10, dtype=np.float32)[np.full((18, 24), SurfaceClass.SKY)], (0.5, 0.5)),
        ],
    )
    assert "Of 2 pictures with ground, the spot of 1 lies on it (50 %)." in text
    assert "Of 2 without, 1 have no spot." in text
    assert "IoU of 0.667" in text
