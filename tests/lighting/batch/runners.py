"""The command, and what it wrote."""

import json
from pathlib import Path
from typing import Any

from click.testing import CliRunner, Result

from lighting.cli import cli

MANY = 150  # photos, so that a batch can be stopped half-way


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, ["batch", "--workers", "1", *map(str, arguments)], prog_name="lighting")


def records(out: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (out / "lighting.jsonl").read_text().splitlines()]
