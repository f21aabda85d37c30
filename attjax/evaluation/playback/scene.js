// The spacecraft in 3-D: polygons projected onto a canvas.
//
// Quaternions are scalar last, [q1, q2, q3, qs], as in attjax/quaternion.py. Eq. 9 there,
// dq/dt = 1/2 Omega(w) q with w in the body frame, equals 1/2 q (x) (w, 0): the kinematics of the
// rotation that takes components along the body axes to components along the goal axes,
//     v_goal = R(q) v_body.
// The goal frame stands still on the screen, and column i of R(q) is body axis i in it. So under
// a positive w1 the body's y axis turns towards its z axis, as the right-hand rule says.

const REACH = 1.2; // from the centre to the tip of a solar panel; all lengths are in its units
const BODY_AXIS = 1.38;
const GOAL_AXIS = 1.72;
const LABEL = 17; // CSS pixels between the tip of a goal axis and the edge, unless zoomed
const AXES = ["x", "y", "z"];

function rotation([x, y, z, w]) {
  const scale = 2 / (x * x + y * y + z * z + w * w);
  return [
    [1 - scale * (y * y + z * z), scale * (x * y - z * w), scale * (x * z + y * w)],
    [scale * (x * y + z * w), 1 - scale * (x * x + z * z), scale * (y * z - x * w)],
    [scale * (x * z - y * w), scale * (y * z + x * w), 1 - scale * (x * x + y * y)],
  ];
}

// The angle of the turn by a quaternion, and of that between two of either sign, rad.
const errorAngle = ([x, y, z, w]) => 2 * Math.atan2(Math.hypot(x, y, z), w);

function between([a, b, c, d], [x, y, z, w]) {
  const turn = [d * x - w * a - (b * z - c * y), d * y - w * b - (c * x - a * z),
    d * z - w * c - (a * y - b * x)];
  return errorAngle([...turn, Math.abs(a * x + b * y + c * z + d * w)]);
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const apply = (matrix, v) => matrix.map((row) => dot(row, v));
const transpose = (m) => m[0].map((_, i) => m.map((row) => row[i]));
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
const unit = (axis) => [0, 1, 2].map((i) => Number(i === axis));

// A view of the goal frame: where the eye is, and where points fall on the canvas.
function viewFrom(camera, width, height) {
  const [ca, sa] = [Math.cos(camera.azimuth), Math.sin(camera.azimuth)];
  const [ce, se] = [Math.cos(camera.elevation), Math.sin(camera.elevation)];
  const towards = [ce * ca, ce * sa, se];
  const right = [-sa, ca, 0];
  const up = [-se * ca, -se * sa, ce];
  const middle = 0.56 * height; // below the centre, as the goal's z axis points up and none down
  const scale = (camera.zoom * (Math.min(middle, width / 2) - LABEL)) / (1.03 * GOAL_AXIS);
  const distance = 7;
  return {
    eye: towards.map((x) => distance * x),
    light: towards.map((x, i) => 0.62 * x - 0.4 * right[i] + 0.68 * up[i]),
    project(p) {
      const nearer = (scale * distance) / (distance - dot(p, towards));
      return [width / 2 + nearer * dot(p, right), middle - nearer * dot(p, up)];
    },
  };
}

// Parts of a spacecraft, as lists of faces in body coordinates. Its wings lie along the axis
// along which the mass is spread most, and are thin along the one of least spread; the sizes
// follow the spread, sqrt(sum m x_i^2), within limits that leave a bus with two wings.
function buildSpacecraft(inertia) {
  const moments = inertia.map((row, i) => (Array.isArray(row) ? row[i] : row));
  const half = (moments[0] + moments[1] + moments[2]) / 2;
  const spread = moments.map((moment) => Math.sqrt(Math.max(half - moment, 0)));
  const [thin, tall, span] = [0, 1, 2].sort((a, b) => spread[a] - spread[b]);
  const size = (axis, low, high) => clamp((REACH * spread[axis]) / spread[span], low, high);
  const bus = { thin: size(thin, 0.17, 0.3), tall: size(tall, 0.26, 0.36), span: 0.21 };
  const at = (a, b, c) => {
    const p = [0, 0, 0];
    [p[thin], p[tall], p[span]] = [a, b, c];
    return p;
  };
  const wings = [-1, 1].map((side) => wing(at, side, bus));
  const core = [nozzle(at, bus), box(at, bus), dish(at, bus)]; // from below to above
  const reach = [];
  [reach[thin], reach[tall], reach[span]] = [bus.thin, bus.tall + 0.2, REACH];
  return { wings, core, span, tall, reach };
}

function box(at, bus) {
  const faces = [];
  const sizes = [bus.thin, bus.tall, bus.span];
  for (let axis = 0; axis < 3; axis++) {
    for (const sign of [-1, 1]) {
      const points = [[-1, -1], [-1, 1], [1, 1], [1, -1]].map((corner) => {
        const signs = [...corner];
        signs.splice(axis, 0, sign);
        return at(...signs.map((s, i) => s * sizes[i]));
      });
      faces.push({ points, normal: at(...unit(axis).map((x) => sign * x)), colour: "bus" });
    }
  }
  const lens = ring(16).map(([c, s]) => at(bus.thin, 0.11 * c - 0.08, 0.11 * s));
  faces.push({ points: lens, normal: at(1, 0, 0), colour: "nozzle" });
  return faces;
}

// A yoke and three hinged panels: cells on the positive side, a plain back on the other.
function wing(at, side, bus) {
  const [root, half] = [bus.span + 0.13, 0.92 * bus.tall];
  const length = (REACH - root) / 3;
  const faces = [];
  for (const sign of [-1, 1]) {
    const normal = at(sign, 0, 0);
    const quad = (low, high, width) =>
      [[low, -width], [low, width], [high, width], [high, -width]].map(([c, b]) =>
        at(0, b, side * c));
    faces.push({ points: quad(bus.span, root, 0.045), normal, colour: "nozzle" });
    for (let i = 0; i < 3; i++) {
      const [low, high] = [root + i * length + 0.012, root + (i + 1) * length - 0.012];
      const lines = sign < 0 ? [] : [-0.5, 0, 0.5].map((b) =>
        [at(0, b * half, side * low), at(0, b * half, side * high)]);
      if (sign > 0) {
        const middle = (side * (low + high)) / 2;
        lines.push([at(0, -half, middle), at(0, half, middle)]);
      }
      const colour = sign > 0 ? "cell" : "back";
      faces.push({ points: quad(low, high, half), normal, colour, lines });
    }
  }
  return faces;
}

// An antenna above the bus, hollow: each piece of the bowl has an inner and an outer face.
function dish(at, bus) {
  const radius = Math.min(0.2, bus.span);
  const level = (r) => bus.tall + 0.03 + 2.6 * r * r;
  return bowl(at, "dish", [0.03, radius], level, (r) => 5.2 * r);
}

function nozzle(at, bus) {
  const radius = 0.6 * Math.min(bus.thin, bus.span) + 0.02;
  const level = (r) => -bus.tall - (0.16 * (r - 0.4 * radius)) / (0.6 * radius);
  return bowl(at, "nozzle", [0.4 * radius, radius], level, () => -0.16 / (0.6 * radius));
}

function bowl(at, colour, [inner, outer], level, slope) {
  const faces = [];
  const corners = ring(20);
  corners.forEach(([c, s], i) => {
    const [c2, s2] = corners[(i + 1) % corners.length];
    const points = [[c, s, inner], [c, s, outer], [c2, s2, outer], [c2, s2, inner]].map(
      ([x, y, r]) => at(r * x, level(r), r * y));
    const steep = slope((inner + outer) / 2);
    const length = Math.hypot(1, steep);
    for (const sign of [-1, 1]) {
      const [across, along] = [(-sign * steep) / length, sign / length];
      faces.push({ points, normal: at((across * (c + c2)) / 2, along, (across * (s + s2)) / 2),
        colour, seamless: true });
    }
  });
  return faces;
}

function ring(n) {
  return Array.from({ length: n }, (_, i) => {
    const angle = (2 * Math.PI * i) / n;
    return [Math.cos(angle), Math.sin(angle)];
  });
}
