"""Accuracy of ONNX networks on crops of panoramas that training never saw, compared with answers without a network."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path

import numpy as np

from export.crops.crops import Source, crop_panorama, load_sources
from export.data.labels import read_labels_of
from export.data.panoramas import read_index, write_table
from export.evaluation.failures import draw_contact_sheet, failures_report, find_worst_crops, write_failures
from export.evaluation.irradiance import light_report
from export.evaluation.metadata import evidence_report, in_view_evidence, simulate_metadata
from export.evaluation.metrics import select_crops, sun_error
from export.evaluation.metrics_file import collect_metrics, write_metrics
from export.evaluation.multi_view import groups_report
from export.evaluation.predictions import (
    CROPS_EACH,
    ScoredCrops,
    load_models,
    protocol_views,
    score_views,
    sun_centered_views,
)
from export.evaluation.reliability import draw_reliability, reliability_curves, reliability_report, temperature_report
from export.evaluation.report import (
    CONSTANT,
    baseline_answers,
    format_report,
    in_view_report,
    photo_report,
    stated_figures,
    trust_report,
    turbidity_report,
)
from lighting.color import tone_map
from lighting.files import atomic_write
from lighting.model import Model

RELIABILITY_FILE = "reliability.png"
_PROTOCOLS = ("paper", "phone")  # of cameras
_PHOTOS = "photos.csv"


@dataclass(frozen=True)
class Options:
    """What is evaluated, and what the report holds besides the accuracy of each network."""

    data: Path  # folder of panoramas
    labels: Path
    models: tuple[Path, ...]  # ours first
    out: Path  # folder for report.md, the crops' errors and pictures
    with_metadata: bool = False  # also our answers with simulated metadata and with several views of a panorama
    failures: bool = False  # also write our worst crops as failures.csv and failures.png
    relight: bool = False  # also relight objects, and judge the light by weather


def evaluate_networks(options: Options) -> str:
    """Score the networks on the `val` split; write the report, and its figures as metrics.json; returns the report.

    Args:
        options: data, networks, what the report holds and where it goes.

    Raises:
        DataError: for data or labels that cannot be used.
        ModelError: for a missing network.
    """
    training = read_labels_of(read_index(options.data, "train"), options.labels)
    sources = load_sources(read_index(options.data, "val"), options.labels)
    models = load_models(options.models)
    options.out.mkdir(parents=True, exist_ok=True)
    lit: list[str] = []
    if options.relight:  # first, for it asks most of the folder
        lit.append(light_report(options.data, options.labels, options.models))
    crops: dict[str, ScoredCrops] = {}
    for protocol in _PROTOCOLS:
        scored = score_views(models, protocol_views(sources, protocol))
        crops[protocol] = replace(scored, answers=scored.answers | baseline_answers(scored.truth, training))
        _write_crops(options.out / f"crops-{protocol}.csv", crops[protocol])
    text = "\n\n".join([*_sections(options, models, sources, crops), *lit]) + "\n"
    with atomic_write(options.out / "report.md") as path:
        path.write_text(text)
    ours = next(iter(models))
    figures = {p: stated_figures(c.truth, c.answers[ours]) for p, c in crops.items()}
    write_metrics(collect_metrics(options.models[0], options.data, text, figures, ours), options.out)
    return text


def _sections(
    options: Options, models: dict[str, Model], sources: list[Source], crops: dict[str, ScoredCrops]
) -> list[str]:
    sections = [format_report(p, c.truth, c.answers, c.network_answers) for p, c in crops.items()]
    sections += _sun_in_view(sources, models)
    if (options.data / _PHOTOS).exists():
        sections.append(photo_report(options.data / _PHOTOS, models))
    scored = {protocol: c for protocol, c in crops.items() if c.truth.scored.any()}
    for protocol, c in scored.items():
        known = np.flatnonzero(c.truth.scored)
        sections.append(trust_report(f"`{protocol}`", [c.predictions[i] for i in known.tolist()], c.truth.sun[known]))
    sections += diagnostic_sections(scored, options.out, failures=options.failures)
    if options.with_metadata:
        sections += [section for protocol, c in scored.items() for section in _metadata_sections(protocol, c)]
    return sections


def diagnostic_sections(scored: dict[str, ScoredCrops], out: Path, *, failures: bool) -> list[str]:
    """The sections about the protocols that have a sun to score; writes reliability.png.

    Args:
        scored: by protocol.
        out: folder for the pictures.
        failures: write failures.csv and failures.png as well.
    """
    levels = {protocol: reliability_curves(crops.truth, crops.predictions) for protocol, crops in scored.items()}
    sections = [reliability_report(protocol, curves) for protocol, curves in levels.items()]
    sections += [temperature_report(protocol, crops.truth, crops.predictions) for protocol, crops in scored.items()]
    if levels:
        draw_reliability(levels, out / RELIABILITY_FILE)
    if "paper" in scored:
        sections += _paper_sections(scored["paper"], out, failures=failures)
    return sections


def _paper_sections(scored: ScoredCrops, out: Path, *, failures: bool) -> list[str]:
    kind = np.array([source.panorama.kind for source, _ in scored.views])
    ours = scored.answers[scored.ours]
    worst = find_worst_crops(scored.truth, ours)
    if failures:
        write_failures(out / "failures.csv", worst, np.array([camera.azimuth for _, camera in scored.views]))
        spec = scored.predictions[0].spec
        pictures = [tone_map(crop_panorama(*scored.views[failure.index], spec).linear) for failure in worst]
        draw_contact_sheet(worst, pictures, out / "failures.png")
    return [turbidity_report("paper", scored.truth, ours, scored.answers[CONSTANT], kind), failures_report(worst)]


def _sun_in_view(sources: Sequence[Source], models: dict[str, Model]) -> list[str]:
    """The section about crops that show the sun; none if no panorama shows its sun."""
    views = sun_centered_views(sources)
    if not views:
        return []
    scored = score_views(models, views)
    chosen = scored.truth.scored & (scored.truth.in_view == "sun in view")
    if not chosen.any():
        return []
    truth = select_crops(scored.truth, chosen)
    answers = {name: select_crops(of_all, chosen) for name, of_all in scored.answers.items()}
    shown = list(compress(zip(views, scored.predictions, scored.with_lens, strict=True), chosen))
    pictures = [tone_map(crop_panorama(*view, prediction.spec).linear) for view, prediction, _ in shown]
    evidence = in_view_evidence(truth, [(plain, with_lens) for _, plain, with_lens in shown], pictures)
    return [in_view_report(truth, answers, evidence)]


def _metadata_sections(protocol: str, scored: ScoredCrops) -> list[str]:
    """Our network's answers with simulated metadata, and with several views of a panorama."""
    metadata = simulate_metadata(scored.truth, CROPS_EACH)
    azimuth = np.array([camera.azimuth for _, camera in scored.views])
    predictions = list(zip(scored.predictions, scored.with_lens, strict=True))
    evidence = evidence_report(protocol, scored.truth, predictions, metadata)
    return [evidence, groups_report(protocol, scored.truth, scored.predictions, metadata, azimuth, CROPS_EACH)]


def _write_crops(path: Path, scored: ScoredCrops) -> None:
    """One line per crop, with its camera and each method's error, for looking at failures."""
    truth = scored.truth
    errors = {name: sun_error(truth, answers) for name, answers in scored.answers.items()}
    header = ["panorama", "azimuth", "elevation", "roll", "vertical_fov", "aspect", "in_view", "scored", *errors]
    rows = []
    for i, (source, c) in enumerate(scored.views):
        camera = (f"{v:.3f}" for v in (c.azimuth, c.elevation, c.roll, c.vertical_fov, c.aspect))
        crop_errors = (f"{error[i]:.2f}" for error in errors.values())
        rows.append([source.panorama.name, *camera, truth.in_view[i], int(truth.scored[i]), *crop_errors])
    write_table(path, header, rows)
