// Tables that are sorted by a click on a title and filtered by words.

// What a cell is sorted by: its first number, else its text.
function keyOf(row, column) {
  const text = row.cells[column]?.textContent.trim() ?? "";
  const number = text.match(/^[(]?([-+−]?\d[\d.]*(?:e[-+]?\d+)?)/i);
  return number ? Number(number[1].replace("−", "-")) : text;
}

function compare(a, b) {
  const isNumber = [a, b].map((key) => typeof key === "number");
  if (isNumber[0] && isNumber[1]) return a - b;
  // Numbers stand before words; nothing stands last in either order.
  if (isNumber[0] !== isNumber[1]) return isNumber[0] ? -1 : 1;
  return a.localeCompare(b, "en", { numeric: true });
}

function sortable(table) {
  const body = table.tBodies[0];
  const titles = [...table.tHead.rows[0].cells];
  titles.forEach((title, column) => {
    const button = make("button", { type: "button", class: "sort" }, ...title.childNodes);
    title.replaceChildren(button);
    button.addEventListener("click", () => {
      const isUp = title.getAttribute("aria-sort") !== "ascending";
      titles.forEach((other) => other.removeAttribute("aria-sort"));
      title.setAttribute("aria-sort", isUp ? "ascending" : "descending");
      const keys = new Map([...body.rows].map((row) => [row, keyOf(row, column)]));
      const isNothing = (row) => ["", "–"].includes(keys.get(row));
      const rows = [...body.rows].sort((a, b) => isNothing(a) - isNothing(b) || (isUp ? 1 : -1) * compare(keys.get(a), keys.get(b)));
      body.append(...rows);
    });
  });
  filterable(table, body, titles);
}

// A choice above the table for each column whose title asks for it.
function filterable(table, body, titles) {
  const choices = [];
  titles.forEach((title, column) => {
    if (title.dataset.filter === undefined) return;
    const wordOf = (row) => row.cells[column].textContent.replace(/ \d+ %$/, "").trim();
    const words = [...new Set([...body.rows].map(wordOf))].sort((a, b) => a.localeCompare(b, "en", { numeric: true }));
    if (words.length < 2) return;
    const select = make("select", {}, make("option", { value: "" }, "all"), ...words.map((word) => make("option", {}, word)));
    choices.push({ select, wordOf, label: make("label", {}, `${title.textContent} `, select) });
  });
  if (!choices.length) return;
  const count = make("output", {});
  const apply = () => {
    for (const row of body.rows) {
      row.hidden = choices.some(({ select, wordOf }) => select.selectedIndex > 0 && wordOf(row) !== select.value);
    }
    const left = [...body.rows].filter((row) => !row.hidden).length;
    const what = table.dataset.rows ?? "rows";
    count.textContent = left === body.rows.length ? `${left} ${what}` : `${left} of ${body.rows.length} ${what}`;
  };
  for (const { select } of choices) select.addEventListener("change", apply);
  apply();
  const filters = make("div", { class: "filters", role: "group", "aria-label": "filter of the table" }, ...choices.map(({ label }) => label), count);
  (table.closest(".scroll") ?? table).before(filters);
}

// A click anywhere in a row follows its link.
function linked(table) {
  for (const row of table.tBodies[0].rows) {
    const link = row.querySelector("a[href^='#']");
    if (!link) continue;
    row.classList.add("linked");
    row.addEventListener("click", (event) => {
      if (!event.target.closest("a") && !getSelection().toString()) link.click();
    });
  }
}
