"""The accuracy that a model card states, as numbers."""

import re
from pathlib import Path

from lighting.parameters import ModelSpec

CARD = "MODEL_CARD.md"
COLUMNS = {  # in the card's tables of the sun: in an answer
    "crops": "crops",
    "median": "sun_median",
    "quartile 1": "sun_quartile_1",
    "quartile 3": "sun_quartile_3",
    "< 22.5° %": "within_22_5",
    "< 45° %": "within_45",
    "in 50 % region": "in_50_region",
    "in 90 % region": "in_90_region",
}


def accuracy(spec: ModelSpec, folder: Path) -> dict[str, dict[str, float]]:
    """Protocol: name: value, from the card beside a network; empty where there is none or it is of another network."""
    card = folder / CARD
    text = card.read_text(encoding="utf-8") if card.is_file() else ""
    if f"# {spec.name} {spec.version}\n" not in text:
        return {}
    sections = re.findall(r"^## Protocol `(\w+)`.*?$(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    return {protocol: _numbers(section, spec.name) for protocol, section in sections}


def _numbers(section: str, network: str) -> dict[str, float]:
    """The network's row of a section's first table."""
    header, _, *rows = [_cells(line) for line in section.splitlines() if line.startswith("|")]
    row = next(row for row in rows if row[0] == network)
    return {COLUMNS[name]: float(cell) for name, cell in zip(header, row, strict=True) if name in COLUMNS}


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("|").split("|")]
