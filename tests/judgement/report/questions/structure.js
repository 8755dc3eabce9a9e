// Words, names and order: what assistive technology is told.
const all = (selector) => [...document.querySelectorAll(selector)];
await drawAll();
const levels = all("h1, h2, h3, h4, h5, h6").map((heading) => Number(heading.tagName[1]));
const named = (element) => element.getAttribute("aria-label") || element.getAttribute("aria-labelledby") ||
  element.labels?.length || element.textContent.trim();
const files = [];
for (const link of all("a[download]")) {
  const text = await (await fetch(link.href)).text();
  files.push([link.download, text.length, text.slice(0, 60)]);
}
return {
  plots: plots().length,
  drawn: plots().filter(drawn).length,
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
