// Plays a motion: bodies move evenly between the postures of the page, read-outs go along.
{
  const {Matrix4, Quaternion, Vector3} = MeshCat.THREE;
  const data = JSON.parse(document.getElementById("motion").textContent);
  const bytes = Uint8Array.from(atob(data.poses), (c) => c.charCodeAt(0));
  const poses = new Float32Array(bytes.buffer), times = data.times, last = times.length - 1;
  const place = movable(data);
  const bodies = Array.from({length: data.bodies}, () => new Matrix4());
  const element = (id) => document.getElementById(id);
  const slider = element("time"), clock = element("clock"), button = element("play");
  const rows = [...document.querySelectorAll("#readouts .readout")];
  const one = new Vector3(1, 1, 1);
  let now = times[0], playing = false, before = null;

  // Indices of the postures before and after a time, and where in between it is.
  function between(time) {
    let low = 0, high = last;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= time) low = middle;
      else high = middle;
    }
    return [low, high, (time - times[low]) / (times[high] - times[low])];
  }

  function show(time) {
    now = Math.min(Math.max(time, times[0]), times[last]);
    const [low, high, share] = between(now);
    bodies.forEach((matrix, i) => {
      const a = 7 * (low * data.bodies + i), b = 7 * (high * data.bodies + i);
      const end = new Vector3().fromArray(poses, b), turned = new Quaternion();
      const turn = new Quaternion().fromArray(poses, a + 3);
      turn.slerp(turned.fromArray(poses, b + 3), share);
      matrix.compose(new Vector3().fromArray(poses, a).lerp(end, share), turn, one);
    });
    place(bodies);
    slider.value = now;
    clock.textContent = now.toFixed(3) + " s";
    tell(low, high, share);
  }

  function tell(low, high, share) {
    const x = (now - times[0]) / (times[last] - times[0]);
    rows.forEach((row, i) => {
      const values = data.readouts[i];
      const value = (1 - share) * values[low] + share * values[high];
      row.querySelector("output").textContent = value.toPrecision(4);
      row.querySelector("line.now").setAttribute("transform", `translate(${x * data.across} 0)`);
    });
  }

  function play(on) {
    playing = on;
    before = null;
    button.textContent = on ? "pause" : "play";
  }

  function step(clockTime) {
    if (playing) {
      const passed = before === null ? 0 : (clockTime - before) / 1000 * element("speed").value;
      before = clockTime;
      show(now >= times[last] ? times[0] : now + passed);
    }
    requestAnimationFrame(step);
  }

  function asked() {
    const found = /^#t=(-?[0-9.eE+-]+)$/.exec(location.hash);
    if (!found || !isFinite(found[1])) return false;
    play(false);
    show(Number(found[1]));
    return true;
  }

  button.onclick = () => play(!playing);
  slider.oninput = () => { play(false); show(Number(slider.value)); };
  addEventListener("hashchange", asked);
  show(times[0]);
  if (!asked()) play(!matchMedia("(prefers-reduced-motion: reduce)").matches);
  requestAnimationFrame(step);
}
