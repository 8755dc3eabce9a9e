// A window of time and an instant, carried from one figure to all others and back.
const own = [...document.querySelectorAll("#torque .plot, #signals .plot")];
await drawAll();
document.querySelectorAll("details").forEach((part) => { part.open = true; });
const range = (plot) => plot.layout.xaxis.range.map((x) => Number((Number(x) + Number(plot.dataset.start)).toFixed(3)));
const near = async (plot) => { plot.scrollIntoView({ block: "center", behavior: "instant" }); await wait(120); };
const form = document.getElementById("time-window");
const found = { plots: own.length, before: form.hidden };
await near(own[0]);
await Plotly.relayout(own[0], { "xaxis.range": [0.2, 0.7] });
found.wanted = range(own[0]);
found.shown = [];
for (const plot of own) { await near(plot); found.shown.push(range(plot)); }
found.open = !form.hidden;
found.from = form.elements.from.value;
form.elements.from.value = 0.4;
form.requestSubmit();
await wait(100);
found.narrower = range(own.at(-1));
form.querySelector("[type=reset]").click();
found.back = [];
for (const plot of own) { await near(plot); found.back.push(plot.layout.xaxis.autorange); }
found.after = form.hidden;
const slider = document.querySelector(".replay input[type=range]");
slider.value = 1.2;
slider.dispatchEvent(new Event("input"));
await near(own[0]);
const line = own[0].querySelector(".instant");
const axis = own[0]._fullLayout.xaxis;
found.instant = axis.p2d(new DOMMatrix(getComputedStyle(line).transform).m41 - axis._offset);
own[0].emit("plotly_click", { points: [{ x: 0.5 }] });
await wait(200);
found.clicked = Number(document.querySelector(".replay canvas").dataset.instant);
return found;
