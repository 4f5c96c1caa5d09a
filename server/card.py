"""The accuracy that a model card states, as numbers."""

import re
from pathlib import Path

from lighting.model import CARD
from lighting.records import ModelSpec

SUN = {  # column of the card's tables of the sun: name in an answer
    "crops": "crops",
    "median": "sun_median",
    "quartile 1": "sun_quartile_1",
    "quartile 3": "sun_quartile_3",
    "azimuth": "sun_azimuth_median",
    "elevation": "sun_elevation_median",
    "< 22.5° %": "within_22_5",
    "< 45° %": "within_45",
    "in 50 % region": "in_50_region",
    "in 90 % region": "in_90_region",
}
CAMERA_AND_SKY = {
    "elevation": "camera_elevation_median",
    "roll": "camera_roll_median",
    "fov": "vertical_fov_median",
    "turbidity": "turbidity_median",
    "exposure, stops": "exposure_median",
}


def accuracy(spec: ModelSpec, folder: Path) -> dict[str, dict[str, float]]:
    """Protocol: name: value, from the card beside a network; empty where there is none or it is of another network."""
    card = folder / CARD
    text = card.read_text(encoding="utf-8") if card.is_file() else ""
    full = f"{spec.name} {spec.version}"
    if f"# {full}\n" not in text:
        return {}
    sections = re.findall(r"^## Protocol `(\w+)`.*?$(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    return {protocol: _numbers(section, {spec.name, full}) for protocol, section in sections}


def _numbers(section: str, network: set[str]) -> dict[str, float]:
    """The network's numbers in a section's first table, of the sun, and in the one of camera and sky."""
    rows = [row for table in re.findall(r"(?:^\|.*\n)+", section, re.MULTILINE) for row in _rows(table, network)]
    camera = next(row for row in rows if "fov" in row)
    return {
        name: float(row[column])
        for row, names in ((rows[0], SUN), (camera, CAMERA_AND_SKY))
        for column, name in names.items()
    }


def _rows(table: str, network: set[str]) -> list[dict[str, str]]:
    """The rows of a table that have one of the network's names, by column."""
    header, _, *rows = [_cells(line) for line in table.splitlines()]
    return [dict(zip(header, row, strict=True)) for row in rows if row[0] in network]


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("|").split("|")]
