// Texts whose contrast with their background is too low, in both themes: WCAG 2.2, 1.4.3.
const numbers = (colour) => {
  const found = colour.match(/[\d.]+/g).map(Number);
  return found.length < 4 ? [...found.slice(0, 3), 1] : found;
};
const over = ([r, g, b, a], under) => [r, g, b].map((x, k) => a * x + (1 - a) * under[k]);
const WHITE = [255, 255, 255];
const backgrounds = new Map();
function background(element) {
  if (!element) return WHITE;
  if (!backgrounds.has(element)) {
    const own = numbers(getComputedStyle(element).backgroundColor);
    backgrounds.set(element, over(own, background(element.parentElement)));
  }
  return backgrounds.get(element);
}
const luminance = (rgb) => {
  const [r, g, b] = rgb.map((x) => (x /= 255) <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
};
const low = new Set();
let texts = 0;
document.querySelector("[data-theme-choice=light]").click();
await drawAll();
document.querySelectorAll("details").forEach((part) => { part.open = true; });
for (const theme of ["light", "dark"]) {
  if (theme === "dark") document.querySelector("[data-theme-choice=dark]").click();
  await wait(600);
  backgrounds.clear();
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const element = walker.currentNode.parentElement;
    if (!walker.currentNode.data.trim() || element.closest("script, noscript, style, .heatmap-label")) continue;
    if (!element.checkVisibility({ visibilityProperty: true, opacityProperty: true })) continue;
    const style = getComputedStyle(element);
    const figure = element.closest("svg");
    const under = background(figure ?? element);
    const ink = over(numbers(figure ? style.fill : style.color), under);
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
