"""What Babylon.js shows of the map in a glTF file, in Chromium."""

import base64
import json
import re
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lighting.light_probe import irradiance_from_harmonics
from lighting.scene import gltf
from tests.helpers.predictions import UNIT_NORMALS
from tests.helpers.requirements import require
from tests.helpers.scenes import save_files, sunlit_scene

PAGE = """<!doctype html><canvas width="64" height="64"></canvas>
<script src="$BABYLON"></script><script src="$LOADERS"></script>
<script>
async function draw() {
  const engine = new BABYLON.Engine(document.querySelector("canvas"), false, { preserveDrawingBuffer: true });
  const scene = new BABYLON.Scene(engine);
  await BABYLON.SceneLoader.AppendAsync("", "data:;base64,$GLB", scene, undefined, ".glb");
  scene.lights.forEach((light) => light.setEnabled(false));
  scene.meshes.forEach((mesh) => mesh.setEnabled(false));
  const ball = BABYLON.MeshBuilder.CreateSphere("ball", { diameter: 1, segments: 32 }, scene);
  ball.material = new BABYLON.PBRMaterial("matte", scene);
  Object.assign(ball.material, { metallic: 0, roughness: 1, metallicF0Factor: 0 });
  const camera = new BABYLON.FreeCamera("camera", BABYLON.Vector3.Zero(), scene);
  Object.assign(camera, { fov: 0.1, minZ: 0.01 });
  scene.activeCamera = camera;
  const colors = [];
  for (const [x, y, z] of $NORMALS) {
    camera.position = new BABYLON.Vector3(-5 * x, 5 * y, 5 * z); // as the loader turns a file's frame
    camera.upVector = Math.abs(y) > 0.9 ? new BABYLON.Vector3(0, 0, 1) : BABYLON.Vector3.Up();
    camera.setTarget(BABYLON.Vector3.Zero());
    await scene.whenReadyAsync();
    scene.render();
    colors.push([...(await engine.readPixels(32, 32, 1, 1))].slice(0, 3));
  }
  return colors;
}
draw().then(
  (colors) => (document.body.textContent = `drawn ${JSON.stringify(colors)}`),
  (error) => (document.body.textContent = `failed ${error.stack}`),
);
</script>"""


@pytest.mark.slow
def test_a_matte_ball_has_the_maps_irradiance(tmp_path: Path) -> None:
    program, modules = require("chromium"), Path(require("tests/node"))
    scene = sunlit_scene()
    scene = replace(scene, environment=scene.environment * np.float32(0.5 / scene.environment.mean()))
    save_files(tmp_path, gltf.encode_gltf(scene))
    values = {
        "BABYLON": (modules / "babylonjs" / "babylon.js").as_uri(),
        "LOADERS": (modules / "babylonjs-loaders" / "babylonjs.loaders.min.js").as_uri(),
        "GLB": base64.b64encode((tmp_path / gltf.GLB_FILE).read_bytes()).decode(),
        "NORMALS": json.dumps(UNIT_NORMALS.tolist()),
    }
    page = tmp_path / "page.html"
    page.write_text(re.sub(r"\$([A-Z]+)", lambda found: values[found[1]], PAGE))
    command = [
        program, "--headless", "--no-sandbox", "--no-first-run", "--disable-background-networking",
        "--use-angle=swiftshader", "--enable-unsafe-swiftshader", f"--user-data-dir={tmp_path / 'profile'}",
        "--virtual-time-budget=60000", "--dump-dom", page.as_uri(),
    ]  # fmt: skip
    shown = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True).stdout
    drawn = re.search(r"drawn (\[.*\])", shown)
    assert drawn, shown[-2000:]
    linear = (np.array(json.loads(drawn[1])) / 255) ** 2.2
    assert linear == pytest.approx(
        irradiance_from_harmonics(scene.light_probe.coefficients, UNIT_NORMALS) / np.pi, rel=0.02, abs=0.004
    )
