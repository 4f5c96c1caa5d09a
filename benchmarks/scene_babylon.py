"""Render a glTF scene in Babylon.js, the one viewer that takes EXT_lights_image_based, headless in Chromium.

Babylon.js comes from npm (`npm ci --prefix benchmarks/node`).
"""

import base64
from pathlib import Path
from string import Template

MODULES = Path(__file__).parent / "node" / "node_modules"
SCRIPTS = (MODULES / "babylonjs" / "babylon.js", MODULES / "babylonjs-loaders" / "babylonjs.loaders.min.js")
PAGE = "babylon.html"

_PAGE = Template("""<!doctype html>
<style>body { margin: 0; overflow: hidden } canvas { display: block }</style>
<canvas width="$width" height="$height"></canvas>
<script>$library</script>
<script>$loaders</script>
<script>
(async () => {
  BABYLON.SceneLoader.ShowLoadingScreen = false;
  const engine = new BABYLON.Engine(document.querySelector("canvas"), true, { preserveDrawingBuffer: true });
  const scene = new BABYLON.Scene(engine);
  await BABYLON.SceneLoader.AppendAsync("", "data:model/gltf-binary;base64,$file", scene, null, ".glb");
  scene.activeCamera = scene.cameras[0];
  const [sun] = scene.lights;
  const shadows = new BABYLON.ShadowGenerator(4096, sun);
  shadows.usePercentageCloserFiltering = true;
  const ball = scene.getMeshByName("Ball");
  sun.position = ball.getAbsolutePosition().subtract(sun.direction.scale(20));
  for (const name of ["Ball", "Stick"]) shadows.addShadowCaster(scene.getMeshByName(name));
  scene.getMeshByName("Ground").receiveShadows = true;
  await scene.whenReadyAsync();
  scene.render();
  scene.render();
})();
</script>
""")


def write_page(folder: Path, size: tuple[int, int]) -> Path:
    """A page beside scene.glb that shows it; glTF says nothing of shadows, so the page has the objects cast them."""
    library, loaders = (script.read_text(encoding="utf-8") for script in SCRIPTS)
    file = base64.b64encode((folder / "scene.glb").read_bytes()).decode()
    page = folder / PAGE
    page.write_text(
        _PAGE.substitute(width=size[0], height=size[1], library=library, loaders=loaders, file=file), encoding="utf-8"
    )
    return page
