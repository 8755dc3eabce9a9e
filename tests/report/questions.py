"""Scripts that a test runs in a page: what a reader with a keyboard, or with weak eyes, would ask."""

#: Texts whose contrast with their background is too low, in both themes: WCAG 2.2, 1.4.3.
CONTRAST = """
const numbers = (colour) => {
  const found = colour.match(/[\\d.]+/g).map(Number);
  return found.length < 4 ? [...found.slice(0, 3), 1] : found;
};
const over = ([r, g, b, a], under) => [r, g, b].map((x, k) => a * x + (1 - a) * under[k]);
function background(element) {
  const layers = [];
  for (let own = element; own; own = own.parentElement) {
    const colour = numbers(getComputedStyle(own).backgroundColor);
    layers.unshift(colour);
  }
  return layers.reduce((under, colour) => over(colour, under), [255, 255, 255]);
}
const luminance = (rgb) => {
  const [r, g, b] = rgb.map((x) => (x /= 255) <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
};
const low = new Set();
let texts = 0;
dispatchEvent(new Event("beforeprint"));
dispatchEvent(new Event("afterprint"));
document.querySelectorAll("details").forEach((part) => { part.open = true; });
for (const theme of ["light", "dark"]) {
  document.querySelector(`[data-theme-choice=${theme}]`).click();
  await wait(600);
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const element = walker.currentNode.parentElement;
    if (!walker.currentNode.data.trim() || element.closest("script, noscript, style, .heatmap-label")) continue;
    if (!element.checkVisibility({ visibilityProperty: true, opacityProperty: true })) continue;
    const style = getComputedStyle(element);
    const drawn = element.closest("svg");
    const under = background(drawn ?? element);
    const ink = over(numbers(drawn ? style.fill : style.color), under);
    const [light, dark] = [luminance(ink), luminance(under)].sort((a, b) => b - a);
    const ratio = (light + 0.05) / (dark + 0.05);
    const size = parseFloat(style.fontSize), bold = Number(style.fontWeight) >= 700;
    texts += 1;
    if (ratio < (size >= 24 || (bold && size >= 18.66) ? 3 : 4.5))
      low.add(`${theme} ${element.tagName}.${element.className?.baseVal ?? element.className} ` +
        `"${walker.currentNode.data.trim().slice(0, 30)}" ${ratio.toFixed(2)}`);
  }
}
return { texts, low: [...low] };
"""

#: Words, names and order: what assistive technology is told.
STRUCTURE = """
const all = (selector) => [...document.querySelectorAll(selector)];
dispatchEvent(new Event("beforeprint"));
dispatchEvent(new Event("afterprint"));
await wait(500);
const levels = all("h1, h2, h3, h4, h5, h6").map((heading) => Number(heading.tagName[1]));
const named = (element) => element.getAttribute("aria-label") || element.getAttribute("aria-labelledby") ||
  element.labels?.length || element.textContent.trim();
const files = [];
for (const link of all("a[download]")) {
  const text = await (await fetch(link.href)).text();
  files.push([link.download, text.length, text.slice(0, 60)]);
}
return {
  plots: all(".plot").length,
  drawn: all(".plot").filter((plot) => plot.querySelector("svg.main-svg .trace path, svg.main-svg .hm image")).length,
  jumps: levels.filter((level, k) => level > (levels[k - 1] ?? 0) + 1).length,
  titles: levels.filter((level) => level === 1).length,
  dead: all("a[href^='#']").filter((a) => !document.getElementById(a.hash.slice(1))).map((a) => a.hash),
  silent: all("[role=img], [role=application], svg.intervals, canvas").filter((own) =>
    !own.closest(".plot > *") && (own.getAttribute("aria-label") ?? "").length < 5).map((own) => own.outerHTML.slice(0, 80)),
  nameless: all("button, input, select, nav, [role=region], [role=group]").filter((own) =>
    !own.closest(".plot") && !named(own)).map((own) => own.outerHTML.slice(0, 80)),
  unscoped: all("th:not([scope])").map((th) => th.outerHTML),
  doubled: all("[id]").map((own) => own.id).filter((id, k, ids) => ids.indexOf(id) !== k && !document.getElementById(id).closest(".plot")),
  landmarks: [all("header.page").length, all("main").length, all("nav").length, all("footer").length],
  cloud: all("[data-title*=loud], [data-title*=hare]").length,
  first: all("a, button, input, [tabindex]")[0].className,
  files,
};
"""

#: A window of time and an instant, carried from one figure to all others and back.
TIME = """
const plots = [...document.querySelectorAll("#torque .plot, #signals .plot")];
dispatchEvent(new Event("beforeprint"));
dispatchEvent(new Event("afterprint"));
document.querySelectorAll("details").forEach((part) => { part.open = true; });
const range = (plot) => plot.layout.xaxis.range.map((x) => Number((Number(x) + Number(plot.dataset.start)).toFixed(3)));
const near = async (plot) => { plot.scrollIntoView({ block: "center", behavior: "instant" }); await wait(400); };
const form = document.getElementById("time-window");
const found = { plots: plots.length, before: form.hidden };
await near(plots[0]);
await Plotly.relayout(plots[0], { "xaxis.range": [0.2, 0.7] });
found.wanted = range(plots[0]);
found.shown = [];
for (const plot of plots) { await near(plot); found.shown.push(range(plot)); }
found.open = !form.hidden;
found.from = form.elements.from.value;
form.elements.from.value = 0.4;
form.requestSubmit();
await wait(100);
found.narrower = range(plots.at(-1));
form.querySelector("[type=reset]").click();
found.back = [];
for (const plot of plots) { await near(plot); found.back.push(plot.layout.xaxis.autorange); }
found.after = form.hidden;
const slider = document.querySelector(".replay input[type=range]");
slider.value = 1.2;
slider.dispatchEvent(new Event("input"));
await near(plots[0]);
const line = plots[0].querySelector(".instant");
const axis = plots[0]._fullLayout.xaxis;
found.instant = axis.p2d(new DOMMatrix(getComputedStyle(line).transform).m41 - axis._offset);
plots[0].emit("plotly_click", { points: [{ x: 0.5 }] });
await wait(200);
found.clicked = Number(document.querySelector(".replay canvas").dataset.instant);
return found;
"""

#: The moving picture: drawn, turned and played from the keyboard, readable without seeing it.
REPLAY = """
const canvas = document.querySelector(".replay canvas");
canvas.scrollIntoView({ behavior: "instant" });
await wait(300);
const inked = () => {
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  let sum = 0, count = 0;
  for (let k = 0; k < data.length; k += 4) if (data[k + 3]) { count += 1; sum += (k % 9973) * data[k] + data[k + 2]; }
  return [count, sum];
};
const press = async (key) => {
  canvas.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));
  await wait(150);
};
const found = { pictures: [inked()], posture: [] };
const cells = () => [...document.querySelectorAll(".replay .posture tbody tr")].map((row) => row.cells[1].textContent);
found.posture.push(cells());
await press("ArrowLeft");
found.pictures.push(inked());
await press("+");
found.pictures.push(inked());
await press(" ");
found.playing = document.querySelector(".play").textContent;
await wait(500);
await press(" ");
found.paused = document.querySelector(".play").textContent;
found.moved = Number(canvas.dataset.instant);
found.pictures.push(inked());
found.posture.push(cells());
found.said = document.querySelector(".replay output").textContent;
return found;
"""

#: A table sorted and filtered with nothing but buttons and a field.
TABLES = """
const table = [...document.querySelectorAll("#parameters table.sortable")].at(-1);
const filter = table.closest(".scroll").previousElementSibling;
const heads = [...table.tHead.rows[0].cells];
const column = (words) => heads.findIndex((head) => head.textContent.trim() === words);
const values = (k) => [...table.tBodies[0].rows].filter((row) => !row.hidden).map((row) => Number(row.cells[k].dataset.value));
const names = () => [...table.tBodies[0].rows].filter((row) => !row.hidden).map((row) => row.cells[0].textContent);
const found = { original: names() };
const button = heads[column("Value")].querySelector("button");
button.focus();
found.focused = document.activeElement === button;
button.click();
found.up = values(column("Value"));
found.sort = heads[column("Value")].getAttribute("aria-sort");
button.click();
found.down = values(column("Value"));
button.click();
found.again = names();
const field = filter.querySelector("input");
field.value = "fv";
field.dispatchEvent(new Event("input"));
found.filtered = names();
found.count = filter.querySelector("output").textContent;
return found;
"""
