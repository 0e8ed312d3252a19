// The instrument: sliders and numbers move the robot, its loops stay closed. `robot` is the module
// of code that the robot has been exported as.

const {Matrix4, Vector3} = MeshCat.THREE;
const data = JSON.parse(document.getElementById("instrument").textContent);
const element = (id) => document.getElementById(id);
const cell = (id, value) => { element(id).textContent = value; };

let q = Float64Array.from(data.start); // the posture
let last = null; // the answer of the solver that led here; null where none did
let wanted = null; // what is still to be done for the hand

// -- the scene ----------------------------------------------------------------------------------

const root = viewer.scene_tree.find(data.root).object;
const carried = data.bodies.map(() => new Matrix4());
const placeBodies = movable(data);

// Matrix of a body from the poses of all; the base, body 0, stands still.
function bodyMatrix(poses, body, matrix) {
  if (body === 0) return matrix.identity();
  const [a, b, c, d, e, f, g, h, k, x, y, z] = poses.subarray(12 * (body - 1), 12 * body);
  return matrix.set(a, d, g, x, b, e, h, y, c, f, k, z, 0, 0, 0, 1);
}

function draw() {
  const poses = robot.bodies(q);
  data.bodies.forEach((body, i) => bodyMatrix(poses, body, carried[i]));
  placeBodies(carried);
}

// -- moving --------------------------------------------------------------------------------------

function moveTo(answer, way) {
  last = {...answer, way};
  q = last.q;
  show();
  return last;
}

const toInputs = (values) => moveTo(robot.direct(values, q), "direct");
const toPose = (pose) => moveTo(robot.inverse(pose, q), "inverse");

function toPosture(posture) {
  last = null;
  q = Float64Array.from(posture);
  show();
}

function toOtherSide() {
  const found = robot.across(q, last.way);
  if (found === null) {
    cell("stop", "No posture on the other side was found nearby.");
    return null;
  }
  return moveTo(found, last.way);
}

// A mode at the inputs of now, by its own branch; where that ends, as it was found.
function toMode({name, posture}) {
  const there = data.moves.direct ? robot.direct(robot.inputsOf(q), posture) : null;
  if (there === null || there.converged) {
    toPosture(there === null ? posture : there.q);
    return;
  }
  toPosture(posture);
  tell(`The branch of ${name} ends before the inputs of before (${there.sentence}): it is shown `
    + "where it was found.");
}

// The way to a posture of a set along the branch; a posture that no such way leads to is shown all
// the same, and that is said.
const NEARLY = 0.99, CLOSE = 0.1;
function towards(posture) {
  const goal = Float64Array.from(posture);
  const way = data.moves.direct ? robot.direct(robot.inputsOf(goal), q) : null;
  const apart = way === null ? 0 : way.q.reduce((m, x, i) => Math.max(m, Math.abs(x - goal[i])), 0);
  const led = way === null || (way.reached > NEARLY && apart < CLOSE);
  toPosture(goal);
  tell(led ? "" : "No way along the branch led here from the posture of before: it is shown, not "
    + `reached. The way stopped after ${(100 * way.reached).toFixed(1)} % (${way.sentence}).`);
}

function tell(sentence) {
  element("told").hidden = sentence === "";
  cell("told", sentence);
}

const moves = {
  direct: (at, value) => {
    const values = robot.inputsOf(q);
    values[at] = value;
    toInputs(values);
  },
  inverse: (at, value) => {
    const goal = coordinatesOf(robot.tip(q));
    goal[at] = value;
    toPose(poseOf(goal));
  },
};

const knobs = data.knobs.map((knob, i) => {
  const slider = element(`slider-${i}`), number = element(`number-${i}`);
  const ask = (value) => {
    if (Number.isFinite(value)) request(() => moves[knob.way](knob.at, value));
    else show();
  };
  slider.addEventListener("input", () => ask(slider.valueAsNumber));
  number.addEventListener("change", () => ask(number.valueAsNumber));
  return {...knob, slider, number};
});

// The latest wish counts; a picture is drawn for it before the next one is heard. A page that is
// not painted gets no frames, and answers all the same.
const LATEST = 100; // ms
function request(wish) {
  if (wanted === null) {
    let late = 0;
    const answer = () => {
      clearTimeout(late);
      const granted = wanted;
      wanted = null;
      granted?.();
    };
    requestAnimationFrame(answer);
    late = setTimeout(answer, LATEST);
  }
  wanted = wish;
}

// What the sliders show: the inputs, and the tip's coordinates.
function current() {
  return {
    direct: data.moves.direct ? robot.inputsOf(q) : [],
    inverse: data.moves.inverse ? coordinatesOf(robot.tip(q)) : [],
  };
}

function show() {
  draw();
  const now = current();
  for (const {way, at, slider, number} of knobs) {
    slider.value = now[way][at];
    number.value = +now[way][at].toFixed(6);
  }
  tell("");
  showReadouts(now);
  markPlanes(now);
  showLayers();
}
