// -- for a console, or another script of the page: what the sliders do ----------------------------

globalThis.instrument = {
  posture: () => Array.from(q), measure: () => robot.measure(q), classify: () => robot.classify(q),
  toInputs, toPose, toPosture, toOtherSide, goTo, mapOver, robot,
  onScreen: (point) => inScene(point), inputs: robot.inputs, coordinates: robot.coordinates,
};
show();
