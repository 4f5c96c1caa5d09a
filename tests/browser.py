"""A headless Chromium for pages of three.js; tests that need it are skipped where there is none."""

import base64
import re
import shutil
import subprocess
import tempfile
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

_PROGRAMS = ("chromium", "chromium-browser", "google-chrome", "chrome")
_PICTURE = re.compile(r'<img class="drawn" alt="(\w+)" src="data:image/png;base64,([^"]+)"')


def drawings(page: Path, script: str, width: int, height: int) -> dict[str, NDArray[Any]]:
    """What `script` drew in an HTML file: it calls `drawn(name)`, after `lightingScene` has drawn, for each picture."""
    program = next(filter(None, map(shutil.which, _PROGRAMS)), None)
    if program is None:
        pytest.skip("Chromium is not installed")
    waiting = _WAITING.replace("SCRIPT", script).replace("SIZE", str([width, height]))
    page.write_text(page.read_text(encoding="utf-8").replace("</html>", waiting))
    with tempfile.TemporaryDirectory() as profile:
        command = [
            program, "--headless", "--no-sandbox", "--no-first-run", "--disable-background-networking",
            "--disable-component-update", "--disable-sync", "--host-resolver-rules=MAP * ~NOTFOUND",
            "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--force-device-scale-factor=1",
            f"--user-data-dir={profile}", f"--window-size={width},{height}", "--virtual-time-budget=60000",
            "--dump-dom", page.as_uri(),
        ]  # fmt: skip
        done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    found = dict(_PICTURE.findall(done.stdout))
    return {
        name: np.asarray(Image.open(BytesIO(base64.b64decode(data))).convert("RGB")) for name, data in found.items()
    }


_WAITING = """
<script>
function drawn(name) {
  const picture = document.createElement("img");
  Object.assign(picture, { className: "drawn", alt: name, src: lightingScene.renderer.domElement.toDataURL() });
  document.body.append(picture);
}
const waiting = setInterval(async () => {
  if (!window.lightingScene) return;
  clearInterval(waiting);
  [innerWidth, innerHeight] = SIZE; // the window's own frame takes some of it
  lightingScene.draw();
  SCRIPT
}, 100);
</script>
</html>
"""
