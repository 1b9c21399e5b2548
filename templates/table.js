// Filter and sort the tables of this page. Everything stands in the page without it.
"use strict";
for (const table of document.querySelectorAll("table.sortable")) {
  const body = table.tBodies[0];
  const rows = [...body.rows];
  const heads = [...table.tHead.rows[0].cells];
  const make = (name, text, parent) => {
    const made = document.createElement(name);
    made.textContent = text;
    parent.append(made);
    return made;
  };
  const bar = document.createElement("p");
  bar.className = "filter";
  const words = make("label", "Show rows with ", bar).appendChild(document.createElement("input"));
  words.type = "search";
  const verdict = make("label", "Verdict ", bar).appendChild(document.createElement("select"));
  const verdicts = new Set(rows.map(row => row.dataset.verdict).filter(Boolean));
  for (const each of ["", ...verdicts]) make("option", each || "any", verdict).value = each;
  const count = make("output", "", bar);
  const show = () => {
    const wanted = words.value.toLowerCase().split(/\s+/);
    let shown = 0;
    for (const row of rows) {
      const text = row.textContent.toLowerCase();
      const fits = wanted.every(word => text.includes(word));
      row.hidden = !fits || (verdict.value && row.dataset.verdict !== verdict.value);
      shown += !row.hidden;
    }
    count.textContent = `${shown} of ${rows.length} rows`;
  };
  words.addEventListener("input", show);
  verdict.addEventListener("input", show);
  show();
  (table.closest(".scroll") || table).before(bar);
  const key = (row, k) => {
    const text = row.cells[k].textContent.trim().replace(/\u2212/g, "-");
    const number = /^[<>+-]?\s*[\d.]+(?![\w-])/.test(text) ? parseFloat(text.replace(/^[<>]\s*/, "")) : NaN;
    return text === "" || text === "–" ? null : Number.isNaN(number) ? text : number;
  };
  heads.forEach((head, k) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      for (const each of heads) each.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const keyed = rows.map(row => [key(row, k), row]);
      keyed.sort(([a], [b]) => {
        if (a === null || b === null) return (a === null) - (b === null);
        const order = typeof a === "number" && typeof b === "number"
          ? a - b : String(a).localeCompare(String(b), "en", {numeric: true});
        return down ? -order : order;
      });
      body.append(...keyed.map(([, row]) => row));
    });
  });
}
