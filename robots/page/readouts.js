// -- what is told --------------------------------------------------------------------------------

const DIGITS = 5, ROUNDING = 1e-12, BEYOND = 1e-9;
const text = (x, unit = "") => `${(Math.abs(x) < 0.5e-9 ? 0 : x).toFixed(DIGITS)} ${unit}`.trim();
const sigmaText = (x) => x < ROUNDING ? "0 within rounding" : x.toPrecision(4);

function showReadouts({inverse}) {
  const found = data.measured ? robot.classify(q) : null;
  cell("residual", robot.residual(q).toExponential(1));
  if (inverse.length) {
    cell("tip-place", inverse.slice(0, 3).map((x) => text(x)).join("  "));
    cell("tip-turn", inverse.slice(3).map((x) => text(x)).join("  "));
  }
  robot.coordinates.forEach(({unit}, i) => cell(`q-${i}`, text(q[i], unit)));
  showKinds(found);
  showEfforts();
  showLimits();
  const stopped = last !== null && !last.converged;
  element("stop").hidden = !stopped;
  element("across").hidden = !(stopped && data.measured);
  if (stopped) cell("stop", whyStopped(found));
}

function showLimits() {
  const {lower, upper} = robot.limits, beyond = [], at = [];
  robot.coordinates.forEach(({name, unit}, i) => {
    const under = lower[i] === null ? -Infinity : lower[i] - q[i];
    const over = Math.max(under, upper[i] === null ? -Infinity : q[i] - upper[i]);
    if (over > BEYOND) beyond.push(`${name} by ${text(over, unit)}`);
    else if (over > -BEYOND) at.push(name);
  });
  const sentences = [];
  if (at.length) sentences.push(`at a joint's limit: ${at.join(", ")}`);
  if (beyond.length) sentences.push(`beyond a joint's limit: ${beyond.join(", ")}`);
  element("limits").hidden = !sentences.length;
  cell("limits", sentences.join("; "));
}

// Kinds and types as `classify` decides them, sigmas with bars on a logarithmic scale.
const DECADES = 6;
function showKinds(found) {
  if (!data.measured) return;
  for (const kind of ["direct", "inverse"]) {
    const value = found?.sigma[kind];
    cell(`sigma-${kind}`, value === undefined ? "not told here" : sigmaText(value));
    const share = value === undefined ? 0 : 1 + Math.log10(value) / DECADES;
    element(`bar-${kind}`).style.width = `${100 * Math.min(Math.max(share, 0), 1)}%`;
  }
  cell("kinds", found === null ? "not told here" : kindsTitle(found.kinds));
  const types = element("types");
  types.replaceChildren(...(found?.types ?? []).map((type) => {
    const word = document.createElement("abbr");
    word.textContent = type;
    word.title = data.types[type];
    return word;
  }));
  if (!types.children.length) types.textContent = "none";
  cell("distance", found === null ? "" : distanceText(found));
}

function kindsTitle(kinds) {
  if (!kinds.length) return "regular";
  const combined = kinds.includes("direct") && kinds.includes("inverse");
  const first = combined ? [data.titles.combined]
    : kinds.filter((kind) => kind !== "constraint").map((kind) => data.titles[kind]);
  if (!kinds.includes("constraint")) return first[0];
  return first.length ? `${first[0]}, and constraint` : data.titles.constraint;
}

function distanceText({kinds, distance, accuracy}) {
  if (kinds.length) return `here, within ${accuracy.toExponential(0)}`;
  return Number.isFinite(distance) ? distance.toExponential(1) : "not near";
}

// Efforts for the load that is typed in and the weights of the bodies, down the page.
function showEfforts() {
  if (!data.measured) return;
  const load = data.load.map((_, i) => element(`load-${i}`).valueAsNumber || 0);
  const found = robot.efforts(q, load, element("weights").checked ? data.fall : [0, 0, 0]);
  robot.inputs.forEach((_, i) => cell(`effort-${i}`, found === null ? "not held" : text(found[i])));
}

function whyStopped(found) {
  const direct = last.way === "direct", kinds = found?.kinds ?? [];
  if (!direct && kinds.includes("inverse"))
    return "Stopped: an inverse singularity. From here the tip can be led along several branches; "
      + "move an input first.";
  const share = (100 * last.reached).toFixed(1), what = direct ? "the inputs" : "the tip";
  const sigma = found?.sigma[direct ? "direct" : "inverse"];
  const kind = direct ? "A direct" : "An inverse";
  const near = sigma < data.near
    ? `${kind} singularity is met: sigma is ${sigmaText(sigma)}`
    : last.sentence;
  return `Stopped after ${share} % of the way of ${what}. ${near}.`;
}
