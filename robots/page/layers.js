// -- layers on demand: names, axes, ground, ellipsoids --------------------------------------------

const layer = (name) => element(`layer-${name}`);
const shownLayer = (name) => Boolean(layer(name)?.checked);

// Names stand where the joints are.
let posesNow = robot.bodies(q);
hangTexts(element("signs"), data.names.map(({text: name, body, at, driven}) => ({
  text: name,
  name: driven ? "driven" : "",
  apart: true,
  place: () => new Vector3(...at)
    .applyMatrix4(bodyMatrix(posesNow, body, new Matrix4()))
    .applyMatrix4(root.matrixWorld),
})), () => shownLayer("names"));

// Directions (orthonormal rows) and lengths of the ellipsoid of rows x of unit vectors, x = m u.
function ellipsoidOf(rows) {
  const turned = rows.map((row) => Float64Array.from(row)), size = rows.length;
  const sides = rows.map((_, i) => Float64Array.from({length: size}, (_, k) => Number(k === i)));
  const radii = robot.singularValues(turned, sides);
  return {radii, axes: sides};
}

// An ellipsoid at the tip; lengths in units of which `unit` metres are drawn, at most `most` of it.
function showEllipsoid(name, told) {
  const {path, size} = data.layers[name], node = sceneNode(path);
  node.visible = shownLayer(name) && told !== null;
  const radius = (x) => (Number.isFinite(x) ? x.toPrecision(3) : "no bound");
  const numbers = told === null ? "not told here" : told.radii.map(radius).join("  ");
  cell(`axes-${name}`, shownLayer(name) ? numbers : "");
  if (!node.visible) return;
  const unit = size / told.usual, reach = told.radii.map((x) =>
    Math.min(Math.max(x * unit, 0.01 * size), 3 * size));
  const [a, b, c] = told.axes, [x, y, z] = robot.tip(q);
  const hand = Math.sign(new Vector3(...a).cross(new Vector3(...b)).dot(new Vector3(...c))) || 1;
  const [r, s, t] = [reach[0], reach[1], hand * reach[2]];
  new Matrix4().set(
    r * a[0], s * b[0], t * c[0], x,
    r * a[1], s * b[1], t * c[1], y,
    r * a[2], s * b[2], t * c[2], z,
    0, 0, 0, 1,
  ).decompose(node.position, node.quaternion, node.scale);
}

// Speeds of the tip for input rates of norm 1, and forces that efforts of norm 1 hold; of a tip
// whose outputs are rotations, angular ones and moments.
const LOST = 1e-9;
const half = (map) => map.slice(data.reach.first, data.reach.first + 3);
const velocityEllipsoid = (map) => (map === null ? null : ellipsoidOf(half(map)));

function forceEllipsoid(found) {
  if (found === null) return null;
  const {radii, axes} = found;
  const order = [2, 1, 0];
  return {
    radii: order.map((i) => (radii[i] > LOST * radii[0] ? 1 / radii[i] : Infinity)),
    axes: order.map((i) => axes[i]),
  };
}

const usual = {};
function showLayers() {
  posesNow = robot.bodies(q);
  for (const name of ["ground", "axes"])
    if (layer(name)) sceneNode(data.layers[name].path).visible = shownLayer(name);
  if (data.measured) {
    const map = robot.tipMap(q);
    const velocity = velocityEllipsoid(map), force = forceEllipsoid(velocity);
    usual.velocity ??= velocity?.radii[0];
    usual.force ??= force?.radii.filter(Number.isFinite)[0];
    showEllipsoid("velocity", velocity && {...velocity, usual: usual.velocity ?? 1});
    showEllipsoid("force", force && {...force, usual: usual.force ?? 1});
    showQuality(map, velocity);
  }
  viewer.set_dirty();
}

// How evenly the inputs move the tip in its outputs, and the largest effort for a load of 1.
function showQuality(map, velocity) {
  const [most] = velocity?.radii ?? [], least = velocity?.radii[data.reach.count - 1];
  if (data.reach.count > 1)
    cell("evenness", velocity === null ? "not told here" : (most > 0 ? least / most : 0).toFixed(3));
  const rows = map === null ? [] : half(map);
  const columns = rows.length ? rows[0].map((_, i) => Math.hypot(...rows.map((row) => row[i]))) : [];
  cell("effort-per-force", columns.length ? Math.max(...columns).toPrecision(3) : "no bound");
}

for (const name of ["names", "axes", "ground", "velocity", "force"])
  layer(name)?.addEventListener("change", showLayers);
