// The page: decodes the flights, keeps the clock, and answers the controls.

const DEGREES = 180 / Math.PI;
const element = (id) => document.getElementById(id);
const data = JSON.parse(element("flights").textContent);

// Three digits, as few zeros as can be read at a glance.
function show(x) {
  if (x === 0) return "0";
  return Math.abs(x) < 1e-3 ? x.toExponential(2) : x.toPrecision(3);
}

const short = (x) => String(Number(x.toPrecision(3))).replace("-", "−");

function floats(text) {
  return new Float32Array(Uint8Array.from(atob(text), (x) => x.charCodeAt(0)).buffer);
}

// A row a sample, the start included: quaternion, angular velocity, torque of the step from there.
// Where the truth was not told, also the quaternion that was believed at that moment.
function decode(text, belief) {
  const numbers = floats(text);
  const part = (from, to) => (k) => numbers.subarray(10 * k + from, 10 * k + to);
  const flight = { quaternion: part(0, 4), velocity: part(4, 7), torque: part(7, 10) };
  flight.angle = samples((k) => errorAngle(flight.quaternion(k)));
  if (belief) {
    const believed = floats(belief);
    flight.believed = (k) => believed.subarray(4 * k, 4 * k + 4);
    flight.believedAngle = samples((k) => errorAngle(flight.believed(k)));
    flight.estimationError = samples((k) => between(flight.believed(k), flight.quaternion(k)));
  }
  flight.rate = samples((k) => Math.hypot(...flight.velocity(k)));
  let used = 0;
  flight.impulse = samples((k) => {
    const before = used;
    used += Math.hypot(...flight.torque(k)) * data.pulse;
    return before;
  });
  // As eval.py counts: from which sample on the error stays within the goal angle.
  flight.settled = 1 + Math.max(0, flight.angle.findLastIndex((angle) => angle > data.goalAngle));
  flight.overspeed = flight.rate.findIndex((rate) => rate > data.rateLimit);
  return flight;
}

const samples = (value) => range(0, data.steps, value);
const hasBeliefs = "beliefs" in data;
const flights = data.flights.map((slew, i) =>
  slew.map((text, j) => decode(text, hasBeliefs && data.beliefs[i][j])));
const scales = sharedScales(data, flights.flat());
const craft = buildSpacecraft(data.inertia);
const camera = { azimuth: 0.55, elevation: 0.32, zoom: 1 };
const duration = data.steps * data.controlPeriod;
const player = { slew: 0, time: 0, playing: false, speed: 1, span: Infinity };
let colours = readColours();

const panels = data.controllers.map((name, index) => {
  const section = element("panel").content.cloneNode(true).firstElementChild;
  section.querySelector("h2").textContent = name;
  section.setAttribute("aria-label", name);
  section.classList.toggle("with-belief", hasBeliefs);
  element("panels").append(section);
  const part = (selector) => section.querySelector(selector);
  return {
    name, index, number: (key) => part(`dd.${key}`), scene: part(".scene"),
    curves: part(".curves"), chart: part(".curves canvas"), futures: section.querySelectorAll(".future"),
  };
});

function readColours() {
  const style = getComputedStyle(document.documentElement);
  const names = ["panel", "ink", "muted", "line", "x", "y", "z", "bus", "cell", "back", "dish",
    "nozzle", "believed"];
  return Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

const currentStep = () => Math.min(Math.floor(player.time / data.controlPeriod + 1e-6), data.steps);

function shownSpan() {
  const length = Math.min(player.span, duration);
  const from = clamp(player.time - length / 2, 0, duration - length);
  return [from, from + length];
}

// Between two samples attitudes are interpolated; numbers are those of the last sample.
function attitude(quaternion) {
  const step = currentStep();
  const [a, b] = [step, Math.min(step + 1, data.steps)].map(quaternion);
  const share = clamp(player.time / data.controlPeriod - step, 0, 1);
  return [0, 1, 2, 3].map((i) => a[i] + share * (b[i] - a[i]));
}

function settledText(flight) {
  if (flight.overspeed >= 0 && flight.overspeed <= currentStep()) return "overspeed";
  if (flight.settled > data.steps) return currentStep() === data.steps ? "never" : "–";
  return flight.settled <= currentStep() ? (flight.settled * data.controlPeriod).toFixed(2) : "–";
}

const estimate = (flight, step) => show(flight.estimationError[step] * DEGREES);

function update() {
  const step = currentStep();
  for (const panel of panels) {
    const flight = flights[player.slew][panel.index];
    panel.number("angle").textContent = show(flight.angle[step] * DEGREES);
    panel.number("rate").textContent = show(flight.rate[step]);
    panel.number("settled").textContent = settledText(flight);
    panel.number("impulse").textContent = flight.impulse[step].toPrecision(3);
    if (hasBeliefs) panel.number("estimate").textContent = estimate(flight, step);
    const believed = hasBeliefs ? attitude(flight.believed) : null;
    paintScene(panel.scene, craft, [attitude(flight.quaternion), believed], camera, colours);
    placeCursor(panel);
    if (player.span < duration) paintChart(panel);
  }
  const clock = (step * data.controlPeriod).toFixed(2);
  element("time").value = step;
  element("time").setAttribute("aria-valuetext", `${clock} s`);
  element("clock").textContent = `${clock} / ${duration.toFixed(2)} s`;
}

function placeCursor({ curves, futures }) {
  const layout = layOut(curves.clientWidth, curves.clientHeight);
  const [from, to] = shownSpan();
  const left = LEFT + ((player.time - from) / (to - from)) * (layout.right - LEFT);
  [layout.angle, layout.rate, layout.torque].forEach(({ top, bottom, right }, i) => {
    futures[i].style.cssText = `left:${left}px;width:${right - left + 1}px;` +
      `top:${top - 2}px;height:${bottom - top + 4}px`;
  });
}

function paintChart({ chart, index }) {
  paintCurves(chart, flights[player.slew][index], scales, shownSpan(), data, colours);
}

function updateAll() {
  const slew = data.slews[player.slew];
  for (const panel of panels) {
    paintChart(panel);
    const flight = flights[player.slew][panel.index];
    const end = show(flight.angle[data.steps] * DEGREES);
    const off = hasBeliefs ? `, of the estimate ${estimate(flight, data.steps)}°` : "";
    panel.scene.setAttribute("aria-label", `${panel.name}: attitude of the spacecraft in 3-D. ` +
      `${hasBeliefs ? "Rings show its axes as believed. " : ""}Arrow keys turn the view, ` +
      "plus and minus zoom.");
    panel.chart.setAttribute("aria-label", `${panel.name}, ${slew}: error angle, angular rates ` +
      `and torque pulses over ${duration.toFixed(2)} s; error at the end ${end}°${off}.`);
  }
  update();
}

function seek(time) {
  player.time = clamp(time, 0, duration);
  update();
}

function setPlaying(playing) {
  if (playing && currentStep() === data.steps) player.time = 0;
  player.playing = playing;
  element("play").textContent = playing ? "Pause" : "Play";
  if (playing) requestAnimationFrame((now) => tick(now, now));
  else announce();
}

function announce() {
  const angles = panels.map(({ name, number }) => `${name} ${number("angle").textContent}°`);
  element("status").textContent = `Stopped at ${element("clock").textContent}: ${angles.join(", ")}`;
}

function tick(before, now) {
  if (!player.playing) return;
  seek(player.time + (player.speed * (now - before)) / 1000);
  if (player.time >= duration) setPlaying(false);
  else requestAnimationFrame((next) => tick(now, next));
}
