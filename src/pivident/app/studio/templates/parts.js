// The page follows the project: what has changed on the server is fetched and put in its place.
(() => {
  const project = document.getElementById("project");
  const { address } = project.dataset;
  const pieces = () => [...project.querySelectorAll(".piece")];
  let timer, polling = false, lost = false;

  /** Whether a field says something else than the server has written, which would be lost. */
  function isChanged(field) {
    if (field.type === "file") return field.files.length > 0;
    if (["checkbox", "radio"].includes(field.type)) return field.checked !== field.defaultChecked;
    if (field.tagName === "SELECT") {
      return field.selectedIndex !== Math.max([...field.options].findIndex((option) => option.defaultSelected), 0);
    }
    return field.defaultValue !== undefined && field.value !== field.defaultValue;
  }

  /** Whether somebody is writing in a piece: the focus alone does not keep it as it was. */
  function isEdited(piece) {
    const field = document.activeElement;
    if (!piece.contains(field) || !["INPUT", "TEXTAREA", "SELECT"].includes(field.tagName)) return false;
    const isBox = ["checkbox", "radio"].includes(field.type);
    return [...((isBox && field.form?.elements) || [field])].some(isChanged);
  }

  /** What a reader has opened and chosen, by the words beside it. */
  function summaryOf(details) {
    const summary = details.querySelector("summary");
    const said = (summary?.querySelector("h3") ?? summary)?.textContent.trim().replace(/:.*/s, "");
    return `${details.closest("[id]")?.id}|${said}`;
  }

  async function swap(old, force = false) {
    if (!force && isEdited(old)) return;
    const response = await fetch(`${address}/part/${old.dataset.piece}`);
    if (!response.ok) return;
    const holder = document.createElement("template");
    holder.innerHTML = await response.text();
    const fresh = holder.content.firstElementChild;
    const open = new Map([...old.querySelectorAll("details")].map((details) => [summaryOf(details), details.open]));
    const focused = old.contains(document.activeElement) ? document.activeElement : null;
    const { id, selectionStart } = focused ?? {};
    keepFigures(old, fresh);
    old.replaceWith(fresh);
    for (const details of fresh.querySelectorAll("details")) {
      const before = open.get(summaryOf(details));
      if (before !== undefined) details.open = before;
    }
    if (focused) {
      const again = (id && document.getElementById(id)) || fresh.closest("section");
      if (!again.matches("input, select, textarea, button, a, [tabindex]")) again.setAttribute("tabindex", "-1");
      again.focus({ preventScroll: true });
      try { again.setSelectionRange?.(selectionStart, selectionStart); } catch { /* no text field */ }
    }
    begin(fresh);
  }

  /** While signals are read anew, the old ones stay where they were, so that nothing jumps. */
  function keepFigures(old, fresh) {
    for (const figures of old.querySelectorAll(".group > .beside > .signals")) {
      const place = fresh.querySelector(`#${figures.closest(".group").id} > .beside`);
      if (!place || place.querySelector(".signals")) continue;
      figures.classList.add("stale");
      place.append(figures);
    }
  }

  function begin(piece) {
    piece.querySelectorAll(".replay").forEach(replay);
    if (piece.querySelector("figure.signal")) signals.drawAll();
    note(piece);
  }

  /** What the list of steps and the form of methods show of a piece. */
  function note(piece) {
    const { part, mark: words } = piece.dataset;
    const mark = document.querySelector(`[data-mark="${part}"].mark`);
    if (mark && words !== undefined && words !== "-") {
      mark.textContent = words;
      mark.dataset.kind = words.startsWith("×") ? "bad" : words.startsWith("✓") || words === "ready" ? "good" : "";
    }
    piece.querySelectorAll("form[data-seconds]").forEach(estimate);
  }

  /** The time that the ticked methods take, as the check expects it. */
  function estimate(form) {
    const ticked = [...form.querySelectorAll("[name=method]:checked")];
    const expected = ticked.reduce((sum, { dataset }) => sum + Number(dataset.seconds), Number(form.dataset.seconds));
    const seconds = expected * Number(form.dataset.factor);
    const known = form.dataset.seconds && ticked.length;
    const chosen = ticked.map((box) => box.value).join(", ");
    form.querySelector(".chosen").textContent = chosen || "none";
    const words = seconds < 90 ? `${Math.max(1, Math.round(seconds))} s` : `${Math.round(seconds / 60)} min`;
    form.querySelector("output.time").textContent = known ? `These methods take about ${words}.` : "";
  }

  async function poll(force = false) {
    if (polling) return;
    polling = true;
    clearTimeout(timer);
    let busy = false;
    try {
      const response = await fetch(`${address}/state`);
      const state = await response.json();
      if (!response.ok) throw new Error(state.error);
      if (lost) talk.say("");
      lost = false;
      busy = state.busy;
      if (!busy) document.querySelectorAll(".stale").forEach((figures) => figures.remove());
      for (const piece of pieces()) {
        if (state.keys[piece.dataset.piece] !== piece.dataset.key) await swap(piece, force);
      }
    } catch (error) {
      lost = true;
      talk.say(error instanceof TypeError
        ? "The server does not answer. Runs go on; start pivident studio again and open the address that it prints."
        : String(error.message));
    } finally {
      polling = false;
      timer = setTimeout(poll, document.hidden ? 4000 : busy ? 400 : 1500);
    }
  }

  // What was just done is shown at once, also where its field still has the focus.
  talk.whenAnswered(async (sender, answer) => {
    while (polling) await new Promise((done) => setTimeout(done, 30));
    await poll(answer !== null);
    const run = answer?.run && document.getElementById(`run-of-${answer.run}`);
    if (run) { // results are read where they appear
      run.scrollIntoView({ block: "start" });
      run.querySelector("h3, h4").focus({ preventScroll: true });
    }
  });
  bring.whenBrought(() => poll(true));
  addEventListener("visibilitychange", () => { if (!document.hidden) poll(); });

  // A value that was changed is sent when the reader is done with it.
  addEventListener("change", ({ target }) => {
    if (target.form?.dataset.seconds !== undefined) estimate(target.form);
    const form = target.closest(".row form");
    if (form && target.name === "value") form.requestSubmit();
  });
  addEventListener("click", async (event) => {
    const link = event.target.closest("a[data-row]");
    const row = link && document.getElementById(decodeURIComponent(link.hash.slice(1)));
    if (row) {
      event.preventDefault();
      for (let fold = row.closest("details"); fold; fold = fold.parentElement.closest("details")) fold.open = true;
      row.scrollIntoView({ block: "center" });
      (row.querySelector("[name=value]") ?? row).focus({ preventScroll: true });
    }
    const copy = event.target.closest("[data-copy]");
    if (copy) {
      await navigator.clipboard.writeText(copy.parentElement.querySelector("code, pre").textContent);
      copy.textContent = "Copied";
    }
  });
  addEventListener("submit", (event) => {
    if (event.target.dataset.download === undefined) return;
    event.preventDefault();
    const query = new URLSearchParams(new FormData(event.target));
    location.assign(`${event.target.action}?${query}`);
  });

  pieces().forEach(note);
  poll();
})();
