"""A headless Chromium for pages of three.js; tests that need it are skipped where there is none."""

import base64
import re
import subprocess
import tempfile
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from tests.helpers.requirements import require

ATTEMPTS = 3
_END = 'data-script="ended"'
_PICTURE = re.compile(r'<img class="drawn" alt="(\w+)" src="data:image/png;base64,([^"]+)"')


def drawings(page: Path, script: str, width: int, height: int) -> dict[str, NDArray[Any]]:
    """What `script` drew in an HTML file: it calls `drawn(name)`, after `lightingScene` has drawn, for each picture."""
    program = require("chromium")
    waiting = _WAITING.replace("SCRIPT", script).replace("SIZE", str([width, height]))
    page.write_text(page.read_text(encoding="utf-8").replace("</html>", waiting))
    found = next(filter(None, (_finished(program, page, width, height) for _ in range(ATTEMPTS))), None)
    assert found is not None, "The page's script did not come to its end."
    return {
        name: np.asarray(Image.open(BytesIO(base64.b64decode(data))).convert("RGB")) for name, data in found.items()
    }


def _finished(program: str, page: Path, width: int, height: int) -> dict[str, str] | None:
    """The pictures by name, as PNG in base64; None if the browser's own clock ran out before the script did.

    That clock stands still for downloads but not for what other threads decode, which a busy machine does late.
    """
    with tempfile.TemporaryDirectory() as profile:
        command = [
            program, "--headless", "--no-sandbox", "--no-first-run", "--disable-background-networking",
            "--disable-component-update", "--disable-sync", "--host-resolver-rules=MAP * ~NOTFOUND",
            "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--force-device-scale-factor=1",
            f"--user-data-dir={profile}", f"--window-size={width},{height}", "--virtual-time-budget=60000",
            "--dump-dom", page.as_uri(),
        ]  # fmt: skip
        done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    return dict(_PICTURE.findall(done.stdout)) if _END in done.stdout else None


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
  document.body.dataset.script = "ended";
}, 100);
</script>
</html>
"""
