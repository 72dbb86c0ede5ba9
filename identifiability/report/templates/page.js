"use strict";

// Sort by the header's button; empty keys stay last, and equal ones keep their order.
function compare(a, b, sign) {
  if (a === b) return 0;
  if (a === "") return 1;
  if (b === "") return -1;
  const x = Number(a), y = Number(b);
  if (!Number.isNaN(x) && !Number.isNaN(y)) return sign * (x - y);
  return sign * a.localeCompare(b, "en", { numeric: true });
}

function sortTable(header) {
  const table = header.closest("table"), body = table.tBodies[0];
  const column = [...header.parentNode.children].indexOf(header);
  const sign = header.getAttribute("aria-sort") === "ascending" ? -1 : 1;
  for (const other of header.parentNode.children) other.setAttribute("aria-sort", "none");
  header.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
  const rows = [...body.rows];
  const key = (row) => row.cells[column].dataset.key ?? row.cells[column].textContent.trim();
  rows.sort((a, b) => compare(key(a), key(b), sign));
  body.append(...rows);
}

// Chips that are pressed say which rows are shown; none pressed shows all.
function filterTable(group) {
  const rows = [...group.closest(".table").querySelectorAll("tbody tr")];
  const words = [...group.querySelectorAll("[aria-pressed=true]")].map((chip) => chip.dataset.word);
  for (const row of rows) row.hidden = words.length > 0 && !words.includes(row.dataset.word);
  const shown = rows.filter((row) => !row.hidden).length;
  group.querySelector(".shown").textContent = words.length ? `${shown} of ${rows.length} shown` : "";
}

// On a phone rows are laid out as cards: each cell says what it is, and stays a cell for those
// who listen to the page.
for (const row of document.querySelectorAll("tbody tr")) {
  const headers = row.closest("table").tHead.rows[0].cells;
  for (const cell of row.cells) cell.dataset.label = headers[cell.cellIndex].textContent.trim();
}
for (const [tags, role] of [
  ["table", "table"], ["thead, tbody", "rowgroup"], ["tr", "row"], ["td", "cell"],
  ["thead th", "columnheader"], ["tbody th", "rowheader"],
]) {
  for (const element of document.querySelectorAll(tags)) element.setAttribute("role", role);
}

for (const button of document.querySelectorAll("thead button")) {
  button.addEventListener("click", () => sortTable(button.closest("th")));
}
for (const chip of document.querySelectorAll(".chip")) {
  chip.addEventListener("click", () => {
    chip.setAttribute("aria-pressed", String(chip.getAttribute("aria-pressed") !== "true"));
    filterTable(chip.closest(".chips"));
  });
}

// Paper cannot be clicked: folds are open in print, and a link opens the fold it leads into.
const closed = [];
window.addEventListener("beforeprint", () => {
  for (const fold of document.querySelectorAll("details:not([open])")) {
    fold.open = true;
    closed.push(fold);
  }
});
window.addEventListener("afterprint", () => {
  for (const fold of closed.splice(0)) fold.open = false;
});
