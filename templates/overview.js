"use strict";
// The table is whole without this: it adds searching, filtering and sorting.
(() => {
  const table = document.getElementById("table");
  const body = table.tBodies[0];
  const rows = [...body.rows];
  const fixed = 2;
  const rank = { error: 0, failed: 1, partial: 2, skipped: 3, passed: 4 };
  const kind = (cell) => {
    const mark = cell && cell.firstElementChild;
    return mark ? mark.className.split(" ").pop() : "";
  };
  // "muller" and "mueller" find Müller, "strasse" finds Straße, "lukasz" finds Łukasz.
  const letters = { ß: "ss", æ: "ae", œ: "oe", ø: "o", ł: "l", đ: "d", ð: "d", þ: "th", ħ: "h", ı: "i", ŋ: "n", ŧ: "t", ĸ: "k", ə: "e", ς: "σ" };
  const plain = (text) => text.normalize("NFKD").replace(/\p{M}/gu, "").toLowerCase()
    .replace(/[^\x00-\x7f]/gu, (letter) => letters[letter] ?? letter).replace(/[\u02b9-\u02bf\u2018\u2019`´']/gu, "");
  const spelt = (text) => text.normalize("NFC").toLowerCase()
    .replace(/[äöüøå]/gu, (letter) => ({ ä: "ae", ö: "oe", ü: "ue", ø: "oe", å: "aa" })[letter]);
  const forms = (text) => [plain(text), plain(spelt(text))];
  const name = (row) => row.cells[0].textContent.trim().toLowerCase();
  const score = (row) => {
    const value = parseFloat(row.cells[1].textContent);
    return Number.isNaN(value) ? -1 : value;
  };
  const said = rows.map((row) => ({ row, names: forms(row.cells[0].textContent), states: row.dataset.is.split(" ") }));
  let order = said;

  const form = document.getElementById("filters");
  const search = document.getElementById("search");
  const state = document.getElementById("state");
  const failed = document.getElementById("failed");
  const shown = document.getElementById("shown");
  // A browser takes long to lay out 10,000 rows.
  const more = document.getElementById("more");
  let most = Number(more.dataset.most);
  const filter = () => {
    const words = search.value.split(/\s+/).filter(Boolean).map(forms);
    let count = 0;
    for (const one of order) {
      const cell = failed.value && one.row.cells[fixed + Number(failed.value)];
      const fits = words.every((word) => one.names.some((text) => word.some((form) => text.includes(form))))
        && (!state.value || one.states.includes(state.value))
        && (!failed.value || ["failed", "partial"].includes(kind(cell)));
      one.row.hidden = !fits || count >= most;
      count += fits;
    }
    more.hidden = count <= most;
    shown.textContent = count === rows.length
      ? `${count} submission${count === 1 ? "" : "s"}` : `${count} of ${rows.length} submissions`;
    if (count > most) shown.textContent += `, the first ${most} are shown`;
  };
  more.addEventListener("click", () => {
    most = Infinity;
    filter();
  });
  form.hidden = false;
  filter();
  form.addEventListener("input", filter);
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("reset", () => setTimeout(filter));

  const heads = [...table.tHead.rows[0].cells];
  const sort = (column) => {
    const head = heads[column];
    const down = head.getAttribute("aria-sort") === "ascending";
    const key = column === 0 ? name : column === 1 ? score : (row) => rank[kind(row.cells[column])] ?? 5;
    const sign = down ? -1 : 1;
    const keyed = said.map((one, index) => ({ one, index, key: key(one.row) }));
    keyed.sort((a, b) => (typeof a.key === "string" ? sign * a.key.localeCompare(b.key) : sign * (a.key - b.key)) || a.index - b.index);
    for (const other of heads) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    order = keyed.map(({ one }) => one);
    for (const row of rows) row.hidden = true;
    body.replaceChildren(...order.map((one) => one.row));
    filter();
  };
  heads.forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...(head.querySelector("span") || head).childNodes);
    head.replaceChildren(button);
    button.addEventListener("click", () => sort(column));
  });
})();
