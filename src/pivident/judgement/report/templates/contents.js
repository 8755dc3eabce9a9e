// The list of contents marks the section that is being read.
(() => {
  const list = document.querySelector("nav.contents details");
  const narrow = matchMedia("(max-width: 1080px)");
  const links = new Map([...list.querySelectorAll("a")].map((link) => [link.hash.slice(1), link]));
  const sections = [...document.querySelectorAll("main section[id]")];

  // Narrow windows have it folded; following a link folds it again.
  const fold = () => { list.open = !narrow.matches; };
  narrow.addEventListener("change", fold);
  list.addEventListener("click", (event) => { if (event.target.closest("a")) fold(); });
  fold();

  function follow() {
    const line = innerHeight / 3;
    const current = sections.findLast((section) => section.getBoundingClientRect().top <= line) ?? sections[0];
    for (const [id, link] of links) {
      if (id === current?.id) link.setAttribute("aria-current", "location");
      else link.removeAttribute("aria-current");
    }
  }

  let asked = false;
  addEventListener("scroll", () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => { asked = false; follow(); });
  }, { passive: true });
  follow();

  // A link into a folded part unfolds it.
  const unfold = () => {
    const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    for (let part = target; part; part = part.parentElement) if (part.tagName === "DETAILS") part.open = true;
  };
  addEventListener("hashchange", unfold);
  unfold();
})();
