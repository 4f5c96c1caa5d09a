"""Accuracy of ONNX networks on crops of panoramas that training never saw, compared with answers without a network."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from export.crops.crops import Source, crop_panorama, load_sources
from export.data.labels import Label, read_labels_of
from export.data.panoramas import read_index, write_table
from export.evaluation.baselines import baseline_answers
from export.evaluation.failures import ScoredCrops, diagnostic_sections
from export.evaluation.irradiance import light_report
from export.evaluation.metadata import evidence_report, in_view_evidence, simulate_metadata
from export.evaluation.metrics import select_crops, sun_error
from export.evaluation.multi_view import groups_report
from export.evaluation.predictions import (
    CROPS_EACH,
    decode_answers,
    load_models,
    predict_views,
    protocol_views,
    sun_centered_views,
)
from export.evaluation.relighting import relight
from export.evaluation.report import Figures, format_report, in_view_report, photo_report, stated_figures
from lighting.color import tone_map
from lighting.files.atomic import atomic_write
from lighting.model import Model

SCORED = ("paper", "phone")  # protocols
PHOTOS = "photos.csv"


@dataclass(frozen=True)
class Options:
    """What is evaluated, and what the report holds besides the accuracy of each network."""

    data: Path  # folder of panoramas
    labels: Path
    models: tuple[Path, ...]  # ours first
    out: Path  # folder for report.md, the crops' errors and pictures
    with_metadata: bool = False  # also our answers with simulated metadata and with several views of a panorama
    failures: bool = False  # also write our worst crops as failures.csv and failures.png
    relight: bool = False  # also relight objects, and judge the light by weather; writes relight.png


@dataclass(frozen=True)
class Evaluation:
    """The report in Markdown, and our network's figures by protocol."""

    report: str
    figures: dict[str, Figures]


@dataclass(frozen=True)
class _Methods:
    """All that answers: networks, and baselines made of the training labels."""

    models: dict[str, Model]
    training: Sequence[Label]


def evaluate_networks(options: Options) -> Evaluation:
    """Score the networks on the `val` split; writes the report into `options.out`.

    Raises DataError for data or labels that cannot be used and ModelError for a missing network.
    """
    training = read_labels_of(read_index(options.data, "train"), options.labels)
    sources = load_sources(read_index(options.data, "val"), options.labels)
    methods = _Methods(load_models(options.models), training)
    options.out.mkdir(parents=True, exist_ok=True)
    lit: list[str] = []
    if options.relight:  # first, for it asks most of the folder
        lit.append(relight(options.data, options.labels, options.models, options.out))
        lit.append(light_report(options.data, options.labels, options.models))
    judged = {protocol: _judge(methods, sources, protocol) for protocol in SCORED}
    for protocol, j in judged.items():
        _write_crops(options.out / f"crops-{protocol}.csv", j)
    text = "\n\n".join([*_sections(options, methods, sources, judged), *lit]) + "\n"
    with atomic_write(options.out / "report.md") as path:
        path.write_text(text)
    return Evaluation(text, {p: stated_figures(j.truth, j.said[j.ours]) for p, j in judged.items()})


def _judge(methods: _Methods, sources: Sequence[Source], protocol: str) -> ScoredCrops:
    views = protocol_views(sources, protocol)
    looked = predict_views(methods.models, views)
    truth, ours = looked.truth, next(iter(methods.models))
    alone, said = ({n: decode_answers(p, truth.sun) for n, p in by.items()} for by in (looked.alone, looked.said))
    said |= baseline_answers(truth, methods.training)
    return ScoredCrops(views, truth, looked.said[ours], looked.with_lens, said, alone)


def _sections(
    options: Options, methods: _Methods, sources: Sequence[Source], judged: dict[str, ScoredCrops]
) -> list[str]:
    sections = [format_report(protocol, j.truth, j.said, j.alone, j.ours) for protocol, j in judged.items()]
    sections += _sun_in_view(sources, methods.models)
    if (options.data / PHOTOS).exists():
        sections.append(photo_report(options.data / PHOTOS, methods.models))
    scored = {protocol: j for protocol, j in judged.items() if j.truth.scored.any()}
    sections += diagnostic_sections(scored, options.out, failures=options.failures)
    if options.with_metadata:
        sections += [section for protocol, j in scored.items() for section in _metadata_sections(protocol, j)]
    return sections


def _sun_in_view(sources: Sequence[Source], models: dict[str, Model]) -> list[str]:
    """The section about crops that show the sun; none if no panorama shows its sun."""
    views = sun_centered_views(sources)
    if not views:
        return []
    looked = predict_views(models, views)
    truth = looked.truth
    chosen = truth.scored & (truth.in_view == "sun in view")
    said = {
        name: select_crops(decode_answers(predictions, truth.sun), chosen) for name, predictions in looked.said.items()
    }
    if not chosen.any():
        return []
    ours = list(zip(next(iter(looked.said.values())), looked.with_lens, strict=True))
    spec, shown = next(iter(models.values())).spec, np.flatnonzero(chosen).tolist()
    pictures = [tone_map(crop_panorama(*views[i], spec).linear) for i in shown]
    known = in_view_evidence(select_crops(truth, chosen), [ours[i] for i in shown], pictures)
    return [in_view_report(select_crops(truth, chosen), said, known)]


def _metadata_sections(protocol: str, judged: ScoredCrops) -> list[str]:
    """Our network's answers with simulated metadata, and with several views of a panorama."""
    taken = simulate_metadata(judged.truth, CROPS_EACH)
    azimuth = np.array([camera.azimuth for _, camera in judged.views])
    return [
        evidence_report(protocol, judged.truth, list(zip(judged.predictions, judged.with_lens, strict=True)), taken),
        groups_report(protocol, judged.truth, judged.predictions, taken, azimuth, CROPS_EACH),
    ]


def _write_crops(path: Path, judged: ScoredCrops) -> None:
    """One line per crop, with its camera and each method's error, for looking at failures."""
    truth = judged.truth
    errors = {name: sun_error(truth, said) for name, said in judged.said.items()}
    header = ["panorama", "azimuth", "elevation", "roll", "vertical_fov", "aspect", "in_view", "scored", *errors]
    rows = []
    for i, (source, c) in enumerate(judged.views):
        camera = (f"{v:.3f}" for v in (c.azimuth, c.elevation, c.roll, c.vertical_fov, c.aspect))
        own = (f"{error[i]:.2f}" for error in errors.values())
        rows.append([source.panorama.name, *camera, truth.in_view[i], int(truth.scored[i]), *own])
    write_table(path, header, rows)
