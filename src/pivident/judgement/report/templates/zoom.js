// Tools of a figure: a button opens others that zoom and save, for fingers and for the keyboard.
(() => {
  const ACTIONS = [
    ["+", "Closer", (a, b) => [a + 0.25 * (b - a), b - 0.25 * (b - a)]],
    ["−", "Wider", (a, b) => [a - 0.5 * (b - a), b + 0.5 * (b - a)]],
    ["←", "To the left", (a, b) => [a - 0.25 * (b - a), b - 0.25 * (b - a)]],
    ["→", "To the right", (a, b) => [a + 0.25 * (b - a), b + 0.25 * (b - a)]],
    ["All", "All of the figure", null],
  ];

  const axesOf = (plot) => Object.keys(plot._fullLayout).filter((key) => /^[xy]axis\d*$/.test(key));

  /** Axes that the buttons move: along the figure, and across it too where both are alike. */
  function moved(plot, sideways) {
    const axes = axesOf(plot);
    const alike = axes.map((key) => plot._fullLayout[key]).some((axis) => axis.type === "category" || axis.scaleanchor);
    return axes.filter((key) => key.startsWith("x") || (alike && !sideways));
  }

  function change(plot, range, sideways) {
    const wanted = {};
    if (range) {
      for (const key of moved(plot, sideways)) {
        wanted[`${key}.range`] = range(...plot._fullLayout[key].range.map(Number));
        wanted[`${key}.autorange`] = false;
      }
    } else {
      const { layout } = JSON.parse(plot.nextElementSibling.textContent); // as it was written
      for (const key of axesOf(plot)) {
        const { range: written, autorange } = layout[key] ?? {};
        if (written) wanted[`${key}.range`] = written;
        else wanted[`${key}.autorange`] = autorange ?? true;
      }
    }
    Plotly.relayout(plot, wanted);
  }

  /** Saves a figure as it is shown, on the colour of the page. */
  function save(plot, name) {
    const { data, layout, clientWidth: width, clientHeight: height } = plot;
    const paper = theme.variable("--paper");
    const picture = { data, layout: { ...layout, title: { text: "" }, paper_bgcolor: paper } };
    return Plotly.downloadImage(picture, { format: "png", scale: 2, width, height, filename: name });
  }

  function button(words, label) {
    const made = document.createElement("button");
    made.type = "button";
    made.textContent = words;
    if (label) made.setAttribute("aria-label", label);
    return made;
  }

  figures.plots.forEach((plot) => {
    const title = plot.previousElementSibling;
    if (!title?.classList.contains("figure-title")) return;
    const tools = document.createElement("div");
    tools.className = "figure-tools";
    tools.setAttribute("role", "group");
    tools.setAttribute("aria-label", `Zoom into ${title.textContent}`);
    const toggle = button("Zoom");
    toggle.setAttribute("aria-pressed", "false");
    const others = ACTIONS.map(([words, label, range], index) => {
      const made = button(words, label);
      made.addEventListener("click", () => change(plot, range, index === 2 || index === 3));
      return made;
    });
    const picture = button("Image", `Save ${title.textContent} as an image`);
    const name = `${plot.closest("section").id} ${title.textContent}`.replace(/[^\p{L}\p{N}]+/gu, "_");
    picture.addEventListener("click", () => save(plot, name));
    others.push(picture);
    others.forEach((other) => { other.hidden = true; });
    toggle.addEventListener("click", () => {
      const on = toggle.getAttribute("aria-pressed") !== "true";
      toggle.setAttribute("aria-pressed", on);
      others.forEach((other) => { other.hidden = !on; });
      figures.zooming(plot, on);
    });
    tools.append(toggle, ...others);
    const head = document.createElement("div");
    head.className = "figure-head";
    title.before(head);
    head.append(title, tools);
  });
})();
