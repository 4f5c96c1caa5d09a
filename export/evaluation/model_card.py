"""The model card, and what the pages say of accuracy: both are written from metrics.json, so no figure is typed."""

import re
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from textwrap import fill

from export.data.panoramas import DataError
from export.evaluation.evaluate import RELIABILITY_FILE
from export.evaluation.metrics import markdown_table
from export.evaluation.metrics_file import Cell, NetworkMetrics, read_metrics, write_metrics
from lighting.files import atomic_write
from lighting.model import METRICS, MODEL_CARD, network_sha256, packaged_model

ROOT = Path(__file__).parents[2]
_TEMPLATE = Path(__file__).with_name("card_template.md")
RELIABILITY = Path("docs") / "images" / RELIABILITY_FILE
PAGES = ("README.md", "docs/understand/trust.md")  # which cite figures between marks
_MARKED = re.compile(r"(<!--metrics:(\w+)-->\n?).*?(\n?<!--/metrics-->)", re.DOTALL)
_PROTOCOLS = {"paper": "ordinary view", "phone": "as phones take them"}
_SCORED = re.compile(r"with a sun to score \((\d+) panoramas of (\d+) places\)")  # in the title of a protocol
_SCENES = re.compile(r": (\d+) scenes")  # in the caption of a table
_EARLIER = re.compile(r"outdoor \d+\.\d+\.\d+")  # networks of this project
_WIDTH = 120  # columns of a paragraph
_EVIDENCE = {  # rows of the table: where the report has them
    "sun, each place once": ("Protocol", "Each place counted alike", "{ours}", "median"),
    "sun, best fixed answer": ("Protocol", "Sun [", "constant direction", "median"),
    "sun, with time and place": ("Metadata, protocol", "", "pixels + time+place", "sun"),
    "sun, with compass, too": ("Metadata, protocol", "", "pixels + time+place + heading", "sun"),
}


def publish_evaluation(evaluation: Path, labels: Sequence[str] = ()) -> Path:
    """Take an evaluation of the package's network over: metrics.json, the card, and the pages' figures and diagram.

    Returns the card's path.

    Args:
        evaluation: folder that `evaluate` wrote.
        labels: sentences about how well labels agree with what is known; none keeps those of the evaluation.

    Raises:
        DataError: it is of another network, or has no metrics.json.
    """
    metrics = read_metrics(evaluation / METRICS)
    model = packaged_model()
    if metrics.network["sha256"] != network_sha256(model):
        raise DataError(f"{evaluation / METRICS} is of {metrics.network['file']}, not of {model}.")
    write_metrics(replace(metrics, labels=tuple(labels) or metrics.labels), model.parent)
    diagram = evaluation / RELIABILITY_FILE
    if diagram.is_file():
        with atomic_write(ROOT / RELIABILITY) as path:
            shutil.copyfile(diagram, path)
    return write_card()


def write_card() -> Path:
    """Write the card of the package's network, and the pages' figures, from its metrics.json; returns the card's path.

    Raises:
        DataError: there is no metrics.json, or a page asks for figures that are none.
    """
    folder = packaged_model().parent
    metrics = read_metrics(folder / METRICS)
    texts = {folder / MODEL_CARD: _render_card(metrics)}
    for page in (ROOT / name for name in PAGES if (ROOT / name).is_file()):
        texts[page] = _fill_figures(page.read_text(encoding="utf-8"), metrics)
    for target, text in texts.items():
        with atomic_write(target) as path:
            path.write_text(text, encoding="utf-8")
    return folder / MODEL_CARD


def _render_card(metrics: NetworkMetrics) -> str:
    """The card's text.

    Args:
        metrics: of the network.
    """
    values = {
        **metrics.network,
        **metrics.data,
        "name": metrics.name,
        "version": metrics.version,
        "date": metrics.date,
        **_texts(metrics),
        "table": _accuracy_table(metrics, others=True),
        "limits": fill(" ".join(_limits(metrics)), _WIDTH),
    }
    return _TEMPLATE.read_text(encoding="utf-8").format(**values)


def _fill_figures(page: str, metrics: NetworkMetrics) -> str:
    """A page with the figures between its marks `<!--metrics:NAME-->` and `<!--/metrics-->` as they are now.

    Args:
        page: its text; NAME is one of `_texts`.
        metrics: of the network.

    Raises:
        DataError: a mark has another name.
    """
    texts = _texts(metrics)

    def filled(mark: re.Match[str]) -> str:
        if mark[2] not in texts:
            raise DataError(f"There are no figures {mark[2]!r}, only {', '.join(texts)}.")
        return f"{mark[1]}{texts[mark[2]]}{mark[3]}"

    return _MARKED.sub(filled, page)


def _texts(metrics: NetworkMetrics) -> dict[str, str]:
    data, date, scored = metrics.data, metrics.date, _scored_suns(metrics)
    suns = f", their suns on {scored[0]} of {scored[1]} places" if scored else ""
    scope = f"on {data['val']} panoramas of {data['val_places']} places that training never saw"
    by_height = "Protocol `paper`", f"`{metrics.row}` by true", "sun 0 to 20°"
    low = _signed("Those under 20° are placed {} in the median.", metrics.figure(*by_height, "elevation bias"))
    inside = _sentence("{:.0f} % lie within `radius_90`.", metrics.figure(*by_height, "in 90 % region"))
    return {
        "line": f"{_accuracy_line(metrics)} ({date}).",
        "scope": f"The network was scored {scope}{suns} (`python -m export evaluate`, {date}).",
        "scored": suns,
        "table": _accuracy_table(metrics, others=False),
        "photos": " ".join(filter(None, _photo_sentences(metrics))),
        "low_suns": f"{low} {inside}".strip(),
    }


def _scored_suns(metrics: NetworkMetrics) -> tuple[str, str] | None:
    """How many panoramas have a sun to score, and of how many places; None where the report does not say."""
    title = next((s.title for s in metrics.sections if s.title.startswith("Protocol `paper`")), "")
    found = _SCORED.search(title)
    return (found[1], found[2]) if found else None


def _accuracy_line(metrics: NetworkMetrics) -> str:
    """README's sentence, without its end: the median for crops of panoramas, and for ordinary photos where measured."""
    scored = _scored_suns(metrics)
    panoramas = f"{scored[0] if scored else metrics.data['val']} panoramas"
    crops = f"On crops of {panoramas} from new places, half of the answers lie within "
    crops += f"{metrics.accuracy['paper']['sun_median']}° of the true sun"
    direct, everywhere = _photo_medians(metrics)
    if not (isinstance(direct, float) and isinstance(everywhere, float)):
        return crops
    return f"{crops}. On ordinary photos in sun it is {direct:.0f}°, on all {everywhere:.0f}°"


def _accuracy_table(metrics: NetworkMetrics, *, others: bool) -> str:
    """Medians in degrees and shares by protocol; of other networks only where asked for."""
    accuracy = [metrics.accuracy[protocol] for protocol in _PROTOCOLS]
    angles = ("camera_elevation_median", "camera_roll_median", "vertical_fov_median")
    rows = [
        ["sun", *(_with_interval(metrics, protocol, metrics.row) for protocol in _PROTOCOLS)],
        *_measured_rows(metrics, _EVIDENCE),
        ["sun within 22.5° / 45°", *(f"{a['within_22_5']:.0f} % / {a['within_45']:.0f} %" for a in accuracy)],
        [
            "true sun within `radius_50` / `radius_90`",
            *(f"{a['in_50_region']:.0f} % / {a['in_90_region']:.0f} %" for a in accuracy),
        ],
        ["camera elevation, roll, field of view", *(", ".join(f"{a[name]:.1f}" for name in angles) for a in accuracy)],
        *(_other_rows(metrics) if others else ()),
    ]
    return markdown_table(["", *_PROTOCOLS.values()], rows)


def _with_interval(metrics: NetworkMetrics, protocol: str, row: str) -> str:
    """Median error of the sun with its interval over panoramas, where the report has one."""
    table = f"Protocol `{protocol}`", "Median sun error", row
    interval = metrics.figure(*table, "over panoramas")
    bounds = f" ({interval[0]:.1f} to {interval[1]:.1f})" if isinstance(interval, list) else ""
    return f"{metrics.accuracy[protocol]['sun_median']:.1f}{bounds}"


def _other_rows(metrics: NetworkMetrics) -> list[list[str]]:
    """Earlier networks that the same report scores."""
    paper = next(s for s in metrics.sections if s.title.startswith("Protocol `paper`"))
    names = [name for name in paper.tables[0].rows if name != metrics.row]
    labels = {name: f"sun, network {name.rpartition(' ')[2]}" for name in names if _EARLIER.fullmatch(name)}
    return _measured_rows(metrics, {text: ("Protocol", "Sun [", name, "median") for name, text in labels.items()})


def _measured_rows(metrics: NetworkMetrics, wanted: dict[str, tuple[str, str, str, str]]) -> list[list[str]]:
    """Rows of angles by protocol, without those that the report lacks."""
    rows = []
    for label, (section, table, row, column) in wanted.items():
        of = row.format(ours=metrics.row)
        cells = [metrics.figure(f"{section} `{protocol}`", table, of, column) for protocol in _PROTOCOLS]
        if None not in cells:
            rows.append([label, *(f"{cell:.1f}" for cell in cells)])
    return rows


def _photo_medians(metrics: NetworkMetrics) -> tuple[Cell, Cell]:
    """Median error of the sun in single photos: in direct sun, and in all."""
    titles = "Direct sun: ", "All that have"
    direct, everywhere = (metrics.figure("Real photos", title, metrics.row, "sun") for title in titles)
    return direct, everywhere


def _photo_sentences(metrics: NetworkMetrics) -> list[str]:
    direct, everywhere = _photo_medians(metrics)
    captions = [t.caption for s in metrics.sections if s.title.startswith("Real photos") for t in s.tables]
    counts = [found[1] for caption in captions if (found := _SCENES.search(caption))]
    of_all, of_direct = counts[:2] if len(counts) > 1 else ("all", "the")
    return [
        _sentence(f"In single photos the median error is {{:.0f}}° over {of_direct} scenes in direct sun,", direct),
        _sentence(f"and {{:.0f}}° over {of_all}, most in shade or under clouds.", everywhere),
    ]


def _limits(metrics: NetworkMetrics) -> list[str]:
    """Sentences about low and high suns, suns in the photo and ordinary photos, as far as the report knows."""
    by_height = f"`{metrics.row}` by true sun elevation"
    low = metrics.figure("Protocol `paper`", by_height, "sun 0 to 20°", "elevation bias")
    high = metrics.figure("Protocol `paper`", by_height, "sun 45 to 90°", "elevation bias")
    photos = metrics.figure("Real photos", "Elevation less", metrics.row, "45 to 90°")
    seen = metrics.figure("Sun in the picture", "Cameras", metrics.row, "median")
    sentences = [
        _signed("Suns lower than 20° are placed {}.", low),
        _signed("Suns higher than 45° are placed {} in crops.", high),
        _signed("In single photos in direct sun, they are {}.", photos),
        _sentence("A sun inside the photo is found within {:.1f}° (median).", seen),
        *_photo_sentences(metrics),
    ]
    return [sentence for sentence in sentences if sentence]


def _sentence(text: str, value: Cell) -> str:
    return text.format(value) if isinstance(value, float) else ""


def _signed(text: str, value: Cell) -> str:
    """The sentence with an elevation's bias, which is positive for suns that are placed too high."""
    if not isinstance(value, float):
        return ""
    return text.format(f"{abs(value):.0f}° too {'high' if value > 0 else 'low'}")
