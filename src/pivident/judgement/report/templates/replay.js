// The arm moved as recorded: turn it, play it, and see the same instant in all figures over time.
// A page may bring another motion later: what belongs to a view that is gone does nothing any more.
function replay(root) {
  const motion = JSON.parse(root.nextElementSibling.textContent);
  const stage = root.querySelector(".stage");
  const canvas = stage.querySelector("canvas");
  const play = stage.querySelector(".play");
  const slider = stage.querySelector("input[type=range]");
  const output = stage.querySelector("output");
  const choice = (name) => stage.querySelector(`[name=${name}]`);
  const rows = [...root.querySelectorAll(".posture tbody tr")];
  const still = matchMedia("(prefers-reduced-motion: reduce)");

  const VIEWS = { oblique: [0.9, 0.42], front: [0, 0.02], side: [Math.PI / 2, 0.02], top: [0, Math.PI / 2 - 0.01] };
  const STEP = 0.5; // of someone who wants no movement: two postures a second
  let recording, origin, reach, paths, distance, target;
  let [azimuth, elevation] = VIEWS.oblique;
  let instant = 0, playing = false, last = 0, asked = false, touched = false;

  function positions(t) {
    const count = recording.q[0].length;
    const x = recording.duration > 0 ? (t / recording.duration) * (count - 1) : 0;
    const k = Math.min(Math.floor(x), count - 2), share = x - k;
    return recording.q.map((q) => q[k] + share * (q[k + 1] - q[k]));
  }

  function choose(index) {
    recording = motion.recordings[index];
    origin = recording.start;
    slider.max = recording.duration;
    slider.step = recording.duration / 1000 || 1;
    const count = recording.q[0].length;
    const every = Math.max(1, Math.floor(count / 400));
    paths = [];
    const points = [[0, 0, 0]];
    for (let k = 0; k < count; k += every) {
      const q = recording.q.map((values) => values[k]);
      arm.tips(motion, q).forEach((tip, i) => (paths[i] ??= []).push(tip));
      points.push(...arm.poses(motion.joints, q).map(({ p }) => p), ...paths.map((path) => path.at(-1)));
    }
    const low = [0, 1, 2].map((i) => Math.min(...points.map((p) => p[i])));
    const high = [0, 1, 2].map((i) => Math.max(...points.map((p) => p[i])));
    target = arm.scaled(arm.add(low, high), 0.5);
    reach = Math.max(Math.hypot(...arm.less(high, low)) / 1.6, 1e-3);
    distance = home();
    instant = 0;
  }
  const home = () => 2.2 * reach;

  // Drawing: the floor, the path of the tip, then faces from far to near.
  const shade = (hex, light) => {
    const [r, g, b] = [1, 3, 5].map((k) => Math.round(Math.min(255, parseInt(hex.slice(k, k + 2), 16) * light)));
    return `rgb(${r},${g},${b})`;
  };

  function draw() {
    asked = false;
    const { clientWidth: width, clientHeight: height } = canvas;
    if (!width || !root.isConnected) return;
    const density = devicePixelRatio || 1;
    if (canvas.width !== Math.round(width * density) || canvas.height !== Math.round(height * density)) {
      canvas.width = Math.round(width * density);
      canvas.height = Math.round(height * density);
    }
    const pen = canvas.getContext("2d");
    pen.setTransform(density, 0, 0, density, 0, 0);
    pen.clearRect(0, 0, width, height);
    const view = arm.camera({ target, up: motion.up, azimuth, elevation, distance, width, height });
    const line = (points, colour, thickness) => {
      pen.beginPath();
      points.forEach((point, k) => {
        const [x, y] = view.seen(point);
        if (k) pen.lineTo(x, y); else pen.moveTo(x, y);
      });
      pen.strokeStyle = colour;
      pen.lineWidth = thickness;
      pen.stroke();
    };

    const [east, north] = arm.across(motion.up);
    const mesh = 10 ** Math.floor(Math.log10(reach)) / 2;
    const count = Math.ceil((1.1 * reach) / mesh);
    for (let k = -count; k <= count; k += 1) {
      const at = (a, b) => arm.add(arm.scaled(a, k * mesh), arm.scaled(b, count * mesh));
      line([at(east, north), at(east, arm.scaled(north, -1))], theme.variable("--line"), 1);
      line([at(north, east), at(north, arm.scaled(east, -1))], theme.variable("--line"), 1);
    }
    for (const path of paths) line(path, theme.variable("--measured"), 1);

    const colours = {
      base: theme.variable("--measured"),
      joint: (i) => theme.variable(`--m${i % {{ method_colours | length }}}`),
    };
    const q = positions(instant);
    const faces = arm.faces(motion, q, reach, colours).map((face) => {
      const seen = face.points.map(view.seen);
      const [a, b, c] = face.points;
      const normal = arm.unit(arm.cross(arm.less(b, a), arm.less(c, a)));
      const light = 0.62 + 0.45 * Math.abs(arm.dot(normal, arm.unit(arm.add(view.back, arm.scaled(motion.up, 0.8)))));
      return { seen, depth: seen.reduce((sum, p) => sum + p[2], 0) / seen.length, colour: shade(face.colour, light) };
    });
    for (const { seen, colour } of faces.sort((a, b) => b.depth - a.depth)) {
      pen.beginPath();
      seen.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
      pen.closePath();
      pen.fillStyle = pen.strokeStyle = colour;
      pen.lineWidth = 0.6;
      pen.fill();
      pen.stroke();
    }
    write(q);
  }

  function write(q) {
    slider.value = instant;
    const text = `t = ${instant.toFixed(2)} s of ${recording.duration.toFixed(2)} s`;
    output.textContent = text;
    slider.setAttribute("aria-valuetext", text);
    canvas.dataset.instant = instant;
    motion.rows.forEach((i, row) => {
      const joint = motion.joints[i], [, value, degrees] = rows[row].cells;
      value.textContent = `${q[i].toFixed(3)} ${joint.kind === "revolute" ? "rad" : "m"}`;
      degrees.textContent = joint.kind === "revolute" ? `${((q[i] * 180) / Math.PI).toFixed(1)}°` : "";
    });
    if (touched) time.mark(recording.name, origin + instant);
  }

  const ask = () => { if (!asked) { asked = true; requestAnimationFrame(draw); } };
  function go(t) {
    touched = true;
    instant = Math.min(Math.max(t, 0), recording.duration);
    ask();
  }

  function tick(now) {
    if (!playing || !root.isConnected) return;
    const passed = Math.min((now - last) / 1000, 1);
    if (!still.matches || passed >= STEP) {
      last = now;
      const next = instant + passed * Number(choice("speed").value);
      if (next >= recording.duration) run(false);
      go(next);
    }
    requestAnimationFrame(tick);
  }
  function run(on) {
    playing = on;
    play.textContent = on ? "Pause" : "Play";
    play.setAttribute("aria-pressed", on);
    output.setAttribute("aria-live", on ? "off" : "polite");
    if (!on) return;
    if (instant >= recording.duration) instant = 0;
    last = performance.now();
    requestAnimationFrame(tick);
  }

  function look(name) {
    [azimuth, elevation] = VIEWS[name];
    distance = home();
    ask();
  }
  function turn(right, up) {
    azimuth -= right;
    elevation = Math.min(Math.max(elevation + up, -1.5), Math.PI / 2 - 0.01);
    ask();
  }
  function zoom(factor) {
    distance = Math.min(Math.max(distance * factor, 0.8 * reach), 12 * reach);
    ask();
  }

  play.addEventListener("click", () => run(!playing));
  slider.addEventListener("input", () => { run(false); go(slider.valueAsNumber); });
  choice("recording")?.addEventListener("change", (event) => { run(false); choose(event.target.value); go(0); });
  choice("docked").addEventListener("change", (event) => { stage.classList.toggle("docked", event.target.checked); ask(); });
  stage.querySelectorAll("[data-view]").forEach((button) =>
    button.addEventListener("click", () => look(button.dataset.view)));
  stage.querySelectorAll("[data-closer]").forEach((button) =>
    button.addEventListener("click", () => zoom(Number(button.dataset.closer))));

  const KEYS = {
    ArrowLeft: () => turn(0.1, 0), ArrowRight: () => turn(-0.1, 0),
    ArrowUp: () => turn(0, 0.1), ArrowDown: () => turn(0, -0.1),
    "+": () => zoom(0.9), "=": () => zoom(0.9), "-": () => zoom(1.1), " ": () => run(!playing), 0: () => look("oblique"),
  };
  canvas.addEventListener("keydown", (event) => {
    const action = KEYS[event.key];
    if (!action || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    action();
  });
  // A finger turns it sideways only: up and down it scrolls the page.
  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    if (event.buttons) turn(event.movementX * 0.01, event.movementY * 0.01);
  });
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas) return; // until it is selected, the wheel scrolls
    event.preventDefault();
    zoom(event.deltaY > 0 ? 1.08 : 0.93);
  }, { passive: false });

  time.whenClicked((name, t) => {
    const index = motion.recordings.findIndex((own) => own.name === name);
    if (index < 0 || !root.isConnected) return;
    if (motion.recordings[index] !== recording) {
      choose(index);
      choice("recording").value = index;
    }
    run(false);
    go(t - origin);
  });

  function colour() {
    root.querySelectorAll(".swatch").forEach((swatch) => {
      swatch.style.background = `var(--m${motion.rows[swatch.dataset.joint] % {{ method_colours | length }}})`;
    });
    ask();
  }
  theme.follow(() => { if (root.isConnected) { colour(); draw(); } });
  new ResizeObserver(ask).observe(canvas);
  addEventListener("beforeprint", draw);
  choose(0);
  colour();
}
document.querySelectorAll(".replay").forEach(replay);
