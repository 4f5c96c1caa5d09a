"""examples/webxr in Chromium, with a session that the test simulates; the maps of examples/model-viewer."""

import json
import re
import shlex
import shutil
import subprocess
import threading
from dataclasses import replace
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from lighting.cli import cli
from lighting.light_probe import compute_light_probe, encode_light_probe, irradiance_from_harmonics
from tests.helpers.predictions import stated_light
from tests.helpers.requirements import require

ROOT = Path(__file__).parents[2]
SCRIPT = """
<script>
const waiting = setInterval(async () => {
  if (!window.example) return;
  clearInterval(waiting);
  const { THREE, renderer, scene, camera, probe, sun, knot, followEstimates } = window.example;
  knot.geometry = new THREE.SphereGeometry(0.2, 64, 32);
  renderer.setAnimationLoop(null);
  const drawn = () => {
    renderer.render(scene, camera);
    const gl = renderer.getContext(), pixel = new Uint8Array(4);
    const { width, height } = renderer.domElement;
    gl.readPixels(width / 2, height / 2, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    return [...pixel].slice(0, 3);
  };
  const before = drawn();
  const estimate = await (await fetch("other.json")).json();
  const frames = [];
  await followEstimates({
    requestLightProbe: async () => ({}),
    requestAnimationFrame: (callback) => frames.push(callback),
  });
  frames.shift()(0, { getLightEstimate: () => estimate });
  document.body.textContent = `drawn ${JSON.stringify([before, drawn(), frames.length])}`;
}, 50);
</script>
"""


class _QuietHandler(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        pass


@pytest.mark.slow
def test_the_page_is_lit_by_the_photo_and_then_by_the_sessions_estimate(tmp_path: Path) -> None:
    program, modules = require("chromium"), require("tests/node")
    site = tmp_path / "site"
    shutil.copytree(ROOT / "examples" / "webxr", site)
    (site / "node_modules").symlink_to(modules)
    behind = replace(stated_light(), sun_azimuth=150.0)  # the camera, so that it lights what the camera sees
    dark = replace(behind, sun_irradiance=(0.0, 0.0, 0.0))
    probes = {name: compute_light_probe(light) for name, light in (("light", behind), ("other", dark))}
    for name, probe in probes.items():
        (site / f"{name}.json").write_text(encode_light_probe(probe, "webxr"))
    page = site / "index.html"
    page.write_text(page.read_text().replace("</html>", f"{SCRIPT}</html>"))
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_QuietHandler, directory=str(site)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    command = [
        program, "--headless", "--no-sandbox", "--no-first-run", "--disable-background-networking",
        "--use-angle=swiftshader", "--enable-unsafe-swiftshader", f"--user-data-dir={tmp_path / 'profile'}",
        "--virtual-time-budget=60000", "--dump-dom", f"http://127.0.0.1:{server.server_port}/index.html",
    ]  # fmt: skip
    try:
        shown = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True).stdout
    finally:
        server.shutdown()
        server.server_close()
    found = re.search(r"drawn (\[.*\])", shown)
    assert found, shown[-2000:]
    *colors, waiting = json.loads(found[1])
    assert waiting == 1  # for the next frame
    facing, albedo = np.array([0.0, 0.0, 1.0]), ((0xCC / 255 + 0.055) / 1.055) ** 2.4
    for color, probe in zip(colors, probes.values(), strict=True):
        light = probe.main_light
        total = irradiance_from_harmonics(probe.coefficients, facing) + light.irradiance * max(
            float(light.direction @ facing), 0.0
        )
        linear = ((np.array(color) / 255 + 0.055) / 1.055) ** 2.4
        assert linear == pytest.approx(albedo * total / np.pi, rel=0.05, abs=0.01)


def test_the_maps_of_model_viewer_have_the_photo_behind_the_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """model-viewer's camera looks along -Z, which is a quarter of three.js's maps from their left edge."""
    page = (ROOT / "examples" / "model-viewer" / "index.html").read_text(encoding="utf-8")
    backdrop, light = (shlex.split(line)[1:] for line in re.findall(r"^ +(lighting .+)$", page, re.MULTILINE))
    assert backdrop[-2:] == light[4:6] == ["--yaw", "-90"]
    monkeypatch.chdir(tmp_path)
    shutil.copy(ROOT / "examples" / "wide_street.jpg", "photo.jpg")
    result = CliRunner().invoke(cli, [*light, "--sun", "0,30"])
    assert result.exit_code == 0, result.output
    image = cv2.imread(light[3], cv2.IMREAD_UNCHANGED)
    assert image is not None
    column = image.max(axis=(0, 2)).argmax()  # of the sun ahead
    assert column / image.shape[1] == pytest.approx(0.25, abs=0.01)
