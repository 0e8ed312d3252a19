// -- a map around here: the branch followed over two coordinates, the others held ----------------

const CELLS = 31, SHARE = 0.25, BUSY = 12; // cells a side, of a slider's range each way, ms
const LOCAL = data.planes.length; // its number among the planes
let mapping = 0; // counts the maps that were begun: an older one stops

const svg = (name, attributes) => {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
};

// Where the map reaches: around here, within the sliders.
function aroundHere(pair) {
  const now = current();
  const axes = pair.map((i) => ({way: data.knobs[i].way, at: data.knobs[i].at}));
  const ranges = pair.map((i) => {
    const [low, high] = [Number(knobs[i].slider.min), Number(knobs[i].slider.max)];
    const here = now[data.knobs[i].way][data.knobs[i].at], reach = SHARE * (high - low);
    return [Math.max(low, Math.min(here - reach, high - reach)),
      Math.min(high, Math.max(here + reach, low + reach))];
  });
  return {axes, ranges, before: now};
}

const along01 = ([low, high], k) => low + ((high - low) * k) / (CELLS - 1);

// The determinant whose zeros a way of this kind may cross: that of the other kind.
function crossed(way, posture) {
  const told = robot.measure(posture);
  const value = way === "direct" || data.unsigned ? told?.detInverse : told?.detDirect;
  return value ?? NaN;
}

// Follow the branch from cell to cell, breadth first, for a while; cells wait in `front`.
function flood({axes, ranges, before}, {cells, front}) {
  const [{way}] = axes, end = performance.now() + BUSY;
  while (front.length && performance.now() < end) {
    const [i, j, guess] = front.shift();
    if (i < 0 || j < 0 || i >= CELLS || j >= CELLS || cells[i][j]) continue;
    const goal = Array.from(before[way]);
    [i, j].forEach((k, n) => { goal[axes[n].at] = along01(ranges[n], k); });
    const found = way === "direct" ? robot.direct(goal, guess) : robot.inverse(poseOf(goal), guess);
    if (!found.converged) continue;
    cells[i][j] = {value: crossed(way, found.q)};
    for (const [a, b] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) front.push([i + a, j + b, found.q]);
  }
  return front.length > 0;
}

// Lines where values change their sign between four reached cells: marching squares.
function signChanges(cells) {
  const lines = [];
  for (let i = 0; i + 1 < CELLS; ++i)
    for (let j = 0; j + 1 < CELLS; ++j) {
      const ring = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
      const values = ring.map(([a, b]) => cells[a][b]?.value ?? NaN);
      if (values.some(Number.isNaN)) continue;
      const cuts = [];
      ring.forEach(([a, b], k) => {
        const [c, d] = ring[(k + 1) % 4], x = values[k], y = values[(k + 1) % 4];
        if (x * y < 0) cuts.push([a + ((c - a) * x) / (x - y), b + ((d - b) * x) / (x - y)]);
      });
      for (let k = 0; k + 1 < cuts.length; k += 2) lines.push([cuts[k], cuts[k + 1]]);
    }
  return lines;
}

// Pieces that share their ends, one after the other as long lines: dashes then run through.
function chained(pieces) {
  const key = (point) => point.map((x) => x.toFixed(6)).join(" ");
  const at = new Map();
  for (const piece of pieces)
    for (const point of piece) at.set(key(point), [...(at.get(key(point)) ?? []), piece]);
  const left = new Set(pieces), lines = [];
  for (const piece of pieces) {
    if (!left.delete(piece)) continue;
    const line = [...piece];
    for (const atEnd of [true, false])
      for (;;) {
        const end = atEnd ? line.at(-1) : line[0];
        const next = at.get(key(end)).find((one) => left.has(one));
        if (next === undefined) break;
        left.delete(next);
        const point = key(next[0]) === key(end) ? next[1] : next[0];
        if (atEnd) line.push(point);
        else line.unshift(point);
      }
    lines.push(line);
  }
  return lines;
}

function drawLocal({axes: [{way}]}, cells) {
  const step = SIDE / (CELLS - 1), place = element("local-cells"), shown = [];
  for (let i = 0; i < CELLS; ++i)
    for (let j = 0; j < CELLS; ++j)
      if (!cells[i][j])
        shown.push(svg("rect", {x: step * (i - 0.5), y: SIDE - step * (j + 0.5), width: step,
          height: step, class: "unreached"}));
  const other = way === "direct" ? "inverse" : "direct", {colour, dashes} = data.strokes[other];
  for (const line of chained(signChanges(cells)))
    shown.push(svg("polyline", {
      points: line.map(([a, b]) => `${step * a},${SIDE - step * b}`).join(" "),
      fill: "none", stroke: colour, "stroke-width": 2, "stroke-dasharray": dashes,
    }));
  place.replaceChildren(...shown);
  cell("local-legend", `line: ${other} singularities, to about a cell of ${CELLS} x ${CELLS}; `
    + `grey: not reached along the branch, which ${way} singularities end`);
}

// Ranges around the cells that were reached, where these take up little; else null.
const LITTLE = 0.6, MARGIN = 1.5;
function narrowed(ranges, cells) {
  const places = cells.flatMap((column, i) => column.flatMap((one, j) => (one ? [[i, j]] : [])));
  const ends = [0, 1].map((n) => {
    const some = places.map((place) => place[n]);
    return [Math.min(...some) - MARGIN, Math.max(...some) + MARGIN].map((k) =>
      Math.min(Math.max(k, 0), CELLS - 1));
  });
  if (ends.every(([low, high]) => high - low > LITTLE * (CELLS - 1))) return null;
  return ends.map((some, n) => some.map((k) => along01(ranges[n], k)));
}

const cellOf = ({axes, ranges, before}) => axes.map(({way, at}, n) => {
  const [low, high] = ranges[n];
  return Math.round(((before[way][at] - low) / (high - low)) * (CELLS - 1));
});

// Follow the branch over a plane, a slice of time after the other; the cells, or null once another
// map was begun.
function followed(plane, start, mine) {
  const cells = Array.from({length: CELLS}, () => new Array(CELLS).fill(null));
  const state = {cells, front: [[...cellOf(plane), start]]};
  return new Promise((done) => {
    const work = () => {
      if (mine !== mapping) done(null);
      else if (flood(plane, state)) setTimeout(work);
      else done(cells);
    };
    work();
  });
}

function describeLocal({axes, ranges}, pair) {
  const [across, up] = pair.map((i) => data.knobs[i].name);
  const [a, b] = ranges.map((ends, n) =>
    `${ends.map((x) => +x.toFixed(4)).join(" to ")} ${data.knobs[pair[n]].unit}`);
  cell("local-ends", `${across} across, ${a}; ${up} up, ${b}`);
}

const ZOOMS = 3;
async function mapOver(pair) {
  const plane = aroundHere(pair), mine = ++mapping, start = Float64Array.from(q);
  if (planes[LOCAL] === undefined) listenTo(LOCAL);
  planes[LOCAL] = plane;
  element("local").hidden = false;
  let cells = null;
  for (let k = 0; k < ZOOMS; ++k) {
    describeLocal(plane, pair);
    cell("local-legend", "following the branch ...");
    cells = await followed(plane, start, mine);
    const closer = cells && k + 1 < ZOOMS ? narrowed(plane.ranges, cells) : null;
    if (closer === null) break;
    plane.ranges = closer;
  }
  if (cells === null) return null;
  drawLocal(plane, cells);
  markPlanes(current());
  return cells.map((column) => column.map((one) => one?.value ?? null));
}

chooses("pairs", data.pairs, mapOver);
