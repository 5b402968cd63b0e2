// Hands a scene document (viewer/scene.py) on to meshcat's viewer, and takes pictures of it.
"use strict";
const posekit = (() => {
  const geometries = {};

  function typed(entry) {
    const text = atob(entry.base64), bytes = new Uint8Array(text.length);
    for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
    return new globalThis[entry.type](bytes.buffer);
  }

  function decoded(value) {
    if (Array.isArray(value)) return value;
    if (value === null || typeof value !== "object") return value;
    if (value.base64 !== undefined) return typed(value);
    return Object.fromEntries(Object.entries(value).map(([key, entry]) => [key, decoded(entry)]));
  }

  // Draws a document on top of what is drawn.
  function apply(document) {
    viewer.renderer.shadowMap.enabled = false; // they cost more than all the rest
    for (const [key, geometry] of Object.entries(document.geometries)) {
      geometries[key] = decoded(geometry);
      geometries[key].uuid = key;
    }
    for (const command of document.commands) {
      if (command.type !== "set_object") {
        viewer.handle_command(command);
        continue;
      }
      const object = { ...command.object, uuid: "object" };
      const lowered = { metadata: { version: 4.5, type: "Object" }, geometries: [], materials: [], object };
      if (object.geometry !== undefined) lowered.geometries.push(geometries[object.geometry]);
      if (object.material !== undefined) {
        lowered.materials.push({ ...object.material, uuid: "material" });
        object.material = "material";
      }
      viewer.handle_command({ type: "set_object", path: command.path, object: lowered });
    }
    viewer.set_dirty();
  }

  // Shows or hides a node: posekit.show("/meshcat/survivor-3", false).
  function show(path, visible) {
    viewer.handle_command({ type: "set_property", path: path, property: "visible", value: visible });
  }

  // Looks from `position` to `target` (x, y, z of the world, z up), with a vertical field of view in degrees.
  function look(eye) {
    const [px, py, pz] = eye.position, [tx, ty, tz] = eye.target;
    viewer.camera.fov = eye.fov;
    viewer.camera.position.set(px, pz, -py);
    viewer.controls.target.set(tx, tz, -ty);
    viewer.controls.update();
    viewer.set_dirty();
  }

  // A gradient of one colour, which is drawn as a texture, as the colour that the picture is cleared with: twice
  // as quick.
  function plain(background) {
    if (background === null || !background.isTexture) return background;
    const data = background.image.data;
    for (let k = 0; k < 3; k++) if (data[k] !== data[k + 3]) return background;
    return new MeshCat.THREE.Color(data[0] / 255, data[1] / 255, data[2] / 255);
  }

  // Draws one picture of width x height pixels: a data URL of a PNG. `world` is the camera's pose in the z-up
  // world and `projection` its clip matrix, both 16 numbers, column by column.
  function picture(shot) {
    const camera = new MeshCat.THREE.PerspectiveCamera();
    camera.matrixAutoUpdate = false;
    camera.matrix.makeRotationX(-Math.PI / 2).multiply(new MeshCat.THREE.Matrix4().fromArray(shot.world));
    camera.updateMatrixWorld(true);
    camera.projectionMatrix.fromArray(shot.projection);
    camera.projectionMatrixInverse.copy(camera.projectionMatrix).invert();
    const renderer = viewer.renderer, w = shot.width * shot.supersample, h = shot.height * shot.supersample;
    if (renderer.domElement.width !== w || renderer.domElement.height !== h) {
      renderer.setPixelRatio(1);
      renderer.setSize(w, h, false);
    }
    const background = viewer.scene.background;
    viewer.scene.background = plain(background);
    renderer.render(viewer.scene, camera);
    viewer.scene.background = background;
    if (renderer.getContext().isContextLost()) throw new Error("the WebGL context is lost");
    const canvas = document.createElement("canvas");
    canvas.width = shot.width;
    canvas.height = shot.height;
    const flat = canvas.getContext("2d");
    flat.imageSmoothingQuality = "high";
    flat.drawImage(renderer.domElement, 0, 0, shot.width, shot.height);
    return canvas.toDataURL("image/png");
  }

  return { apply, show, look, picture };
})();
