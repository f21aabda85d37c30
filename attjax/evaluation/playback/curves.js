// Error angle, rates and torque pulses over time, one below the other on one canvas.

const LEFT = 52;
const RIGHT = 42;
const FONT = "11px system-ui, sans-serif";

// Ranges that all flights of the page share, so that slews and controllers can be compared.
function sharedScales(data, flights) {
  let [least, most, fastest] = [Infinity, data.goalAngle, data.rateLimit];
  let [weakest, strongest] = [Infinity, 0];
  for (const flight of flights) {
    for (const angles of anglesOf(flight)) {
      for (const angle of angles) {
        if (angle > 0) least = Math.min(least, angle);
        most = Math.max(most, angle);
      }
    }
    for (const rate of flight.rate) fastest = Math.max(fastest, rate);
    for (let k = 0; k < data.steps; k++) {
      for (const x of flight.torque(k)) {
        if (x !== 0) weakest = Math.min(weakest, Math.abs(x));
        strongest = Math.max(strongest, Math.abs(x));
      }
    }
  }
  const low = 10 ** Math.floor(Math.log10(Math.min(least, data.goalAngle) * DEGREES));
  if (strongest === 0) weakest = strongest = 1;
  // Of misaligned torques there are shares about other axes, too weak to be told apart with these.
  weakest = clamp(data.leastTorque || 0, weakest, strongest);
  return { angle: [low, 1.5 * most * DEGREES], rate: 1.12 * fastest, torque: [weakest, strongest] };
}

const anglesOf = (flight) =>
  [flight.angle, ...(flight.believed ? [flight.believedAngle, flight.estimationError] : [])];

function layOut(width, height) {
  const [right, axis] = [width - RIGHT, height - 26];
  const lane = (axis - 20 - 18 * 2) / 3;
  const plot = (top, bottom) => ({ left: LEFT, right, top, bottom });
  return {
    angle: plot(18, 18 + lane - 4),
    rate: plot(36 + lane, 32 + 2 * lane),
    torque: plot(54 + 2 * lane, axis),
    left: LEFT, right, top: 18, bottom: axis,
  };
}

function paintCurves(canvas, flight, scales, [from, to], data, colours) {
  const { context, width, height } = prepared(canvas);
  const layout = layOut(width, height);
  const x = (time) => LEFT + ((time - from) / (to - from)) * (layout.right - LEFT);
  const first = Math.max(Math.floor(from / data.controlPeriod), 0);
  const last = Math.min(Math.ceil(to / data.controlPeriod), data.steps);
  const chart = { context, layout, x, first, last, data, flight, scales, colours };
  context.font = FONT;
  paintTimes(chart, from, to);
  paintAngle(chart);
  paintRates(chart);
  paintTorques(chart);
}

function paintTimes({ context, layout, x, colours }, from, to) {
  const least = (to - from) / ((layout.right - LEFT) / 70);
  const decade = 10 ** Math.floor(Math.log10(least));
  const step = [1, 2, 5, 10].map((k) => k * decade).find((k) => k >= least);
  for (let k = Math.ceil(from / step); k * step <= to + 1e-9; k++) {
    const at = x(k * step);
    rule(context, [at, layout.top], [at, layout.bottom], colours.line, 0.5);
    const label = String(Number((k * step).toPrecision(6)));
    write(context, label, at, layout.bottom + 10, "center", colours.muted);
  }
  write(context, "t (s)", layout.right + 8, layout.bottom + 10, "left", colours.muted);
}

function paintAngle({ context, layout: { angle: plot }, x, first, last, ...chart }) {
  const { data, flight, scales, colours } = chart;
  const [low, high] = scales.angle.map(Math.log10);
  const y = (degrees) =>
    plot.bottom - ((Math.log10(Math.max(degrees, 10 ** low)) - low) / (high - low)) *
    (plot.bottom - plot.top);
  const goal = data.goalAngle * DEGREES;
  const titled = `error angle φ (°), goal ${short(goal)}`;
  title(context, plot, titled, colours);
  const every = Math.ceil((high - low) / ((plot.bottom - plot.top) / 14));
  for (let k = low; k <= high; k += every) {
    rule(context, [plot.left, y(10 ** k)], [plot.right, y(10 ** k)], colours.line, 0.5);
    const label = k >= -2 ? String(10 ** k) : `1e−${-k}`;
    write(context, label, plot.left - 6, y(10 ** k), "right", colours.muted);
  }
  rule(context, [plot.left, y(goal)], [plot.right, y(goal)], colours.ink, 1, [4, 3]);
  write(context, "goal", plot.right + 6, y(goal), "left", colours.ink);
  const points = (angles) => range(first, last, (k) =>
    [x(k * data.controlPeriod), y(angles[k] * DEGREES)]);
  curve(context, plot, points(flight.angle), colours.ink, 1.4);
  if (!flight.believed) return;
  curve(context, plot, points(flight.believedAngle), colours.believed, 1.4, [3, 4]);
  curve(context, plot, points(flight.estimationError), colours.believed, 1);
  const after = plot.left + context.measureText(titled).width + 10;
  paintKey(context, [["believed", [3, 4]], ["estimate off", []]], after, plot.top - 9, colours);
}

function paintKey(context, entries, left, y, colours) {
  for (const [text, dashes] of entries) {
    rule(context, [left, y], [left + 13, y], colours.believed, 1.4, dashes);
    write(context, text, left + 17, y, "left", colours.believed);
    left += 26 + context.measureText(text).width;
  }
}

function paintRates({ context, layout: { rate: plot }, x, first, last, ...chart }) {
  const { data, flight, scales, colours } = chart;
  const middle = (plot.top + plot.bottom) / 2;
  const y = (rate) => middle - ((rate / scales.rate) * (plot.bottom - plot.top)) / 2;
  title(context, plot, "angular rate (rad/s)", colours);
  rule(context, [plot.left, y(0)], [plot.right, y(0)], colours.line, 1);
  for (const rate of [-data.rateLimit, 0, data.rateLimit]) {
    write(context, short(rate), plot.left - 6, y(rate), "right", colours.muted);
    if (rate) rule(context, [plot.left, y(rate)], [plot.right, y(rate)], colours.ink, 1, [4, 3]);
  }
  write(context, "limit", plot.right + 6, y(data.rateLimit), "left", colours.ink);
  const points = (value) => range(first, last, (k) => [x(k * data.controlPeriod), y(value(k))]);
  curve(context, plot, points((k) => flight.rate[k]), colours.muted, 1);
  write(context, "‖ω‖", plot.right + 6, middle - 19, "left", colours.muted);
  AXES.forEach((axis, i) => {
    curve(context, plot, points((k) => flight.velocity(k)[i]), colours[axis], 1.4);
    write(context, `ω${i + 1} ${axis}`, plot.right + 6, middle - 5 + 14 * i, "left", colours[axis]);
  });
}

// A lane for each axis; the height of a pulse is logarithmic, so the weakest can be seen too.
function paintTorques({ context, layout: { torque: plot }, x, first, last, ...chart }) {
  const { data, flight, scales: { torque: [weakest, strongest] }, colours } = chart;
  const levels = weakest < strongest ? `, log height from ${short(weakest)}` : "";
  title(context, plot, `torque pulses (N m)${levels}`, colours);
  const gap = 5;
  const lane = (plot.bottom - plot.top - 2 * gap) / 3;
  const decades = 1 + Math.log10(strongest / weakest);
  const height = (torque) =>
    ((Math.sign(torque) * lane) / 2) * Math.max((1 + Math.log10(Math.abs(torque) / weakest)) / decades, 0);
  const wide = clamp(x(data.controlPeriod) - x(0) - 1, 0.8, 3);
  AXES.forEach((axis, i) => {
    const middle = plot.top + i * (lane + gap) + lane / 2;
    rule(context, [plot.left, middle], [plot.right, middle], colours.line, 1);
    write(context, `M${i + 1} ${axis}`, plot.right + 6, middle, "left", colours[axis]);
    const tick = `±${short(strongest)}`;
    write(context, tick, plot.left - 6, middle, "right", colours.muted);
    context.save();
    clipTo(context, plot);
    context.fillStyle = colours[axis];
    for (let k = first; k < last; k++) {
      const torque = flight.torque(k)[i];
      if (torque === 0) continue;
      const tall = height(torque);
      context.fillRect(x(k * data.controlPeriod) - wide / 2, middle, wide, -tall);
    }
    context.restore();
  });
}

function range(first, last, point) {
  return Array.from({ length: last - first + 1 }, (_, i) => point(first + i));
}

function curve(context, plot, points, colour, width, dashes = []) {
  context.save();
  clipTo(context, plot);
  trace(context, points, false);
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.setLineDash(dashes);
  context.lineJoin = "round";
  context.stroke();
  context.restore();
}

function clipTo(context, { left, right, top, bottom }) {
  context.beginPath();
  context.rect(left, top - 2, right - left, bottom - top + 4);
  context.clip();
}

function rule(context, from, to, colour, width, dashes = []) {
  context.setLineDash(dashes);
  context.strokeStyle = colour;
  context.lineWidth = width;
  trace(context, [from, to], false);
  context.stroke();
  context.setLineDash([]);
}

function title(context, plot, text, colours) {
  write(context, text, plot.left, plot.top - 9, "left", colours.muted);
}

function write(context, text, x, y, align, colour) {
  context.textAlign = align;
  context.textBaseline = "middle";
  context.fillStyle = colour;
  context.fillText(text, x, y);
}
