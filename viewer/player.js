// Sends recorded commands to meshcat's viewer and renders pictures.
"use strict";
const posekit = (() => {
  function apply(commands) {
    viewer.renderer.shadowMap.enabled = false; // shadows take most of the rendering time
    const parts = path => path.split("/").filter(Boolean);
    for (const text of commands) {
      if (Array.isArray(text)) { // a copy of an existing object
        const [from, to] = text.map(parts);
        viewer.set_object(to, viewer.scene_tree.find(from.concat(["<object>"])).object.clone());
        continue;
      }
      const bytes = Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
      viewer.handle_command_bytearray(bytes);
    }
  }

  // Return one picture as the data URL of a PNG. `world` is the camera's pose in the z-up world and `projection` its
  // projection matrix; both have 16 numbers in column-major order.
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
    viewer.scene.background = new MeshCat.THREE.Color(1, 1, 1); // a uniform background renders faster than meshcat's gradient
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

  return { apply, picture };
})();
