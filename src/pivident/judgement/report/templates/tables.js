// Tables that can be sorted by any column and filtered by words, with buttons and a search field.
(() => {
  for (const table of document.querySelectorAll("table.sortable")) {
    const body = table.tBodies[0];
    const rows = [...body.rows];
    const heads = columnHeads(table.tHead);

    for (const [column, head] of heads) {
      const button = document.createElement("button");
      button.type = "button";
      button.className = "sort";
      button.append(...head.childNodes);
      head.append(button);
      button.addEventListener("click", () => sort(column, head));
    }

    // Once ascending, once descending, then as it was.
    function sort(column, head) {
      const before = head.getAttribute("aria-sort");
      const now = before === "ascending" ? "descending" : before === "descending" ? null : "ascending";
      for (const [, other] of heads) other.removeAttribute("aria-sort");
      if (now) head.setAttribute("aria-sort", now);
      const sign = now === "descending" ? -1 : 1;
      const sorted = now ? [...rows].sort((a, b) => compare(key(a, column), key(b, column), sign)) : rows;
      body.append(...sorted);
    }

    if (rows.length < 8) continue;
    const label = document.createElement("label");
    label.className = "filter";
    const field = document.createElement("input");
    field.type = "search";
    field.autocomplete = "off";
    const count = document.createElement("output");
    count.setAttribute("aria-live", "polite");
    label.append("Show rows with ", field, count);
    table.closest(".scroll").before(label);
    field.addEventListener("input", () => {
      const words = field.value.toLowerCase().split(/\s+/).filter(Boolean);
      for (const row of rows) {
        const text = row.textContent.toLowerCase();
        row.hidden = !words.every((word) => text.includes(word));
      }
      const shown = rows.filter((row) => !row.hidden).length;
      count.textContent = words.length ? ` ${shown} of ${rows.length}` : "";
    });
  }

  /** Column and heading of each heading over one column, whatever spans rows or columns. */
  function columnHeads(head) {
    const taken = new Set();
    const found = [];
    [...head.rows].forEach((row, r) => {
      let column = 0;
      for (const cell of row.cells) {
        while (taken.has(`${r},${column}`)) column += 1;
        for (let i = 0; i < cell.rowSpan; i += 1)
          for (let j = 0; j < cell.colSpan; j += 1) taken.add(`${r + i},${column + j}`);
        if (cell.colSpan === 1 && !cell.classList.contains("drawing")) found.push([column, cell]);
        column += cell.colSpan;
      }
    });
    return found;
  }

  /** What a cell sorts by: its number where it has one, its words otherwise. */
  function key(row, column) {
    let at = 0;
    for (const cell of row.cells) {
      if (column < at + cell.colSpan) {
        if (cell.dataset.value !== undefined) return cell.dataset.value === "" ? NaN : Number(cell.dataset.value);
        const text = cell.textContent.trim();
        const number = Number(text.replace(/\s*(%|σ).*$/s, ""));
        return text && !Number.isNaN(number) ? number : text;
      }
      at += cell.colSpan;
    }
    return "";
  }

  /** Numbers by size, then words by the alphabet; what is missing comes last either way. */
  function compare(a, b, sign) {
    const missing = (x) => (Number.isNaN(x) || x === "" || x === "–" ? 1 : 0);
    if (missing(a) || missing(b)) return missing(a) - missing(b);
    if (typeof a === "number" && typeof b === "number") return sign * (a - b);
    return sign * String(a).localeCompare(String(b), "en", { numeric: true });
  }
})();
