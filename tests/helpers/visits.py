"""Visits of the service's pages in Chromium, by tests/browser/*.mjs."""

import json
import subprocess
from pathlib import Path
from typing import Any

from tests.helpers.pages import ROOT
from tests.helpers.requirements import require

PATIENCE = 400.0  # seconds

Seen = dict[str, Any]  # what a visitor saw


def visit_feature(url: str, feature: str, files: dict[str, Any]) -> Seen:
    """What a visitor of tests/browser/FEATURE.mjs sees, who brings files along."""
    run = Path(ROOT, "tests", "browser", "run.mjs")
    node, browser = require("node"), require("chromium")
    command = [node, str(run), url, browser, feature, json.dumps(files)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 0, done.stderr
    seen: Seen = json.loads(done.stdout)
    return seen
