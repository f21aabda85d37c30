// What a pointer, a finger and the keyboard do.

function listen() {
  element("play").addEventListener("click", () => setPlaying(!player.playing));
  element("time").addEventListener("input", (event) =>
    seek(Number(event.target.value) * data.controlPeriod));
  element("slew").addEventListener("change", (event) => {
    player.slew = event.target.selectedIndex;
    player.time = 0;
    updateAll();
  });
  element("speed").addEventListener("change", (event) => {
    player.speed = Number(event.target.value);
  });
  element("span").addEventListener("change", (event) => {
    player.span = Number(event.target.value);
    updateAll();
  });
  document.addEventListener("keydown", (event) => {
    // A focused button or list has its own use for the space bar.
    if (event.key !== " " || ["BUTTON", "SELECT"].includes(event.target.tagName)) return;
    event.preventDefault();
    setPlaying(!player.playing);
  });
  for (const panel of panels) {
    listenToScene(panel.scene);
    listenToCurves(panel);
  }
  new ResizeObserver(updateAll).observe(element("panels"));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    colours = readColours();
    updateAll();
  });
}

function turn(dx, dy) {
  camera.azimuth -= 0.01 * dx;
  camera.elevation = clamp(camera.elevation + 0.01 * dy, -1.5, 1.5);
  update();
}

function zoom(factor) {
  camera.zoom = clamp(camera.zoom * factor, 0.4, 4);
  update();
}

// One pointer turns the view, two zoom by their distance; both panels share it.
function listenToScene(scene) {
  const pointers = new Map();
  const apart = () => {
    const [a, b] = [...pointers.values()];
    return Math.hypot(a.x - b.x, a.y - b.y);
  };
  scene.addEventListener("pointerdown", (event) => {
    scene.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  });
  scene.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const distance = pointers.size === 2 ? apart() : 0;
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (pointers.size === 1) turn(event.clientX - before.x, event.clientY - before.y);
    else if (distance) zoom(apart() / distance);
  });
  for (const name of ["pointerup", "pointercancel"]) {
    scene.addEventListener(name, (event) => pointers.delete(event.pointerId));
  }
  scene.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(-0.0015 * event.deltaY));
  }, { passive: false });
  const keys = {
    ArrowLeft: () => turn(10, 0), ArrowRight: () => turn(-10, 0),
    ArrowUp: () => turn(0, 10), ArrowDown: () => turn(0, -10),
    "+": () => zoom(1.15), "=": () => zoom(1.15), "-": () => zoom(1 / 1.15),
  };
  scene.addEventListener("keydown", (event) => {
    if (!keys[event.key]) return;
    event.preventDefault();
    keys[event.key]();
  });
}

function listenToCurves({ curves }) {
  let span = null; // while the pointer is down, the times shown stay what they were then
  const scrub = (event) => {
    const box = curves.getBoundingClientRect();
    const share = (event.clientX - box.left - LEFT) / (box.width - LEFT - RIGHT);
    seek(span[0] + clamp(share, 0, 1) * (span[1] - span[0]));
  };
  curves.addEventListener("pointerdown", (event) => {
    curves.setPointerCapture(event.pointerId);
    span = shownSpan();
    scrub(event);
  });
  curves.addEventListener("pointermove", (event) => span && scrub(event));
  for (const name of ["pointerup", "pointercancel"]) {
    curves.addEventListener(name, () => { span = null; });
  }
}

function conditions() {
  const hertz = (1 / data.controlPeriod).toFixed(2);
  const tensor = data.inertia.map((row) => (Array.isArray(row) ? `(${row.map(short).join(", ")})` : short(row)));
  const shape = Array.isArray(data.inertia[0]) ? "" : "diag";
  return [
    `${hertz} Hz (frameskip ${data.frameskip})`, `seed ${data.seed}`,
    ...("world" in data ? [`world ${data.world}`] : []),
    `${data.spacecraft}, inertia ${shape}(${tensor.join(", ")}) kg m²`,
    ...(data.checkpoint === null ? [] : [`checkpoint ${data.checkpoint}`]),
    `attjax ${data.version}`,
  ].join("  ·  ");
}

element("conditions").textContent = conditions();
document.title = `attjax playback: ${data.controllers.join(" and ")}`;
element("slew").append(...data.slews.map((name) => new Option(name)));
element("time").max = data.steps;
element("clock").style.minWidth = `${2 * duration.toFixed(2).length + 3}ch`;
listen();
updateAll();
window.attjax = { data, flights, player, camera, rotation };
