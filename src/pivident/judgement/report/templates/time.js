// Figures over the same time show the same window of it, and the same instant.
const time = (() => {
  const groups = new Map(); // by the name of the recording
  const form = document.getElementById("time-window");
  const said = form.querySelector("output");
  let shown; // the group that the form is about

  const groupOf = (plot) => groups.get(plot.dataset.time);
  const start = (plot) => Number(plot.dataset.start);
  const round = (x) => Number(x.toPrecision(6));

  for (const plot of figures.plots) {
    const name = plot.dataset.time;
    if (!name) continue;
    if (!groups.has(name)) groups.set(name, { name, origin: start(plot), plots: [], window: null, instant: null });
    groups.get(name).plots.push(plot);
  }

  const same = (a, b) =>
    a === b || (a && b && Math.abs(a[0] - b[0]) + Math.abs(a[1] - b[1]) < 1e-9 * (1 + Math.abs(a[1])));

  /** Window of time that a figure shows [s, on the recording's clock]; null: all of it. */
  function windowOf(plot) {
    const axis = plot.layout.xaxis;
    return axis.autorange !== false || !axis.range ? null : axis.range.map((x) => Number(x) + start(plot));
  }

  function bring(plot) {
    const group = groupOf(plot);
    if (!group || !figures.isDrawn(plot)) return;
    if (!same(windowOf(plot), group.window)) {
      const change = {};
      if (group.window) {
        change["xaxis.range"] = group.window.map((t) => t - start(plot));
        change["xaxis.autorange"] = false;
      } else {
        for (const key of Object.keys(plot.layout)) if (/^[xy]axis\d*$/.test(key)) change[`${key}.autorange`] = true;
      }
      Plotly.relayout(plot, change);
    }
    point(plot);
  }

  /** Shows a window of time in all figures of a recording; null: all of it. */
  function show(name, window, origin) {
    const group = groups.get(name);
    if (!group || same(window, group.window)) return;
    group.window = window;
    group.origin = origin ?? group.origin; // methods begin at different rows: counted as on the figure
    group.plots.filter((plot) => figures.near.has(plot)).forEach(bring);
    fill(group);
  }

  function fill(group) {
    shown = group;
    form.hidden = !group.window;
    form.querySelector(".name").textContent = group.name;
    if (!group.window) { said.textContent = "The figures show the whole recording."; return; }
    const [from, to] = group.window.map((t) => round(t - group.origin));
    form.elements.from.value = from;
    form.elements.to.value = to;
    said.textContent = `The figures of ${group.name} show ${from} to ${to} s.`;
  }

  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const from = form.elements.from.valueAsNumber, to = form.elements.to.valueAsNumber;
    if (to > from) show(shown.name, [from + shown.origin, to + shown.origin]);
  });
  form.addEventListener("reset", (event) => {
    event.preventDefault();
    show(shown.name, null);
  });

  function point(plot) {
    const { instant } = groupOf(plot);
    markInstant(plot, instant === null ? null : instant - start(plot));
  }

  /** Marks an instant [s, on the recording's clock] in all figures of a recording. */
  function mark(name, instant) {
    const group = groups.get(name);
    if (!group) return;
    group.instant = instant;
    group.plots.filter((plot) => figures.near.has(plot) && figures.isDrawn(plot)).forEach(point);
  }

  const listeners = [];
  figures.whenDrawn((plot) => {
    if (!groupOf(plot)) return;
    plot.on("plotly_relayout", () => {
      // What the reader changed here, the other figures show too.
      if (figures.near.has(plot)) show(plot.dataset.time, windowOf(plot), start(plot));
    });
    plot.on("plotly_afterplot", () => point(plot));
    plot.on("plotly_click", ({ points }) =>
      listeners.forEach((listener) => listener(plot.dataset.time, points[0].x + start(plot))));
  });
  figures.whenNear(bring);

  return {
    groups,
    show,
    mark,
    /** Calls back with recording and instant where a reader clicks on a figure over time. */
    whenClicked: (callback) => listeners.push(callback),
  };
})();
