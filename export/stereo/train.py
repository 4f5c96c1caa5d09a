"""The network of normals: what it learns from, its training, and its ONNX file for any number and size of images.

It learns from surfaces photographed on random days, as planes and true normals.

A run's folder holds config.json, log.csv and checkpoint.pt; a run that was stopped goes on where it was.

One encoder looks at each image alone. The largest and the mean of what it finds over the images go on. So their number
and order are free (as in PS-FCN, Chen et al., ECCV 2018). A U-Net (Ronneberger et al., MICCAI 2015) weighs the search's
candidates by what is around a pixel and adds a correction. Before any training it repeats the search.
"""

import csv
import json
import logging
import math
import time
import warnings
from collections import deque
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F

from export.data.panoramas import DataError
from export.networks.weights import CHECKPOINT, read_checkpoint
from export.stereo.renders import CaptureDay, Material, cast_shadows, shade_surface, utc_times
from export.stereo.surfaces import (
    Surface,
    TriangleMesh,
    is_held_out,
    project_mesh,
    random_relief,
    random_rotation,
    read_mesh,
    rotate_surface,
)
from lighting.errors import ModelError
from lighting.files import atomic_write
from lighting.stereo.normal_network import BY_IMAGE, SHARED, Network, NormalFeatures, normal_features
from lighting.stereo.normal_search import Candidates, make_candidates, search_normals
from lighting.stereo.pose import Pose, world_to_camera

HELD_OUT_LATITUDES = ((33.0, 37.0), (45.0, 49.0))  # deg; training days are elsewhere
IMAGES = 8

_MIN_SUN_ELEVATION = 5.0  # deg, of the images that training draws
_LATITUDES = (-60.0, 62.0)  # deg


def _random_day(rng: np.random.Generator) -> CaptureDay:
    """A training day of 3 to 8 images over some hours, all with the sun well above the horizon."""
    while True:
        day = _draw(rng)
        elevation = np.degrees(np.arcsin(day.suns()[:, 1]))
        if elevation.min() > _MIN_SUN_ELEVATION:
            return day


def _draw(rng: np.random.Generator) -> CaptureDay:
    count = IMAGES if rng.random() < 0.7 else int(rng.integers(3, IMAGES + 1))
    hours = np.linspace(rng.uniform(7.5, 10.5), rng.uniform(13.5, 16.5), count) + rng.normal(0, 0.1, count)
    date = np.datetime64("2024-01-01") + rng.integers(366).astype("timedelta64[D]")
    latitude = rng.uniform(*_LATITUDES)
    while any(low <= abs(latitude) <= high for low, high in HELD_OUT_LATITUDES):
        latitude = rng.uniform(*_LATITUDES)
    sunny = 0.0 if latitude > 0 else 180.0  # the camera that sees the lit side looks to the pole
    heading = sunny + rng.normal(0, 40) if rng.random() < 0.6 else rng.uniform(0, 360)
    pose = Pose(heading, rng.normal(0, 10) if rng.random() < 0.5 else 0.0)
    turbidity, ground = rng.uniform(2, 7), rng.uniform(0.1, 0.4)
    return CaptureDay(utc_times(str(date), hours), latitude, turbidity=turbidity, ground_albedo=ground, pose=pose)


def _believed(day: CaptureDay, rng: np.random.Generator) -> CaptureDay:
    """What who photographs knows of a day: at times all of it, at times a wrong heading, clock, haze or ground."""
    if rng.random() < 0.4:
        return day
    heading = day.pose.heading + rng.normal(0, 1.5)
    late = np.round(rng.normal(0, 120)).astype("timedelta64[s]")
    turbidity = float(np.clip(day.turbidity + rng.normal(0, 0.8), 1.5, 9))
    pose = replace(day.pose, heading=heading)
    return replace(day, times=day.times + late, turbidity=turbidity, ground_albedo=0.3, pose=pose)


# Training samples: crops of surfaces on random days, as the network's planes and the true normals.

Image = NDArray[np.float32]

CROP = 64  # pixels
CROPS = 3  # of each surface and day

_SIZES = (160, 320)  # pixels, of the whole picture
_SEARCHED = 1200  # normals that the search tries here
_SKY_HEIGHT = 24  # rows of the skies' maps
_MESH_SHARE = 0.5
_MAX_VIEWS = 240  # of meshes that are kept
_NEW_VIEW_SHARE = 0.25  # share of mesh samples for which one more is made
_MIN_COVERAGE = 0.3  # least share of a crop that the surface covers


@dataclass(frozen=True)
class _Sample:
    """One crop; images that it lacks are 0."""

    count: int  # of images
    by_image: NDArray[np.float16]  # (IMAGES, BY_IMAGE - 3, CROP, CROP), without the planes of the suns
    suns: NDArray[np.float32]  # (IMAGES, 3)
    shared: NDArray[np.float16]  # (SHARED, CROP, CROP)
    truth: NDArray[np.float16]  # (3, CROP, CROP), true normals


def _read_meshes(folder: Path) -> list[TriangleMesh]:
    """The meshes of a folder that training may see.

    Args:
        folder: of OBJ files.

    Raises:
        DataError: if it holds none.
    """
    files = [file for file in sorted(folder.glob("*.obj")) if not is_held_out(file)]
    if not files:
        raise DataError(f"{folder} holds no OBJ files to learn from.")
    return [read_mesh(file) for file in files]


def _generate_samples(meshes: list[TriangleMesh], seed: int) -> Iterator[_Sample]:
    """Samples without end; the same seed gives the same ones.

    Args:
        meshes: to learn from beside reliefs; may be empty.
        seed: of all that is random.
    """
    rng = np.random.default_rng(seed)
    views: list[Surface] = []
    while True:
        of_mesh = meshes and rng.random() < _MESH_SHARE
        surface = _view_mesh(meshes, views, rng) if of_mesh else random_relief(_size(rng), rng)
        yield from _crop_samples(surface, _random_day(rng), rng)


def _view_mesh(meshes: list[TriangleMesh], views: list[Surface], rng: np.random.Generator) -> Surface:
    """A new view of a mesh or, since they take long to make, mostly an earlier one turned or mirrored."""
    if len(views) < _MAX_VIEWS and (not views or rng.random() < _NEW_VIEW_SHARE):
        views.append(project_mesh(meshes[rng.integers(len(meshes))], random_rotation(rng), _size(rng), rng))
        return views[-1]
    return rotate_surface(views[rng.integers(len(views))], int(rng.integers(4)), mirrored=bool(rng.integers(2)))


def _size(rng: np.random.Generator) -> int:
    return int(rng.integers(*_SIZES))


def _crop_samples(surface: Surface, day: CaptureDay, rng: np.random.Generator) -> Iterator[_Sample]:
    skies, believed = day.skies(_SKY_HEIGHT), _believed(day, rng)
    table = make_candidates(believed.skies(_SKY_HEIGHT), believed.pose, _SEARCHED)
    shadows, glossy, color = rng.random() < 0.6, rng.random() < 0.4, rng.random() < 0.3
    table = table if color else _grey(table)
    noise = float(np.exp(rng.normal(np.log(0.01), 0.5)))
    for window in _windows(surface, rng):
        mask = surface.mask[window]
        pixels = np.argwhere(mask) + np.array([window[0].start, window[1].start])
        normals = surface.normals[window][mask]
        lit = cast_shadows(surface, pixels, world_to_camera(skies.sun_direction, day.pose)) if shadows else None
        gloss = rng.uniform(0.02, 0.15) if glossy else 0.0
        material = Material(_albedo(surface.mask.shape, rng)[window][mask], gloss, rng.uniform(8, 60))
        images = shade_surface(normals, skies, day.pose, material, lit, quick=True)
        images = images if color else images.mean(axis=2, keepdims=True)
        yield _sample(images, mask, normals, (table, world_to_camera(believed.suns(), believed.pose), noise), rng)


def _grey(table: Candidates) -> Candidates:
    """The same candidates for pictures of one channel, the mean of the three."""
    light, brightness = table.light.mean(axis=-1, keepdims=True), table.brightness.mean(axis=0, keepdims=True)
    return replace(table, light=light, brightness=brightness)


def _windows(surface: Surface, rng: np.random.Generator) -> Iterator[tuple[slice, slice]]:
    """Places of crops that hold enough of the surface."""
    height, width = surface.mask.shape
    count = 0
    for _ in range(8 * CROPS):
        top, left = rng.integers(0, [height - CROP + 1, width - CROP + 1])
        window = slice(top, top + CROP), slice(left, left + CROP)
        if surface.mask[window].mean() > _MIN_COVERAGE and count < CROPS:
            count += 1
            yield window


def _albedo(shape: tuple[int, ...], rng: np.random.Generator) -> Image:
    """Albedos (H, W): one, or patches with soft changes inside them."""
    if rng.random() < 0.6:
        return np.full(shape, rng.uniform(0.3, 0.8), dtype=np.float32)
    y, x = np.mgrid[: shape[0], : shape[1]] / shape[0]
    wave = sum(np.sin(rng.uniform(2, 25) * (x * np.cos(t) + y * np.sin(t)) + rng.uniform(0, 6)) for t in range(4))
    levels = rng.uniform(0.25, 0.9, 4)
    patches = levels[np.digitize(wave, [-1.0, 0.0, 1.0])] if rng.random() < 0.5 else 0.5 + 0.1 * wave
    return np.asarray(np.clip(patches, 0.1, 0.95), dtype=np.float32)


_SearchInput = tuple[Candidates, NDArray[Any], float]  # table, suns, standard deviation of the noise


def _sample(
    images: Image, mask: NDArray[np.bool_], normals: Image, search_input: _SearchInput, rng: np.random.Generator
) -> _Sample:
    table, suns, noise_std = search_input
    pixel_std = noise_std * float(images.max())
    noisy = np.maximum(images + rng.normal(0, pixel_std, images.shape), 0).astype(np.float32)
    planes = normal_features(noisy, mask, suns, search_normals(noisy, table, pixel_std), pixel_std)
    truth = np.zeros((3, *mask.shape), dtype=np.float16)
    truth[:, mask] = normals.T
    count = len(planes.by_image)
    by_image = np.zeros((IMAGES, BY_IMAGE - 3, CROP, CROP), dtype=np.float16)
    by_image[:count] = planes.by_image[:, :-3]
    directions = np.zeros((IMAGES, 3), dtype=np.float32)
    directions[:count] = suns
    return _Sample(count, by_image, directions, planes.shared.astype(np.float16), truth)


# The network of normals: images of a day with their suns, and what the search says, to normals.

_CODE = 24  # planes of an image's code
_WIDTHS = (24, 48, 64, 96)  # planes at each scale
_TRUST = 3.0  # how much the search's best normal weighs at first, as a logit
_CANDIDATES = 3  # best, mean and other normal, the first planes of the shared ones
_SPREAD = 11  # the shared plane with the search's spread, in units of 30 deg
OPSET = 18
EXPORT_TOLERANCE = 2e-3  # largest difference between torch and onnxruntime, of normals and of errors [rad]


class _NormalsNetwork(nn.Module):
    """Planes to unit normals (N, 3, H, W) and their expected error (N, 1, H, W) [rad]; H and W are multiples of 8."""

    def __init__(self) -> None:
        super().__init__()
        first, second = nn.Conv2d(BY_IMAGE, 12, 3, padding=1), nn.Conv2d(12, _CODE, 1)
        self.encoder = nn.Sequential(first, nn.ReLU(inplace=True), second, nn.ReLU(inplace=True))
        inputs = 2 * _CODE + SHARED
        self.down = nn.ModuleList()
        for scale, width in enumerate(_WIDTHS):
            self.down.append(_pair(inputs, width, stride=1 if scale == 0 else 2, deep=scale > 0))
            inputs = width
        self.up = nn.ModuleList()
        for width in reversed(_WIDTHS[:-1]):
            self.up.append(_pair(inputs + width, width))
            inputs = width
        self.head = nn.Conv2d(inputs, _CANDIDATES + 3 + 1, 1)
        nn.init.zeros_(self.head.weight)
        self.head.bias.data.zero_() if self.head.bias is not None else None

    def forward(self, by_image: Tensor, present: Tensor, shared: Tensor) -> tuple[Tensor, Tensor]:
        """From planes (N, T, BY_IMAGE, H, W) of which (N, T) are present, 1 or 0, and (N, SHARED, H, W)."""
        code = self._pooled(by_image, present)
        x = torch.cat([code, shared], dim=1)
        kept = []
        for block in self.down:
            x = block(x)
            kept.append(x)
        for block, skip in zip(self.up, reversed(kept[:-1]), strict=True):
            x = block(torch.cat([F.interpolate(x, scale_factor=2.0, mode="nearest"), skip], dim=1))
        return self._answer(self.head(x).float(), shared)

    def _pooled(self, by_image: Tensor, present: Tensor) -> Tensor:
        n, t, planes, height, width = by_image.shape
        code = self.encoder(by_image.reshape(n * t, planes, height, width)).reshape(n, t, _CODE, height, width)
        there = code * present[:, :, None, None, None]  # codes are not negative, so that 0 never is the largest
        mean = there.sum(dim=1) / present.sum(dim=1)[:, None, None, None]
        return torch.cat([there.amax(dim=1), mean], dim=1)

    def _answer(self, head: Tensor, shared: Tensor) -> tuple[Tensor, Tensor]:
        trust = torch.tensor([_TRUST, 0.0, 0.0]).view(1, _CANDIDATES, 1, 1)
        weight = torch.softmax(head[:, :_CANDIDATES] + trust, dim=1)
        candidates = torch.unflatten(shared[:, : 3 * _CANDIDATES], 1, (_CANDIDATES, 3))
        normal = (candidates * weight[:, :, None]).sum(dim=1) + head[:, _CANDIDATES : _CANDIDATES + 3]
        start = torch.log(shared[:, _SPREAD : _SPREAD + 1] * (torch.pi / 6) + 0.02)
        error = torch.exp((start + head[:, -1:]).clamp(-5, 1))
        return F.normalize(normal, dim=1, eps=1e-6), error


def _pair(inputs: int, width: int, *, stride: int = 1, deep: bool = False) -> nn.Sequential:
    layers: list[nn.Module] = [nn.Conv2d(inputs, width, 3, stride=stride, padding=1), nn.LeakyReLU(0.1, inplace=True)]
    if deep:
        layers += [nn.Conv2d(width, width, 3, padding=1), nn.LeakyReLU(0.1, inplace=True)]
    return nn.Sequential(*layers)


# Training of the network of normals: new samples join a pool from which batches are drawn, for a set time.

_EVERY = 50  # steps between lines of the log
_SAVE = 200  # steps between checkpoints
_MEMORY = 0.995  # of the averaged weights


@dataclass(frozen=True)
class Config:
    """How a run trains."""

    out: str
    meshes: str = ""  # folder of OBJ files; without one, reliefs alone
    minutes: float = 70.0  # of training in all, over resumptions
    batch: int = 8
    pool: int = 5000  # samples kept; the oldest leave
    first: int = 96  # samples before the first step
    learning_rate: float = 2e-3
    seed: int = 1
    threads: int = 1
    halves: bool = True  # compute in bfloat16


@dataclass
class _Run:
    """The state of a run; a checkpoint holds all but the log."""

    network: _NormalsNetwork
    average: dict[str, Tensor]
    optimiser: torch.optim.Optimizer
    step: int = 0
    seconds: float = 0.0
    log: list[dict[str, float]] = field(default_factory=list)  # of the steps since the file's last line


def train_normals(config: Config) -> Path:
    """Train, or go on with, the run in a folder; returns its checkpoint.

    Args:
        config: how it trains and where.

    Raises:
        DataError: for a folder without meshes to learn from, and for a checkpoint of no such run.
    """
    torch.set_num_threads(config.threads)
    meshes = _read_meshes(Path(config.meshes)) if config.meshes else []
    folder = Path(config.out)
    folder.mkdir(parents=True, exist_ok=True)
    run = _resumed(folder, config)
    with atomic_write(folder / "config.json") as path:
        path.write_text(json.dumps(asdict(config), indent=2))
    fresh = _generate_samples(meshes, config.seed + run.step)
    pool = deque(islice(fresh, config.first), maxlen=config.pool)
    rng = np.random.default_rng(config.seed + run.step)
    last = time.monotonic()
    while run.seconds < 60 * config.minutes:
        pool.append(next(fresh))
        chosen = [pool[index] for index in rng.integers(len(pool), size=config.batch)]
        line = _step(run, chosen, config, mirrored=bool(rng.integers(2)))
        run.seconds, last = run.seconds + time.monotonic() - last, time.monotonic()
        run.log.append(line)
        if run.step % _EVERY == 0:
            _write_log(folder, run)
        if run.step % _SAVE == 0:
            _save(folder, run)
    _save(folder, run)
    return folder / CHECKPOINT


def _step(run: _Run, chosen: list[_Sample], config: Config, *, mirrored: bool) -> dict[str, float]:
    share = min(1.0, run.seconds / (60 * config.minutes))
    for group in run.optimiser.param_groups:
        warm = min(1.0, (run.step + 1) / 50)
        group["lr"] = config.learning_rate * warm * (0.51 + 0.5 * math.cos(math.pi * share))
    by_image, present, shared, truth = _batch(chosen, mirrored=mirrored)
    with torch.autocast("cpu", dtype=torch.bfloat16, enabled=config.halves):
        normal, error = run.network(by_image, present, shared)
    mask = shared[:, -1]
    chord = torch.sqrt(((normal - truth) ** 2).sum(dim=1) + 1e-6)
    loss = _mean(chord, mask) + 0.1 * _mean(chord.detach() / error[:, 0] + torch.log(error[:, 0]), mask)
    run.optimiser.zero_grad(set_to_none=True)
    loss.backward()  # type: ignore[no-untyped-call]
    torch.nn.utils.clip_grad_norm_(run.network.parameters(), 1.0)
    run.optimiser.step()
    run.step += 1
    _remember(run)
    searched = torch.sqrt(((shared[:, :3] - truth) ** 2).sum(dim=1) + 1e-6)
    return {"loss": float(loss.detach()), "network": _degrees(chord, mask), "search": _degrees(searched, mask)}


Batch = tuple[Tensor, Tensor, Tensor, Tensor]


def _batch(chosen: list[_Sample], *, mirrored: bool = False) -> Batch:
    """Planes of images (N, T, BY_IMAGE, H, W), which are present (N, T), shared planes and true normals.

    Mirrored, left and right change places, in the pictures and in all directions.
    """
    by_image = torch.from_numpy(np.stack([s.by_image for s in chosen])).float()
    suns = torch.from_numpy(np.stack([s.suns for s in chosen]))
    shared = torch.from_numpy(np.stack([s.shared for s in chosen])).float()
    truth = torch.from_numpy(np.stack([s.truth for s in chosen])).float()
    present = torch.tensor([[1.0] * s.count + [0.0] * (len(s.suns) - s.count) for s in chosen])
    planes = suns[..., None, None] * shared[:, None, -1:]
    by_image = torch.cat([by_image, planes], dim=2)
    return (by_image, present, shared, truth) if not mirrored else _mirrored(by_image, present, shared, truth)


def _mirrored(by_image: Tensor, present: Tensor, shared: Tensor, truth: Tensor) -> Batch:
    by_image, shared, truth = (planes.flip(-1) for planes in (by_image, shared, truth))
    by_image[:, :, 3] *= -1
    signs = torch.ones(SHARED)
    signs[[0, 3, 6]] = -1
    return by_image, present, shared * signs[:, None, None], truth * torch.tensor([-1.0, 1, 1])[:, None, None]


def _mean(value: Tensor, mask: Tensor) -> Tensor:
    return (value * mask).sum() / mask.sum()


def _degrees(chord: Tensor, mask: Tensor) -> float:
    return float(_mean(torch.rad2deg(2 * torch.asin((chord.detach() / 2).clamp(max=1))), mask))


def _remember(run: _Run) -> None:
    memory = min(_MEMORY, 1 - 1 / (run.step + 1))
    for name, value in run.network.state_dict().items():
        run.average[name].lerp_(value, 1 - memory)


def _resumed(folder: Path, config: Config) -> _Run:
    torch.manual_seed(config.seed)
    network = _NormalsNetwork()
    optimiser = torch.optim.Adam(network.parameters(), lr=config.learning_rate)
    run = _Run(network, {k: v.clone() for k, v in network.state_dict().items()}, optimiser)
    if (folder / CHECKPOINT).exists():
        saved = _saved(folder)
        network.load_state_dict(saved["network"])
        optimiser.load_state_dict(saved["optimiser"])
        run.average, run.step, run.seconds = saved["average"], saved["step"], saved["seconds"]
    return run


def _saved(folder: Path) -> dict[str, Any]:
    """What the checkpoint of a run of this network holds; DataError for a damaged one and for another network's."""
    saved = read_checkpoint(folder)
    if not isinstance(saved.get("average"), dict) or saved["average"].keys() != _NormalsNetwork().state_dict().keys():
        raise DataError(f"{folder / CHECKPOINT} is not of the network of normals.")
    return saved


def _save(folder: Path, run: _Run) -> None:
    state = {"network": run.network.state_dict(), "average": run.average, "optimiser": run.optimiser.state_dict()}
    with atomic_write(folder / CHECKPOINT) as path:
        torch.save({**state, "step": run.step, "seconds": run.seconds}, path)


def _write_log(folder: Path, run: _Run) -> None:
    """One line of means over the steps since the last one."""
    names = list(run.log[0])
    new = not (folder / "log.csv").exists()
    with (folder / "log.csv").open("a", newline="") as file:
        writer = csv.writer(file)
        if new:
            writer.writerow(["step", "minutes", *names])
        means = [f"{np.mean([line[name] for line in run.log]):.4f}" for name in names]
        writer.writerow([run.step, f"{run.seconds / 60:.1f}", *means])
    run.log.clear()


def _averaged_network(folder: Path) -> _NormalsNetwork:
    """The network with a run's averaged weights, ready to answer.

    Args:
        folder: of the run.

    Raises:
        DataError: for what is no such run.
    """
    network = _NormalsNetwork()
    network.load_state_dict(_saved(folder)["average"])
    return network.eval()


class _Served(nn.Module):
    """The network where every image is present."""

    def __init__(self, network: _NormalsNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, by_image: Tensor, shared: Tensor) -> tuple[Tensor, Tensor]:
        """Normals and errors of planes (1, T, BY_IMAGE, H, W) and (1, SHARED, H, W)."""
        normal, error = self.network(by_image, torch.ones_like(by_image[:, :, 0, 0, 0]), shared)
        return normal, error


def export_normals(run: Path, target: Path, version: str) -> float:
    """Write the averaged network of a run; returns the largest difference to torch.

    Args:
        run: folder of the run.
        target: ONNX file to write.
        version: of the network.

    Raises:
        ModelError: where torch and onnxruntime differ by more than EXPORT_TOLERANCE.
    """
    import onnx

    network = _averaged_network(run)
    target.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(target) as path:
        model = _trace(_Served(network).eval())
        known = {"name": "normals", "version": version, "license": "Apache-2.0"}
        known["training"] = json.dumps(json.loads((run / "config.json").read_text()) | {"out": "", "meshes": ""})
        for key, value in known.items():
            entry = model.metadata_props.add()
            entry.key, entry.value = key, value
        onnx.checker.check_model(model)
        onnx.save_model(model, str(path), save_as_external_data=False)
        difference = _parity(network, path)
    if not difference <= EXPORT_TOLERANCE:
        raise ModelError(f"torch and onnxruntime differ by {difference:.2e}, more than {EXPORT_TOLERANCE:.0e}.")
    return difference


def _trace(served: _Served) -> Any:
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)
    side, moments = torch.export.Dim("side", min=2, max=4096), torch.export.Dim("moments", min=2, max=512)
    tall = torch.export.Dim("tall", min=2, max=4096)
    shapes = {"by_image": {1: moments, 3: 8 * tall, 4: 8 * side}, "shared": {2: 8 * tall, 3: 8 * side}}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the exporter's own use of torch
        program = torch.onnx.export(
            served,
            (torch.zeros(1, 8, BY_IMAGE, 32, 48), torch.ones(1, SHARED, 32, 48)),
            input_names=["by_image", "shared"],
            output_names=["normal", "error"],
            dynamic_shapes=shapes,
            opset_version=OPSET,
            dynamo=True,
            verbose=False,
        )
    assert program is not None
    return program.model_proto


def _parity(network: _NormalsNetwork, path: Path) -> float:
    """Largest difference between torch and onnxruntime on fixed inputs of another size and number of images."""
    rng = np.random.default_rng(0)
    by_image = rng.normal(0, 0.5, (5, BY_IMAGE, 56, 72)).astype(np.float32)
    shared = rng.normal(0, 0.5, (SHARED, 56, 72)).astype(np.float32)
    shared[-1] = 1
    with torch.inference_mode():
        expected = _Served(network)(torch.from_numpy(by_image)[None], torch.from_numpy(shared)[None])
    normal, error = Network.load(path, threads=1).predict(NormalFeatures(by_image, shared))
    answer = (np.moveaxis(normal, -1, 0), np.radians(error))
    return float(max(np.abs(a[0].numpy() - b).max() for a, b in zip(expected, answer, strict=True)))
