// Figures are drawn when they come near the window, so that long reports open at once.
const figures = (() => {
  const PAPER = 325; // width of a printed figure [px]: two beside each other on A4 and letter
  const touch = matchMedia("(pointer: coarse)");
  const plots = [...document.querySelectorAll(".plot")];
  const near = new Set();
  const drawers = [];
  const dark = {{ dark_colours | tojson }};

  function load() {
    // Five megabytes of script are unpacked and compiled when the first figure wants them, not before.
    const source = document.getElementById("plotly");
    if (source.dataset.loaded) return;
    source.dataset.loaded = "yes";
    const script = document.createElement("script");
    const packed = Uint8Array.from(atob(source.textContent), (letter) => letter.charCodeAt(0));
    script.textContent = new TextDecoder().decode(inflate(packed, Number(source.dataset.size)));
    document.head.append(script);
  }

  // Figures are written in the colours of the light page.
  const recoloured = (text) =>
    theme.isDark() ? text.replace(/#[0-9a-f]{6}/g, (colour) => dark[colour] ?? colour) : text;

  function themed(layout, plot) {
    const font = { family: getComputedStyle(document.body).fontFamily, size: 12, color: theme.variable("--soft") };
    const axis = { gridcolor: theme.variable("--grid"), zerolinecolor: theme.variable("--line"), linecolor: theme.variable("--line") };
    const look = {
      font,
      uirevision: "kept",
      paper_bgcolor: "rgba(0,0,0,0)",
      plot_bgcolor: "rgba(0,0,0,0)",
      hoverlabel: { bgcolor: theme.variable("--panel"), bordercolor: theme.variable("--edge"), font: { color: theme.variable("--ink") } },
    };
    for (const key of Object.keys(layout)) {
      if (/^[xy]axis\d*$/.test(key)) look[key] = { ...layout[key], ...axis };
    }
    if (!draggable(plot)) look.dragmode = false;
    return { ...layout, ...look };
  }

  // A finger that meets a figure scrolls the page, until the reader asks to zoom.
  const draggable = (plot) => !touch.matches || plot.dataset.zoom === "on";

  function draw(plot) {
    load();
    const { data, layout } = JSON.parse(recoloured(plot.nextElementSibling.textContent));
    const first = !plot.dataset.drawn;
    plot.dataset.drawn = "yes";
    const done = Plotly.react(plot, data, themed(layout, plot), {
      responsive: true,
      displaylogo: false,
      // Its icons lie over curves and legends, and no key reaches them; tools stand above the figure.
      displayModeBar: false,
    });
    if (first) drawers.forEach((drawer) => drawer(plot));
    return done;
  }

  const isDrawn = (plot) => plot.dataset.drawn === "yes";
  const comers = [];
  const observer = new IntersectionObserver(
    (entries) => {
      for (const { isIntersecting, target } of entries) {
        if (!isIntersecting) near.delete(target);
        else {
          near.add(target);
          if (!isDrawn(target)) draw(target);
          bring(target);
        }
      }
    },
    { rootMargin: "400px" },
  );
  // The page itself is painted first; then the script is made ready while the reader reads.
  const watch = () => plots.forEach((plot) => observer.observe(plot));
  requestAnimationFrame(() => setTimeout(watch));
  const idle = window.requestIdleCallback ?? setTimeout;
  if (plots.length) addEventListener("load", () => idle(load));

  const bring = (plot) => comers.forEach((comer) => comer(plot));
  theme.follow(() => {
    for (const plot of plots.filter(isDrawn)) {
      draw(plot);
      if (near.has(plot)) bring(plot);
    }
  });

  let folded = [];
  addEventListener("beforeprint", () => {
    folded = [...document.querySelectorAll("details:not([open])")];
    folded.forEach((part) => { part.open = true; });
    plots.filter((plot) => !isDrawn(plot)).forEach(draw);
    plots.forEach(bring);
    // A printed page is narrower than the window that was drawn for.
    plots.forEach((plot) => Plotly.relayout(plot, { width: PAPER, autosize: false }));
  });
  addEventListener("afterprint", () => {
    folded.forEach((part) => { part.open = false; });
    plots.filter(isDrawn).forEach((plot) => {
      if (!plot.layout.width) return;
      Plotly.relayout(plot, { width: null, autosize: true });
    });
  });

  return {
    plots,
    isDrawn,
    near,
    /** Lets a finger draw the window to zoom into, or scroll the page again. */
    zooming: (plot, on) => {
      plot.dataset.zoom = on ? "on" : "off";
      if (isDrawn(plot)) Plotly.relayout(plot, { dragmode: draggable(plot) ? "zoom" : false });
    },
    /** Calls back with each figure after its first drawing. */
    whenDrawn: (callback) => drawers.push(callback),
    /** Calls back with each figure that comes near the window. */
    whenNear: (callback) => comers.push(callback),
  };
})();
