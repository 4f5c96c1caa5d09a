"""Visits of the service's pages in Chromium, by tests/browser/*.mjs."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

from server.pages import BUNDLE
from tests.helpers.pages import ROOT

PATIENCE = 400.0  # seconds

Seen = dict[str, Any]  # what a visitor saw


def chromium() -> str | None:
    """The browser's program."""
    return shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


def missing() -> str:
    """What a visit lacks here, as a sentence; empty if nothing."""
    if not shutil.which("node"):
        return "node is not installed"
    if not chromium():
        return "chromium is not installed"
    if not (BUNDLE / "index.html").is_file():
        return "the page is not built: run npm ci && npm run build in server/web"
    if not (BUNDLE.parent / "node_modules" / "playwright-core").is_dir():
        return "playwright-core is not installed: run npm ci in server/web"
    return ""


def visit_feature(url: str, feature: str, files: dict[str, Any]) -> Seen:
    """What a visitor of tests/browser/FEATURE.mjs sees, who brings files along."""
    run = Path(ROOT, "tests", "browser", "run.mjs")
    command = ["node", str(run), url, str(chromium()), feature, json.dumps(files)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 0, done.stderr
    seen: Seen = json.loads(done.stdout)
    return seen
