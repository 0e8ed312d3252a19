// The page's instrument: sliders and numbers move the robot, its loops stay closed. What is above
// in this script is the robot's own module.
{
const {Matrix4, Vector3} = MeshCat.THREE;
const data = JSON.parse(document.getElementById("instrument").textContent);
const element = (id) => document.getElementById(id);
const DIGITS = 5;

// -- the scene ----------------------------------------------------------------------------------

const node = (path) => viewer.scene_tree.find(path.split("/").filter((x) => x)).object;
for (const part of data.parts) {
  part.node = node(part.path);
  part.matrix = new Matrix4().fromArray(part.matrix);
}
for (const stick of data.sticks) {
  stick.node = node(stick.path);
  for (const end of stick.ends) end.at = new Vector3(...end.at);
}
const places = data.bodies.map(() => new Matrix4());
const up = new Vector3(0, 1, 0);

function draw(q) {
  const poses = bodies(q);
  data.bodies.forEach((joint, i) => {
    if (joint === 0) return; // the base stands still
    const [a, b, c, d, e, f, g, h, k, x, y, z] = poses.subarray(12 * (joint - 1), 12 * joint);
    places[i].set(a, d, g, x, b, e, h, y, c, f, k, z, 0, 0, 0, 1);
  });
  for (const part of data.parts) {
    const matrix = places[part.body].clone().multiply(part.matrix);
    matrix.decompose(part.node.position, part.node.quaternion, part.node.scale);
  }
  for (const stick of data.sticks) {
    const [begin, end] = stick.ends.map((e) => e.at.clone().applyMatrix4(places[e.body]));
    const along = end.clone().sub(begin), length = along.length();
    stick.node.position.copy(begin).lerp(end, 0.5);
    if (length > 0) stick.node.quaternion.setFromUnitVectors(up, along.divideScalar(length));
    stick.node.scale.set(1, Math.max(length / stick.length, 1e-6), 1);
  }
  viewer.set_dirty();
}

// -- poses as x y z and roll, pitch, yaw: R = Rz(yaw) Ry(pitch) Rx(roll) -------------------------

function toAngles([x, y, z, w]) {
  const sine = Math.min(Math.max(2 * (w * y - z * x), -1), 1);
  return [
    Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
    Math.asin(sine),
    Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
  ];
}

function toQuaternion(angles) {
  const [a, b, c] = angles.map((x) => Math.cos(x / 2));
  const [r, p, y] = angles.map((x) => Math.sin(x / 2));
  const [x, z] = [r * b * c - a * p * y, a * b * y - r * p * c];
  return [x, a * p * c + r * b * y, z, a * b * c + r * p * y];
}

const coordinatesOf = (pose) => [...pose.slice(0, 3), ...toAngles(Array.from(pose).slice(3))];

// -- moving --------------------------------------------------------------------------------------

const root = viewer.scene_tree.find(data.root).object;
let q = Float64Array.from(data.start), last = null, wanted = null;

const knobs = data.knobs.map((knob, i) => {
  const slider = element(`slider-${i}`), number = element(`number-${i}`);
  const ask = (value) => {
    if (Number.isFinite(value)) request(knob, value);
    else show();
  };
  slider.addEventListener("input", () => ask(slider.valueAsNumber));
  number.addEventListener("change", () => ask(number.valueAsNumber));
  return {...knob, slider, number};
});

// The latest wish counts; a picture is drawn for it before the next one is heard. A page that is
// not painted gets no frames, and answers all the same.
const LATEST = 100; // ms
function request(knob, value) {
  if (wanted === null) {
    let late = 0;
    const answer = () => {
      clearTimeout(late);
      const wish = wanted;
      wanted = null;
      wish?.();
    };
    requestAnimationFrame(answer);
    late = setTimeout(answer, LATEST);
  }
  wanted = () => {
    if (knob.way === "direct") {
      const values = inputsOf(q);
      values[knob.at] = value;
      toInputs(values);
    } else {
      const at = coordinatesOf(tip(q));
      at[knob.at] = value;
      toPose([...at.slice(0, 3), ...toQuaternion(at.slice(3))]);
    }
  };
}

function toInputs(values) {
  last = {...direct(values, q), way: "direct"};
  q = last.q;
  show();
  return last;
}

function toPose(pose) {
  last = {...inverse(pose, q), way: "inverse"};
  q = last.q;
  show();
  return last;
}

function toOtherSide() {
  const found = across(q, last.way);
  if (found === null) {
    cell("stop", "No posture on the other side was found nearby.");
    return null;
  }
  last = {...found, way: last.way};
  q = last.q;
  show();
  return last;
}

function toPosture(posture) {
  last = null;
  q = Float64Array.from(posture);
  show();
}

// -- small maps ----------------------------------------------------------------------------------

const first = current();
const SIDE = 200;

function coordinatesFor(axes, now) {
  return axes[0].way === "direct" ? now.values : now.at;
}

function markPlanes(now) {
  data.planes.forEach(({axes, ranges}, i) => {
    const here = coordinatesFor(axes, now), before = coordinatesFor(axes, first);
    const shares = axes.map(({at}, k) => {
      const [low, high] = ranges[k];
      return (here[at] - low) / (high - low);
    });
    const mark = element(`mark-${i}`);
    mark.setAttribute("cx", SIDE * shares[0]);
    mark.setAttribute("cy", SIDE * (1 - shares[1]));
    const held = data.knobs.filter(({way, at}) =>
      way === axes[0].way && !axes.some((axis) => axis.at === at));
    const other = held.some(({at}) => Math.abs(here[at] - before[at]) > 1e-6);
    element(`other-${i}`).hidden = !other;
    mark.setAttribute("class", other ? "elsewhere" : "");
  });
}

// -- what is told --------------------------------------------------------------------------------

const text = (x, unit = "") => `${(Math.abs(x) < 0.5e-9 ? 0 : x).toFixed(DIGITS)} ${unit}`.trim();
const cell = (id, value) => { element(id).textContent = value; };

function current() {
  const values = data.knobs.some((k) => k.way === "direct") ? inputsOf(q) : [];
  const at = data.knobs.some((k) => k.way === "inverse") ? coordinatesOf(tip(q)) : [];
  return {values, at};
}

function show() {
  draw(q);
  const {values, at} = current();
  for (const knob of knobs) {
    const value = knob.way === "direct" ? values[knob.at] : at[knob.at];
    knob.slider.value = value;
    knob.number.value = +value.toFixed(6);
  }
  cell("residual", residual(q).toExponential(1));
  if (at.length) {
    cell("tip-place", at.slice(0, 3).map((x) => text(x)).join("  "));
    cell("tip-turn", at.slice(3).map((x) => text(x)).join("  "));
  }
  coordinates.forEach(({unit}, i) => cell(`q-${i}`, text(q[i], unit)));
  showEfforts();
  markPlanes({values, at});
  const beyond = overLimits();
  element("limits").hidden = !beyond.length;
  cell("limits", "beyond a joint's limit: " + beyond.join(", "));
  const kinds = showSigmas();
  const stopped = last !== null && !last.converged;
  element("stop").hidden = element("across").hidden = !stopped;
  element("across").hidden ||= !data.measured;
  if (stopped) cell("stop", whyStopped(kinds));
}

function overLimits() {
  const found = [];
  coordinates.forEach((one, i) => {
    const {lower, upper} = limits, low = lower[i], high = upper[i];
    const over = Math.max(low === null ? 0 : low - q[i], high === null ? 0 : q[i] - high);
    if (over > 1e-9) found.push(`${one.name} by ${text(over, one.unit)}`);
  });
  return found;
}

// Sigmas with bars on a logarithmic scale from 1e-6 to 1, and the kinds that they tell.
function showSigmas() {
  if (!data.measured) return [];
  const found = measure(q), kinds = [];
  for (const [kind, value] of [["direct", found?.sigmaDirect], ["inverse", found?.sigmaInverse]]) {
    const known = value !== undefined;
    cell(`sigma-${kind}`, known ? value.toExponential(3) : "-");
    const share = known ? Math.min(Math.max(1 + Math.log10(value) / 6, 0), 1) : 0;
    element(`bar-${kind}`).style.width = `${100 * share}%`;
    if (known && value < data.singular) kinds.push(kind);
  }
  const named = kinds.length ? kinds.join(" and ") + " singularity" : "regular";
  cell("kinds", found === null ? "not told here" : named);
  return kinds;
}

// Efforts for the force that is typed in and the weights of the bodies, down the page.
function showEfforts() {
  if (!data.measured) return;
  const force = [0, 1, 2].map((i) => element(`force-${i}`).valueAsNumber || 0);
  const found = efforts(q, [...force, 0, 0, 0], data.fall);
  inputs.forEach((_, i) => cell(`effort-${i}`, found === null ? "not held" : text(found[i])));
}

function whyStopped(kinds) {
  const direct = last.way === "direct";
  if (!direct && kinds.includes("inverse"))
    return "Stopped: an inverse singularity. From here the tip can be led along several branches; "
      + "move an input first.";
  const share = (100 * last.reached).toFixed(1), what = direct ? "the inputs" : "the tip";
  const found = data.measured ? measure(q) : null;
  const sigma = direct ? found?.sigmaDirect : found?.sigmaInverse;
  const kind = direct ? "A direct" : "An inverse";
  const near = sigma < data.near
    ? `${kind} singularity is met: sigma is ${sigma.toExponential(1)}`
    : last.sentence;
  return `Stopped after ${share} % of the way of ${what}. ${near}.`;
}

// -- buttons -------------------------------------------------------------------------------------

element("across").addEventListener("click", toOtherSide);
element("picture").addEventListener("click", () => viewer.save_image());
const chooser = element("postures");
chooser.addEventListener("change", () => {
  const chosen = data.postures[chooser.selectedIndex - 1];
  if (chosen) toPosture(chosen);
  chooser.selectedIndex = 0;
});
element("copy").addEventListener("click", () => {
  const place = element("copied");
  place.value = "[" + Array.from(q).join(", ") + "]";
  place.hidden = false;
  place.select();
});

if (data.measured)
  for (let i = 0; i < 3; ++i) element(`force-${i}`).addEventListener("input", showEfforts);

// Through a series by its slider, or by a click at one of its points in the scene.
data.series.forEach(({q: postures}, i) => {
  const slider = element(`series-${i}`);
  slider.addEventListener("input", () => toPosture(postures[slider.valueAsNumber]));
});
const CLICK = 12; // pixels
let pressed = null;
const canvas = viewer.renderer.domElement;
canvas.addEventListener("pointerdown", (event) => { pressed = [event.clientX, event.clientY]; });
canvas.addEventListener("pointerup", (event) => {
  if (pressed === null) return;
  const [x, y] = [event.clientX, event.clientY], [a, b] = pressed;
  pressed = null;
  if (Math.hypot(x - a, y - b) < 4) goTo(x, y);
});

function goTo(x, y) {
  let least = CLICK, found = null;
  data.series.forEach(({points}, i) => points.forEach((point, k) => {
    const [left, top, depth] = onScreen(new Vector3(...point)), far = Math.hypot(left - x, top - y);
    if (Math.abs(depth) < 1 && far < least) [least, found] = [far, [i, k]];
  }));
  if (found === null) return;
  const [i, k] = found;
  element(`series-${i}`).value = k;
  toPosture(data.series[i].q[k]);
}

function onScreen(place) {
  const seen = place.applyMatrix4(root.matrixWorld).project(viewer.camera);
  const {clientWidth, clientHeight} = canvas;
  return [0.5 * (1 + seen.x) * clientWidth, 0.5 * (1 - seen.y) * clientHeight, seen.z];
}

// Small maps: the mark is where the robot is, a click leads there.
data.planes.forEach(({axes, ranges}, i) => {
  element(`plane-${i}`).addEventListener("click", (event) => {
    const {left, top, width, height} = element(`plane-${i}`).getBoundingClientRect();
    const shares = [(event.clientX - left) / width, 1 - (event.clientY - top) / height];
    const goal = Array.from(coordinatesFor(axes, current()));
    axes.forEach(({at}, k) => {
      const [low, high] = ranges[k];
      goal[at] = low + shares[k] * (high - low);
    });
    if (axes[0].way === "direct") toInputs(goal);
    else toPose([...goal.slice(0, 3), ...toQuaternion(goal.slice(3))]);
  });
});

// Names stand where the joints are: HTML, moved after each drawing.
const naming = element("names");
const signs = data.names.map(({text: name, body, at, driven}) => {
  const sign = element("signs").appendChild(document.createElement("span"));
  sign.textContent = name;
  if (driven) sign.className = "driven";
  return {sign, body, at: new Vector3(...at)};
});
const drawBefore = viewer.render.bind(viewer);
viewer.render = () => {
  drawBefore();
  element("signs").hidden = !naming.checked;
  if (!naming.checked) return;
  const poses = bodies(q), taken = [];
  for (const {sign, body, at} of signs) {
    const seen = at.clone();
    if (body > 0) {
      const [a, b, c, d, e, f, g, h, k, x, y, z] = poses.subarray(12 * (body - 1), 12 * body);
      seen.applyMatrix4(new Matrix4().set(a, d, g, x, b, e, h, y, c, f, k, z, 0, 0, 0, 1));
    }
    const [left, height, depth] = onScreen(seen);
    let top = height;
    sign.hidden = !(Math.abs(depth) < 1);
    const near = ([x, y]) => Math.abs(x - left) < 60 && Math.abs(y - top) < 13;
    for (let tries = 0; tries < 20 && taken.some(near); ++tries) top += 13; // below one another
    taken.push([left, top]);
    sign.style.left = left + "px";
    sign.style.top = top + "px";
  }
};
naming.addEventListener("change", () => viewer.set_dirty());

// For a console, or another script of the page: what the sliders do.
globalThis.instrument = {
  posture: () => Array.from(q), measure: () => measure(q),
  toInputs, toPose, toPosture, toOtherSide, goTo,
  onScreen: (point) => onScreen(new Vector3(...point)), inputs, coordinates,
};
show();
}
