// Reads formats of a light probe and directions as JSON; prints the irradiance by three.js and by Babylon.js's engine.
const { readFileSync } = require("node:fs");
const { LightProbe, Vector3 } = require("three");
const { NullEngine, Scene, SphericalHarmonics, SphericalPolynomial } = require("babylonjs");

const { threejs, babylon, normals } = JSON.parse(readFileSync(0, "utf8"));
const probe = new LightProbe();
probe.sh.fromArray(threejs.lightProbe.sh);

new Scene(new NullEngine());
const harmonics = SphericalHarmonics.FromArray(babylon.sphericalHarmonics);
harmonics.convertIncidentRadianceToIrradiance();
harmonics.convertIrradianceToLambertianRadiance();
const scaled = SphericalPolynomial.FromHarmonics(harmonics).preScaledHarmonics; // what its shader gets
const names = ["l00", "l1_1", "l10", "l11", "l2_2", "l2_1", "l20", "l21", "l22"];

function byBabylon([x, y, z]) {
  const terms = [1, y, z, x, x * y, y * z, 3 * z * z - 1, z * x, x * x - y * y];
  return ["x", "y", "z"].map((channel) =>
    names.reduce((sum, name, i) => sum + Math.PI * terms[i] * scaled[name][channel], 0),
  );
}

console.log(
  JSON.stringify({
    threejs: normals.map((normal) => probe.sh.getIrradianceAt(new Vector3(...normal), new Vector3()).toArray()),
    babylon: normals.map(byBabylon),
  }),
);
process.exit(0);
