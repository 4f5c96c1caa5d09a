"""metrics.json: every figure of an evaluation as its report prints it, which the model card and the pages cite."""

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from export.data.panoramas import DataError, Panorama, is_permissive, read_index
from export.evaluation.report import Figures
from lighting.files import atomic_write
from lighting.model import METRICS, Model, network_sha256
from lighting.onnx_session import weights_path

Cell = float | list[float] | str | None
_NUMBER = re.compile(r"[+-]?\d+(?:\.\d+)?(?: ?%)?")
_METADATA = ("commit", "networks", "parity", "temperature", "elevation_scale")  # of the network's file


@dataclass(frozen=True)
class _FigureTable:
    """One table: its caption, and its cells by row and column; an interval is a list of two numbers."""

    caption: str
    rows: dict[str, dict[str, Cell]]


@dataclass(frozen=True)
class FigureSection:
    """A part of the report: its title, what it says beside the tables, and these."""

    title: str
    notes: tuple[str, ...]
    tables: tuple[_FigureTable, ...]


@dataclass(frozen=True)
class NetworkMetrics:
    """What an evaluation found about one network."""

    name: str
    version: str
    date: str  # of the evaluation, YYYY-MM-DD
    row: str  # the network's own row in the tables
    network: dict[str, str | float]  # facts of its file
    data: dict[str, int]  # panoramas and places of the folder
    labels: tuple[str, ...]  # how well suns and skies that are found agree with known ones; with the card alone
    accuracy: dict[str, Figures]  # by protocol, as `GET /v1/model` answers them
    sections: tuple[FigureSection, ...]

    def figure(self, section: str, table: str, row: str, column: str) -> Cell:
        """One cell; None where the report has no such table, row or column.

        Args:
            section: how its title begins.
            table: how its caption begins.
            row: name of the row.
            column: name of the column.
        """
        tables = (t for s in self.sections if s.title.startswith(section) for t in s.tables)
        found = next((t.rows for t in tables if t.caption.startswith(table) and row in t.rows), {})
        return found.get(row, {}).get(column)


def collect_metrics(model: Path, data: Path, report: str, accuracy: dict[str, Figures], row: str) -> NetworkMetrics:
    """Bring an evaluation's figures together with facts of the network and its data.

    Args:
        model: the network's file.
        data: folder of panoramas.
        report: in Markdown.
        accuracy: figures by protocol.
        row: the network's name in the report's tables.
    """
    loaded = Model.load(model)
    stated = {protocol: values for protocol, values in accuracy.items() if None not in values.values()}
    return NetworkMetrics(
        name=loaded.spec.name,
        version=loaded.spec.version,
        date=datetime.now(UTC).date().isoformat(),
        row=row,
        network=_network_facts(loaded, model),
        data=_data_facts(read_index(data)),
        labels=(),
        accuracy=stated,
        sections=tuple(read_sections(report)),
    )


def write_metrics(metrics: NetworkMetrics, folder: Path) -> Path:
    """Write metrics.json into a folder; returns its path.

    Args:
        metrics: to write.
        folder: of the network's file, or of the report.
    """
    target = folder / METRICS
    text = json.dumps(asdict(metrics), indent=1, ensure_ascii=False) + "\n"
    with atomic_write(target) as path:
        path.write_text(re.sub(r"\[\s+([-\d.]+),\s+([-\d.]+)\s+\]", r"[\1, \2]", text), encoding="utf-8")
    return target


def read_metrics(path: Path) -> NetworkMetrics:
    """The figures that `write_metrics` wrote; DataError if the file is missing or another one.

    Args:
        path: of metrics.json.
    """
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
        sections = [
            FigureSection(s["title"], tuple(s["notes"]), tuple(_FigureTable(**table) for table in s["tables"]))
            for s in values.pop("sections")
        ]
        return NetworkMetrics(**{**values, "labels": tuple(values["labels"])}, sections=tuple(sections))
    except OSError as error:
        raise DataError(f"{path} cannot be read: {error.strerror or error}.") from error
    except (ValueError, TypeError, KeyError) as error:
        raise DataError(f"{path} holds no figures of an evaluation; run `python -m export evaluate`.") from error


def read_sections(report: str) -> Iterator[FigureSection]:
    """The sections of a report with their tables.

    Args:
        report: in Markdown, as `evaluate` prints it.
    """
    for section in re.split(r"^## ", report, flags=re.MULTILINE)[1:]:
        title, _, body = section.partition("\n")
        notes: list[str] = []
        tables: list[_FigureTable] = []
        for paragraph in filter(None, (part.strip() for part in body.split("\n\n"))):
            if paragraph.startswith("|"):
                caption = notes.pop() if notes else ""
                tables.append(_FigureTable(caption, _read_rows(paragraph)))
            else:
                notes.append(" ".join(paragraph.split()))
        yield FigureSection(title.strip(), tuple(notes), tuple(tables))


def _read_rows(table: str) -> dict[str, dict[str, Cell]]:
    header, _, *rows = ([cell.strip() for cell in line.strip("|").split(" | ")] for line in table.splitlines())
    columns = _name_columns(header[1:])
    return {row[0]: dict(zip(columns, map(_read_cell, row[1:]), strict=True)) for row in rows}


def _name_columns(header: Sequence[str]) -> list[str]:
    """Names of columns, of which those that stand several times are named by the one before them, too."""
    names, group = [], ""
    for name in header:
        if header.count(name) > 1:
            names.append(f"{group}, {name}")
        else:
            group = name
            names.append(name)
    return names


def _read_cell(text: str) -> Cell:
    low, to, high = text.partition(" to ")
    if to and _NUMBER.fullmatch(low) and _NUMBER.fullmatch(high):
        return [float(low), float(high)]
    if text in ("", "-"):
        return None
    return float(text.rstrip(" %")) if _NUMBER.fullmatch(text) else text


def _network_facts(loaded: Model, path: Path) -> dict[str, str | float]:
    metadata = loaded.session.get_modelmeta().custom_metadata_map
    spec = loaded.spec
    return {
        "file": path.name,
        "megabytes": round(sum(f.stat().st_size for f in (path, weights_path(path)) if f.is_file()) / 1e6, 1),
        "sha256": network_sha256(path),
        "licence": spec.licence,
        "grid": spec.sun_grid.rpartition(":")[2],
        "width": spec.width,
        "height": spec.height,
        "training": spec.training_data,
        **{name: metadata.get(name, "unknown") for name in _METADATA},
    }


def _data_facts(panoramas: Sequence[Panorama]) -> dict[str, int]:
    train, val = ([p for p in panoramas if p.split == split] for split in ("train", "val"))
    return {
        "train": len(train),
        "train_places": len({p.place for p in train}),
        "train_permissive": sum(is_permissive(p.licence) for p in train),
        "val": len(val),
        "val_places": len({p.place for p in val}),
    }
