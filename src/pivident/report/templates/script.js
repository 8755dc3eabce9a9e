"use strict";
(() => {
  // Figures are drawn when they come near the window, so that long reports open at once.
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const touch = matchMedia("(pointer: coarse)");
  const variable = (name) =>
    getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  function themed(layout) {
    const font = { family: getComputedStyle(document.body).fontFamily, size: 12, color: variable("--soft") };
    const axis = { gridcolor: variable("--grid"), zerolinecolor: variable("--line"), linecolor: variable("--line") };
    const look = {
      font,
      paper_bgcolor: "rgba(0,0,0,0)",
      plot_bgcolor: "rgba(0,0,0,0)",
      modebar: { bgcolor: "rgba(0,0,0,0)", color: variable("--line"), activecolor: variable("--soft") },
      hoverlabel: { bgcolor: variable("--panel"), font: { color: variable("--ink") } },
    };
    for (const key of Object.keys(layout)) {
      if (/^[xy]axis\d*$/.test(key)) look[key] = { ...layout[key], ...axis };
    }
    // A finger that meets a figure scrolls the page.
    if (touch.matches) look.dragmode = false;
    return { ...layout, ...look };
  }

  function draw(plot) {
    const { data, layout } = JSON.parse(plot.nextElementSibling.textContent);
    plot.dataset.drawn = "yes";
    return Plotly.react(plot, data, themed(layout), {
      responsive: true,
      displaylogo: false,
      displayModeBar: touch.matches ? false : "hover",
      modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"],
    });
  }

  const plots = [...document.querySelectorAll(".plot")];
  const waiting = () => plots.filter((plot) => !plot.dataset.drawn);
  const observer = new IntersectionObserver(
    (entries) => {
      for (const { isIntersecting, target } of entries) {
        if (isIntersecting) {
          observer.unobserve(target);
          draw(target);
        }
      }
    },
    { rootMargin: "600px" },
  );
  plots.forEach((plot) => observer.observe(plot));

  dark.addEventListener("change", () => plots.filter((plot) => plot.dataset.drawn).forEach(draw));
  addEventListener("beforeprint", () => {
    document.querySelectorAll("details").forEach((part) => { part.open = true; });
    waiting().forEach(draw);
  });
})();
