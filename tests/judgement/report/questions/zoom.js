// Tools above a figure: closer, wider, sideways, all of it, and an image, without a mouse.
const found = {};
for (const name of SECTIONS) {
  const plot = [...document.querySelectorAll(`#${name} .plot`)].find((own) => own.checkVisibility());
  plot.scrollIntoView({ block: "center", behavior: "instant" });
  await wait(300);
  const tools = plot.closest("figure").querySelector(".figure-tools");
  const [toggle, closer, wider, left, right, all] = tools.querySelectorAll("button");
  const span = () => ["xaxis", "yaxis"].map((key) => [...plot._fullLayout[key].range].map(Number));
  const own = { hidden: closer.hidden, spans: [span()] };
  toggle.click();
  await wait(50);
  own.shown = !closer.hidden && plot._fullLayout.dragmode === "zoom";
  for (const button of [closer, right, left, wider, all]) {
    button.click();
    await wait(80);
    own.spans.push(span());
  }
  toggle.click();
  own.closed = closer.hidden && toggle.getAttribute("aria-pressed") === "false";
  found[name] = own;
}
let saved;
const click = HTMLAnchorElement.prototype.click;
HTMLAnchorElement.prototype.click = function () { saved = [this.download, this.href.slice(0, 5)]; };
document.querySelector("#torque .figure-tools button:last-child").click();
for (let k = 0; k < 40 && !saved; k += 1) await wait(100);
HTMLAnchorElement.prototype.click = click;
return { found, saved };
