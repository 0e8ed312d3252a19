// -- poses as x y z and roll, pitch, yaw: R = Rz(yaw) Ry(pitch) Rx(roll) ------------------------

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
const poseOf = (at) => [...at.slice(0, 3), ...toQuaternion(at.slice(3))];
