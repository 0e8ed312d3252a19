// -- buttons, lists, and points of sets in the scene ----------------------------------------------

element("across").addEventListener("click", toOtherSide);
element("picture").addEventListener("click", () => {
  const link = document.createElement("a");
  link.download = `${document.title}.png`;
  link.href = viewer.capture_image();
  link.click();
});
element("copy").addEventListener("click", () => {
  const place = element("copied");
  place.value = "[" + Array.from(q).join(", ") + "]";
  place.hidden = false;
  place.select();
});

// A list whose first entry is its heading.
function chooses(id, entries, choose) {
  const list = element(id);
  list?.addEventListener("change", () => {
    const chosen = entries[list.selectedIndex - 1];
    list.selectedIndex = 0;
    if (chosen) choose(chosen);
  });
}
chooses("postures", data.postures, toPosture);
chooses("modes", data.modes, toMode);

if (data.measured) {
  data.load.forEach((_, i) => element(`load-${i}`).addEventListener("input", showEfforts));
  element("weights").addEventListener("change", showEfforts);
}

// Through a series by its slider, or by a click at one of its points in the scene.
data.series.forEach(({q: postures}, i) => {
  const slider = element(`series-${i}`);
  slider.addEventListener("input", () => request(() => towards(postures[slider.valueAsNumber])));
});
const CLICK = 14, STILL = 6; // pixels
const pane = viewer.dom_element; // which captures the pointer to turn the scene
let pressed = null;
pane.addEventListener("pointerdown", (event) => { pressed = [event.clientX, event.clientY]; });
pane.addEventListener("pointerup", (event) => {
  if (pressed === null) return;
  const [x, y] = [event.clientX, event.clientY], [a, b] = pressed;
  pressed = null;
  if (Math.hypot(x - a, y - b) < STILL) goTo(x, y);
});

const inScene = (point) => onPane(new Vector3(...point).applyMatrix4(root.matrixWorld));

function goTo(x, y) {
  let least = CLICK, found = null;
  data.series.forEach(({points}, i) => points.forEach((point, k) => {
    const [left, top, depth] = inScene(point), far = Math.hypot(left - x, top - y);
    if (Math.abs(depth) < 1 && far < least) [least, found] = [far, [i, k]];
  }));
  if (found === null) return;
  const [i, k] = found;
  element(`series-${i}`).value = k;
  towards(data.series[i].q[k]);
}
