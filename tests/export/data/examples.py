"""Folders of panoramas with an index."""

from pathlib import Path

from PIL import Image

ROW = {"name": "a", "file": "a.png", "kind": "ldr", "place": "here", "split": "train"}


def write_index(folder: Path, *rows: dict[str, str]) -> Path:
    Image.new("RGB", (8, 4), (10, 20, 30)).save(folder / "a.png")
    lines = [",".join(rows[0]), *[",".join(row.values()) for row in rows]]
    (folder / "panoramas.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder
