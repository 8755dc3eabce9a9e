// Signals of the log, as many points as the picture has: what is zoomed into is fetched anew.
const signals = (() => {
  const address = document.getElementById("project").dataset.address;
  const COLOURS = {{ method_colours | length }};
  const HEIGHT = 220, ROW = 20, MARK = 48, LETTER = 7; // of a figure, of a legend: row, line, letter [px]
  const WAIT = 120; // until a window that is being drawn is final [ms]
  let shown = null; // window of time that all signals show [s from the start]; null: all of it
  let recording = 0;
  let instant = null;

  const figures = () => [...document.querySelectorAll("figure.signal")];
  const contentOf = (figure) => JSON.parse(figure.dataset.signals);
  const plotOf = (figure) => figure.querySelector(".plot");

  async function fetched(figure) {
    const content = contentOf(figure);
    const own = content.recordings[recording] ?? content.recordings[0];
    const query = new URLSearchParams({
      recording: own.number,
      channel: content.channel,
      joints: content.joints.map((_, j) => j).join(","),
      points: Math.max(300, Math.round(1.5 * plotOf(figure).clientWidth)),
    });
    if (shown) {
      query.set("from", shown[0] + own.start);
      query.set("to", shown[1] + own.start);
    }
    const response = await fetch(`${address}/window?${query}`);
    const data = response.ok ? await response.json() : null;
    return data && { content, own, data };
  }

  /** Rows that the names of joints take above a figure. */
  function legendRows(joints, width) {
    const needed = joints.reduce((sum, { name }) => sum + MARK + LETTER * name.length, 0);
    return joints.length > 1 ? Math.ceil(needed / width) : 0;
  }

  async function draw(figure) {
    if (!window.Plotly || !figure.isConnected) return;
    const found = await fetched(figure);
    if (!found || !figure.isConnected) return;
    const { content, own, data } = found;
    const colour = (name) => theme.variable(name);
    const traces = content.joints.map((joint, j) => ({
      type: "scatter",
      mode: "lines",
      name: joint.name,
      x: data.t[j].map((t) => t - own.start),
      y: data.y[j],
      visible: figure.dataset.hidden?.split(",").includes(String(j)) ? "legendonly" : true,
      line: { width: 1.2, color: colour(`--m${j % COLOURS}`) },
      hovertemplate: `%{y:.5g} ${joint.unit}<extra>${joint.name}</extra>`,
    }));
    const units = [...new Set(content.joints.map((joint) => joint.unit))].join(", ");
    const axis = { gridcolor: colour("--grid"), zerolinecolor: colour("--line"), linecolor: colour("--line") };
    const layout = {
      margin: { l: 58, r: 8, t: 6, b: 34 },
      showlegend: content.joints.length > 1,
      legend: { orientation: "h", y: 1.02, yanchor: "bottom" },
      font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: colour("--soft") },
      paper_bgcolor: "rgba(0,0,0,0)",
      plot_bgcolor: "rgba(0,0,0,0)",
      hovermode: "closest",
      xaxis: { ...axis, title: { text: "time [s]", standoff: 4 }, range: shown ?? [0, own.duration] },
      yaxis: { ...axis, title: { text: units ? `[${units}]` : "" }, automargin: true },
    };
    const plot = plotOf(figure);
    const first = !plot.dataset.drawn;
    plot.style.height = `${HEIGHT + ROW * legendRows(content.joints, plot.clientWidth)}px`;
    plot.dataset.drawn = "yes";
    figure.dataset.drawing = "yes";
    await Plotly.react(plot, traces, layout, { responsive: true, displaylogo: false, displayModeBar: false });
    delete figure.dataset.drawing;
    if (first) listen(figure, plot);
    point(figure);
  }

  function listen(figure, plot) {
    let timer;
    plot.on("plotly_relayout", (change) => {
      if (figure.dataset.drawing) return;
      const range = change["xaxis.range"] ?? (change["xaxis.range[0]"] === undefined ? null : [change["xaxis.range[0]"], change["xaxis.range[1]"]]);
      if (!range && change["xaxis.autorange"] === undefined) return;
      clearTimeout(timer);
      timer = setTimeout(() => show(range ? range.map(Number) : null), WAIT);
    });
    plot.on("plotly_click", ({ points }) => {
      const own = contentOf(figure).recordings[recording];
      callers.forEach((caller) => caller(own.name, points[0].x + own.start));
    });
    plot.on("plotly_restyle", () => {
      figure.dataset.hidden = plot.data.flatMap((trace, j) => (trace.visible === "legendonly" ? [j] : [])).join(",");
    });
  }

  function show(range) {
    shown = range;
    drawAll();
  }
  const drawAll = () => figures().forEach((figure) => {
    if (near.has(figure)) draw(figure);
    else observer.observe(figure);
  });

  // Only what is near the window is fetched and drawn.
  const near = new Set();
  const observer = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) {
      if (!isIntersecting) near.delete(target);
      else if (!near.has(target)) {
        near.add(target);
        draw(target);
      }
    }
  }, { rootMargin: "300px" });

  const point = (figure) => markInstant(plotOf(figure), instant);

  const callers = [];
  addEventListener("load", drawAll);
  theme.follow(drawAll);

  return {
    drawAll,
    /** Shows an instant of a recording [s, on its clock] in all figures. */
    mark(name, t) {
      const content = figures().length ? contentOf(figures()[0]) : null;
      const index = content?.recordings.findIndex((own) => own.name === name) ?? -1;
      if (index < 0) return;
      instant = t - content.recordings[index].start;
      if (index !== recording) {
        recording = index;
        shown = null;
        drawAll();
      } else figures().filter((figure) => near.has(figure)).forEach(point);
    },
    whenClicked: (caller) => callers.push(caller),
  };
})();

// What the moving arm asks of figures over time.
const time = { mark: signals.mark, whenClicked: signals.whenClicked };
