// Shows the photo with an object in its light. `THREE` is three.min.js, #scene holds what lighting/scene/threejs.py writes.
// `lightingScene` is there for programs: its `object` is the group that holds the placeholder, `show(child)` replaces it.
(async () => {
  const data = JSON.parse(document.getElementById("scene").textContent);
  const vector = (values) => new THREE.Vector3(...values);
  const bytes = (base64) => Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));

  const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  renderer.toneMapping = THREE.NoToneMapping; // so that the plate stays as it is
  renderer.shadowMap.enabled = true;
  renderer.shadowMap.type = THREE.PCFShadowMap;
  document.body.prepend(renderer.domElement);

  const scene = new THREE.Scene();
  const plate = await new THREE.TextureLoader().loadAsync(data.plate);
  plate.colorSpace = THREE.SRGBColorSpace;
  const lit = await new THREE.TextureLoader().loadAsync(data.litGround);
  const known = await new THREE.TextureLoader().loadAsync(data.ground);
  scene.background = plate;
  const map = new THREE.HDRLoader().parse(bytes(data.environment).buffer);

  const camera = new THREE.PerspectiveCamera(data.verticalFov, data.width / data.height, data.near, data.far);
  camera.applyMatrix4(new THREE.Matrix4().set(...data.cameraMatrix));

  const sun = new THREE.DirectionalLight(new THREE.Color().setRGB(...data.sunColour), data.sunIntensity);
  sun.castShadow = data.sunIntensity > 0;
  sun.shadow.mapSize.set(4096, 4096);
  scene.add(sun, sun.target);

  const resolution = new THREE.Vector2();
  const sunShare = { value: 1 }; // of the sun, that reaches the object and that it takes from the ground
  const contact = { value: { x: 0, y: 1, z: 0, w: 0 } }; // a ball in the object's place: center and radius
  const ground = new THREE.Mesh(new THREE.CircleGeometry(data.groundRadius, 64), shadowCatcher());
  ground.rotation.x = -Math.PI / 2;
  ground.receiveShadow = true;
  scene.add(ground);

  const object = new THREE.Group();
  object.position.copy(vector(data.spot));
  scene.add(object);

  // Each texel is the map's radiance; the map is turned so that three.js has the photo's direction at -Z. Its lower half
  // is the ground, which the sun reaches as far as `share` says.
  function environment(share) {
    const texture = new THREE.DataTexture(map.data.slice(), map.width, map.height, undefined, THREE.HalfFloatType);
    const ground = texture.image.data.subarray(map.data.length / 2);
    const gain = [...data.shadow.map((shade) => shade + share * (1 - shade)), 1];
    if (share < 1) {
      ground.forEach((half, i) => {
        ground[i] = THREE.DataUtils.toHalfFloat(THREE.DataUtils.fromHalfFloat(half) * gain[i % 4]);
      });
    }
    texture.mapping = THREE.EquirectangularReflectionMapping;
    texture.colorSpace = THREE.LinearSRGBColorSpace;
    texture.minFilter = texture.magFilter = THREE.LinearFilter;
    texture.flipY = true;
    texture.needsUpdate = true;
    return texture;
  }

  // The plate itself where the sun shines; where it is hidden, the plate times the sky's share of the ground's light. The
  // sun's share is less where the plate's ground already lies in shade. Of the sky's share a ball in the object's place hides
  // height x radius^2 / distance^3.
  function shadowCatcher() {
    const material = new THREE.ShadowMaterial({ transparent: false });
    material.onBeforeCompile = (shader) => {
      Object.assign(shader.uniforms, {
        plate: { value: plate },
        resolution: { value: resolution },
        lit: { value: lit },
        shade: { value: vector(data.shadow) },
        share: sunShare,
        ball: contact,
      });
      shader.vertexShader =
        "varying vec3 spot;\n" +
        shader.vertexShader.replace(
          "#include <project_vertex>",
          "#include <project_vertex>\nspot = ( modelMatrix * vec4( transformed, 1.0 ) ).xyz;",
        );
      shader.fragmentShader =
        "uniform sampler2D plate, lit; uniform vec2 resolution; uniform vec3 shade; uniform float share;\n" +
        "uniform vec4 ball; varying vec3 spot;\n" +
        shader.fragmentShader.replace(
          /gl_FragColor = .*;/,
          `vec2 place = gl_FragCoord.xy / resolution;
           vec3 sun = texture2D( lit, place ).r * ( 1.0 - shade );
           float open = 1.0 - min( 1.0, ball.y * ball.w * ball.w / pow( distance( spot, ball.xyz ), 3.0 ) );
           vec3 light = ( open * shade + sun * mix( 1.0, getShadowMask(), share ) ) / max( shade + sun, 1e-6 );
           gl_FragColor = vec4( texture2D( plate, place ).rgb * light, 1.0 );`,
        );
    };
    return material;
  }

  function placeholder() {
    const material = new THREE.MeshStandardMaterial({ roughness: 1, metalness: 0 });
    material.color.setScalar(data.albedo);
    const ball = new THREE.Mesh(new THREE.SphereGeometry(data.ballRadius, 96, 64), material);
    ball.position.y = data.ballRadius;
    const stick = new THREE.Mesh(
      new THREE.CylinderGeometry(data.stickRadius, data.stickRadius, data.stickHeight, 32),
      material,
    );
    stick.position.copy(vector(data.stickFoot)).sub(object.position);
    stick.position.y += data.stickHeight / 2;
    return new THREE.Group().add(ball, stick);
  }

  // As tall as the placeholder's stick.
  function teapot() {
    const material = new THREE.MeshPhysicalMaterial({ color: 0xb3262e, roughness: 0.45, clearcoat: 1, clearcoatRoughness: 0.06 });
    return new THREE.Mesh(new THREE.TeapotGeometry(data.stickHeight / 2, 20), material);
  }

  // Puts another object on the spot; it keeps its own size and its lowest point touches the ground.
  function show(child) {
    object.clear();
    object.add(child);
    child.position.y -= new THREE.Box3().setFromObject(child).min.y - object.position.y;
    child.traverse((part) => {
      part.castShadow = part.receiveShadow = true;
    });
    draw();
  }

  const mask = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  Object.assign(mask.canvas, { width: known.image.width, height: known.image.height });
  mask.drawImage(known.image, 0, 0);

  // 1 where the object stands in the sun, 0 in shade, by the mask's blue at its foot, or at the cell next to it.
  function litAtFoot() {
    const { width, height } = mask.canvas;
    const foot = object.position.clone().project(camera);
    const cell = (share, count) => Math.min(Math.max(Math.floor(share * count), 0), count - 1);
    const [x, y] = [cell((1 + foot.x) / 2, width), cell((1 - foot.y) / 2, height)];
    return foot.z > 1 ? 1 : mask.getImageData(x, y, 1, 1).data[2] / 255;
  }

  // Where the plate's ground is in shade, the sun reaches neither the object nor the ground that reflects light to it. The
  // ground that is seen has its sun from the mask.
  let lastShare;
  function shine() {
    const share = litAtFoot();
    if (share === lastShare) return;
    lastShare = share;
    sunShare.value = share;
    sun.intensity = share * data.sunIntensity;
    scene.environment?.dispose();
    scene.environment = environment(share);
  }

  // The shadow map covers the object as the sun sees it, and reaches as far as its shadow.
  function aim() {
    const box = new THREE.Box3().setFromObject(object);
    const sphere = box.getBoundingSphere(new THREE.Sphere());
    const [x, y, z] = box.getCenter(new THREE.Vector3()).toArray();
    const extent = box.getSize(new THREE.Vector3());
    Object.assign(contact.value, { x, y, z, w: Math.min(extent.x, extent.y, extent.z) / 2 });
    const { shadow } = sun;
    const height = Math.max(data.sunDirection[1], 0.01);
    sun.target.position.copy(sphere.center);
    sun.position.copy(vector(data.sunDirection)).multiplyScalar(2 * sphere.radius).add(sphere.center);
    Object.assign(shadow.camera, { left: -1, right: 1, top: 1, bottom: -1 });
    for (const side of ["left", "right", "top", "bottom"]) shadow.camera[side] *= sphere.radius;
    shadow.camera.near = sphere.radius / 2;
    shadow.camera.far = 2 * sphere.radius + (2 * sphere.radius) / height;
    shadow.camera.updateProjectionMatrix();
    shadow.normalBias = (4 * sphere.radius) / shadow.mapSize.width;
  }

  function draw() {
    const scale = Math.min(innerWidth / data.width, innerHeight / data.height);
    renderer.setPixelRatio(devicePixelRatio);
    renderer.setSize(Math.round(data.width * scale), Math.round(data.height * scale));
    renderer.getDrawingBufferSize(resolution);
    render();
  }

  function render() {
    camera.updateMatrixWorld();
    shine();
    aim();
    renderer.render(scene, camera);
  }

  function moveTo(event) {
    const frame = renderer.domElement.getBoundingClientRect();
    const x = ((event.clientX - frame.left) / frame.width) * 2 - 1;
    const y = 1 - ((event.clientY - frame.top) / frame.height) * 2;
    const ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2(x, y), camera);
    const [hit] = ray.intersectObject(ground);
    if (hit) object.position.copy(hit.point);
    render();
  }

  async function openFile(event) {
    event.preventDefault();
    const [file] = event.dataTransfer.files;
    if (!file) return;
    try {
      const { scene: dropped } = await new THREE.GLTFLoader().parseAsync(await file.arrayBuffer(), "");
      dropped.getObjectsByProperty("isLight", true).forEach((light) => light.removeFromParent());
      show(dropped);
    } catch {
      document.getElementById("note").textContent = `${file.name} is not a .glb file that can be shown.`;
    }
  }

  addEventListener("resize", draw);
  addEventListener("dragover", (event) => event.preventDefault());
  addEventListener("drop", openFile);
  renderer.domElement.addEventListener("click", moveTo);
  renderer.domElement.addEventListener("pointermove", (event) => event.buttons && moveTo(event));
  document.getElementById("note").hidden = location.hash === "#plain";
  show(data.object === "teapot" ? teapot() : placeholder());
  window.lightingScene = { scene, camera, renderer, sun, ground, object, show, draw };
})();
