// Lights a knot with the light of a photo, and in augmented reality with that of the device where it estimates one.
// light.json is what `lighting light-probe photo.jpg --for webxr` prints: the attributes of an XRLightEstimate.
import * as THREE from "three";

const renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true, preserveDrawingBuffer: true });
renderer.xr.enabled = true;
document.body.prepend(renderer.domElement);

const scene = new THREE.Scene();
const camera = new THREE.PerspectiveCamera(40, 1, 0.05, 20);
const probe = new THREE.LightProbe();
const sun = new THREE.DirectionalLight();
const knot = new THREE.Mesh(
  new THREE.TorusKnotGeometry(0.12, 0.045, 192, 32),
  new THREE.MeshStandardMaterial({ color: 0xcccccc, roughness: 1, metalness: 0 }),
);
knot.position.set(0, 0, -1); // one metre ahead
scene.add(probe, sun, sun.target, knot);

/** Takes an XRLightEstimate, or the same attributes from JSON. */
function light({ sphericalHarmonicsCoefficients, primaryLightDirection, primaryLightIntensity }) {
  probe.sh.fromArray(sphericalHarmonicsCoefficients);
  const { x, y, z } = primaryLightDirection;
  sun.position.set(x, y, z).add(knot.position);
  sun.target.position.copy(knot.position);
  sun.color.setRGB(primaryLightIntensity.x, primaryLightIntensity.y, primaryLightIntensity.z);
  sun.intensity = 1;
}

/** Follows a session's own estimates; the photo's light stays until there is one, and where there never is. */
async function followEstimates(session) {
  const lightProbe = await session.requestLightProbe?.().catch(() => undefined);
  if (!lightProbe) return;
  const onFrame = (_time, frame) => {
    const estimate = frame.getLightEstimate(lightProbe);
    if (estimate) light(estimate);
    session.requestAnimationFrame(onFrame);
  };
  session.requestAnimationFrame(onFrame);
}

async function enter() {
  const session = await navigator.xr.requestSession("immersive-ar", { optionalFeatures: ["light-estimation"] });
  await followEstimates(session);
  await renderer.xr.setSession(session);
}

function resize() {
  renderer.setSize(innerWidth, innerHeight);
  camera.aspect = innerWidth / innerHeight;
  camera.updateProjectionMatrix();
}

light(await (await fetch("light.json")).json());
addEventListener("resize", resize);
resize();
renderer.setAnimationLoop(() => renderer.render(scene, camera));
const button = document.getElementById("enter");
button.hidden = !(await navigator.xr?.isSessionSupported("immersive-ar"));
button.addEventListener("click", enter);
window.example = { THREE, renderer, scene, camera, probe, sun, knot, followEstimates, enter };
