// -- small maps of two coordinates: the mark is where the robot is, a click leads there ----------

// A plane has `axes`, coordinates of one way; their `ranges`; and where the robot stood `before`,
// when its curves were found.
const SIDE = 200;
const planes = data.planes.map((plane) => ({...plane, before: current()}));

function markPlanes(now) {
  planes.forEach(({axes, ranges, before: stood}, i) => {
    const [{way}] = axes, here = now[way], before = stood[way];
    const shares = axes.map(({at}, k) => {
      const [low, high] = ranges[k];
      return (here[at] - low) / (high - low);
    });
    const mark = element(`mark-${i}`);
    mark.setAttribute("transform", `translate(${SIDE * shares[0]} ${SIDE * (1 - shares[1])})`);
    const held = data.knobs.filter((knob) =>
      knob.way === way && !axes.some((axis) => axis.at === knob.at));
    const other = held.some(({at}) => Math.abs(here[at] - before[at]) > 1e-6);
    element(`other-${i}`).hidden = !other;
    mark.setAttribute("class", other ? "elsewhere" : "");
  });
}

function toPlace({axes, ranges}, shares) {
  const [{way}] = axes, goal = Array.from(current()[way]);
  axes.forEach(({at}, k) => {
    const [low, high] = ranges[k];
    goal[at] = low + shares[k] * (high - low);
  });
  return way === "direct" ? toInputs(goal) : toPose(poseOf(goal));
}

function listenTo(i) {
  const map = element(`plane-${i}`);
  map.addEventListener("click", (event) => {
    const {left, top, width, height} = map.getBoundingClientRect();
    toPlace(planes[i], [(event.clientX - left) / width, 1 - (event.clientY - top) / height]);
  });
  const steps = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]};
  map.addEventListener("keydown", (event) => {
    const step = steps[event.key];
    if (step === undefined) return;
    event.preventDefault();
    const {axes, ranges} = planes[i], here = current()[axes[0].way];
    toPlace(planes[i], axes.map(({at}, k) => {
      const [low, high] = ranges[k];
      return (here[at] - low) / (high - low) + 0.02 * step[k];
    }));
  });
}

planes.forEach((_, i) => listenTo(i));
