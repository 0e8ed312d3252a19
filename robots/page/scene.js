// The scene: what Meshcat draws, how moving bodies move that, and texts that hang in it.
"use strict";
var viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));

{
  // commands one after the other, each behind its length
  const view = new DataView(globalThis.commands);
  for (let at = 0; at < view.byteLength; ) {
    const size = view.getUint32(at, true);
    viewer.handle_command_bytearray(new Uint8Array(globalThis.commands, at + 4, size));
    at += 4 + size;
  }
  delete globalThis.commands;
}

const sceneNode = (path) => viewer.scene_tree.find(path.split("/").filter((x) => x)).object;

// What was framed for a picture of 6:5 fits into a narrower one as well.
const FRAMED = 1.2;
{
  const resized = viewer.set_3d_pane_size.bind(viewer);
  viewer.set_3d_pane_size = () => {
    const {camera, dom_element: pane} = viewer;
    resized(pane.clientWidth, pane.clientHeight);
    camera.zoom = Math.min(1, camera.aspect / FRAMED);
    camera.updateProjectionMatrix();
    viewer.set_dirty();
  };
  viewer.set_3d_pane_size();
}

// Functions to be called after each drawing.
const afterDrawing = [];
{
  const drawn = viewer.render.bind(viewer);
  viewer.render = () => {
    drawn();
    for (const one of afterDrawing) one();
  };
}

// Pixels of the pane, and a depth between -1 and 1 for what is in view, of a point of the scene.
function onPane(point) {
  const seen = point.clone().project(viewer.camera);
  const {clientWidth, clientHeight} = viewer.renderer.domElement;
  return [0.5 * (1 + seen.x) * clientWidth, 0.5 * (1 - seen.y) * clientHeight, seen.z];
}

// A function that puts what is drawn where the matrices of its bodies say.
function movable({parts, sticks}) {
  const {Matrix4, Vector3} = MeshCat.THREE, up = new Vector3(0, 1, 0);
  for (const part of parts) {
    part.node = sceneNode(part.path);
    part.matrix = new Matrix4().fromArray(part.matrix);
  }
  for (const stick of sticks) {
    stick.node = sceneNode(stick.path);
    for (const end of stick.ends) end.at = new Vector3(...end.at);
  }
  return (bodies) => {
    for (const {node, body, matrix} of parts)
      bodies[body].clone().multiply(matrix).decompose(node.position, node.quaternion, node.scale);
    for (const {node, ends, length} of sticks) {
      const [begin, end] = ends.map(({at, body}) => at.clone().applyMatrix4(bodies[body]));
      const along = end.clone().sub(begin), reach = along.length();
      node.position.copy(begin).lerp(end, 0.5);
      if (reach > 0) node.quaternion.setFromUnitVectors(up, along.divideScalar(reach));
      node.scale.set(1, Math.max(reach / length, 1e-6), 1);
    }
    viewer.set_dirty();
  };
}

// Texts that stay upright and sharp when the scene is turned: HTML, moved after each drawing. Each
// has a `text`, a `name` for its style, and a function `place` to where in the scene it hangs.
const LINE = 13; // pixels
function hangTexts(parent, texts, seen = () => true) {
  const spans = texts.map(({text, name}) => {
    const span = parent.appendChild(document.createElement("span"));
    span.textContent = text;
    if (name) span.className = name;
    return span;
  });
  afterDrawing.push(() => {
    parent.hidden = !seen();
    if (parent.hidden) return;
    const taken = [];
    texts.forEach(({place, apart}, i) => {
      const [left, height, depth] = onPane(place());
      const near = ([x, y]) => Math.abs(x - left) < 60 && Math.abs(y - top) < LINE;
      let top = height;
      spans[i].hidden = !(Math.abs(depth) < 1);
      if (apart) {
        for (let tries = 0; tries < 20 && taken.some(near); ++tries) top += LINE;
        taken.push([left, top]);
      }
      spans[i].style.left = `${left}px`;
      spans[i].style.top = `${top}px`;
    });
  });
  viewer.set_dirty();
}
