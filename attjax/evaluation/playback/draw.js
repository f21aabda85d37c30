// Paints the spacecraft, its axes and the goal's.

// Planes between its parts order them exactly: what lies on the eye's side is painted last.
// Where the truth was not told, thin lines behind it all end in rings around the tips that the
// body's axes were believed to have.
function paintScene(canvas, craft, [quaternion, believed], camera, colours) {
  const { context, width, height } = prepared(canvas);
  const view = viewFrom(camera, width, height);
  const attitude = rotation(quaternion);
  const back = transpose(attitude);
  const scene = {
    context, colours, eye: apply(back, view.eye), light: apply(back, view.light),
    place: (p) => view.project(apply(attitude, p)),
  };
  const nearest = (list, towards) => (towards > 0 ? list : [...list].reverse());
  const core = () => nearest(craft.core, scene.eye[craft.tall])
    .forEach((part) => paintFaces(scene, part));
  const wings = craft.wings.map((part) => () => paintFaces(scene, part));
  const body = nearest([wings[0], core, wings[1]], scene.eye[craft.span]);
  const axes = [0, 1, 2].map((axis) => ({
    near: scene.eye[axis] > 0, paint: () => paintBodyAxis(scene, axis, craft.reach[axis]) }));
  const goals = [0, 1, 2].flatMap((axis) => [
    { near: false, paint: () => paintGoalAxis(scene, view, axis, 0, REACH) },
    { near: view.eye[axis] > 0, paint: () => paintGoalAxis(scene, view, axis, REACH, GOAL_AXIS) },
  ]);
  const paint = (list, near) => list.filter((x) => x.near === near).forEach((x) => x.paint());
  const tips = believed ? transpose(rotation(believed)).map((axis) =>
    view.project(axis.map((x) => BODY_AXIS * x))) : [];
  tips.forEach((tip) => rule(context, view.project([0, 0, 0]), tip, colours.believed, 1));
  paint(goals, false);
  paint(axes, false);
  body.forEach((part) => part());
  paint(axes, true);
  paint(goals, true);
  if (believed) {
    tips.forEach((tip) => paintRing(scene, tip));
    context.font = "11px system-ui, sans-serif";
    write(context, "○ axes as believed", 12, height - 10, "left", colours.believed);
  }
}

// The canvas, cleared and sized to its place on the page, to be drawn on in CSS pixels.
function prepared(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const { clientWidth: width, clientHeight: height } = canvas;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

function paintFaces(scene, faces) {
  const distance = (face) =>
    Math.hypot(...scene.eye.map((x, i) => x - (face.points[0][i] + face.points[2][i]) / 2));
  faces
    .filter(({ normal, points }) => dot(normal, scene.eye) > dot(normal, points[0]))
    .sort((a, b) => distance(b) - distance(a))
    .forEach((face) => paintFace(scene, face));
}

function paintFace({ context, colours, light, place }, face) {
  const brightness = 0.7 + 0.3 * Math.max(dot(face.normal, light), 0);
  const fill = shaded(colours[face.colour], brightness);
  trace(context, face.points.map(place), true);
  context.fillStyle = fill;
  context.fill();
  context.lineWidth = 0.8;
  context.strokeStyle = face.seamless ? fill : shaded(colours[face.colour], 0.6 * brightness);
  context.stroke();
  context.strokeStyle = shaded(colours[face.colour], 1.45 * brightness);
  context.lineWidth = 0.6;
  for (const line of face.lines || []) {
    trace(context, line.map(place), false);
    context.stroke();
  }
}

function trace(context, points, closed) {
  context.beginPath();
  points.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
  if (closed) context.closePath();
}

function shaded(hex, brightness) {
  const parts = [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
  return `rgb(${parts.map((x) => Math.min(255, Math.round(x * brightness))).join(" ")})`;
}

function paintBodyAxis(scene, axis, start) {
  const { context, colours, place } = scene;
  const along = (length) => place(unit(axis).map((x) => length * x));
  const [from, to] = [along(start), along(BODY_AXIS)];
  context.strokeStyle = context.fillStyle = colours[AXES[axis]];
  context.lineWidth = 2.2;
  trace(context, [from, to], false);
  context.stroke();
  paintHead(context, along(BODY_AXIS - 0.12), along(BODY_AXIS + 0.02));
  paintLabel(scene, place([0, 0, 0]), to, AXES[axis], "600 14px system-ui, sans-serif");
}

function paintHead(context, [x0, y0], [x1, y1]) {
  const length = Math.hypot(x1 - x0, y1 - y0);
  if (length < 1) return; // it points at the eye
  const [across, down] = [(-4 * (y1 - y0)) / length, (4 * (x1 - x0)) / length];
  trace(context, [[x0 + across, y0 + down], [x1, y1], [x0 - across, y0 - down]], true);
  context.fill();
}

function paintRing({ context, colours }, [x, y]) {
  context.beginPath();
  context.arc(x, y, 7, 0, 2 * Math.PI);
  context.strokeStyle = colours.believed;
  context.lineWidth = 1;
  context.stroke();
}

function paintGoalAxis(scene, view, axis, from, to) {
  const { context, colours } = scene;
  const along = (length) => view.project(unit(axis).map((x) => length * x));
  context.save();
  context.globalAlpha = 0.6;
  context.strokeStyle = context.fillStyle = colours[AXES[axis]];
  context.lineWidth = 1.3;
  context.setLineDash([5, 4]);
  trace(context, [along(from), along(to)], false);
  context.stroke();
  if (to === GOAL_AXIS) {
    context.globalAlpha = 0.85;
    paintLabel(scene, along(0), along(to), `${AXES[axis]} goal`, "11px system-ui, sans-serif");
  }
  context.restore();
}

// Just beyond the tip of an axis, or beside it where the axis points at the eye.
function paintLabel({ context, colours }, centre, tip, text, font) {
  const [dx, dy] = [tip[0] - centre[0], tip[1] - centre[1]];
  const length = Math.max(Math.hypot(dx, dy), 1);
  context.font = font;
  context.textAlign = "center";
  context.textBaseline = "middle";
  const away = 9 + (Math.abs(dx / length) * context.measureText(text).width) / 2;
  const at = [tip[0] + (away * dx) / length, tip[1] + (away * dy) / length];
  context.setLineDash([]);
  context.strokeStyle = colours.panel;
  context.lineWidth = 4;
  context.strokeText(text, ...at);
  context.fillText(text, ...at);
}
