// Texts at places of the scene that stand still.
{
  const {root, texts} = JSON.parse(document.getElementById("texts").textContent);
  const {object} = viewer.scene_tree.find(root);
  hangTexts(document.getElementById("labels"), texts.map(([name, text, at]) => ({
    text,
    name: name ? "name" : "",
    place: () => new MeshCat.THREE.Vector3(...at).applyMatrix4(object.matrixWorld),
  })));
}
