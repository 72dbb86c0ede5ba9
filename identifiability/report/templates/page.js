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
  countHidden(table.closest(".table"));
}

// Where rows are folded, the row above says how many.
function countHidden(table) {
  const rows = [...table.querySelectorAll("tbody tr")];
  const hidden = rows.map((row) => getComputedStyle(row).display === "none");
  for (const [k, row] of rows.entries()) {
    const end = hidden.indexOf(false, k + 1), count = (end < 0 ? rows.length : end) - k - 1;
    const text = `\u22ee ${count} ${count > 1 ? "models" : "model"} ${end < 0 ? "below" : "between"}`;
    for (const one of [row, row.cells[0]]) one.dataset.folded = count && !hidden[k] ? text : "";
  }
}

// Chips that are pressed say which rows are shown; none pressed shows all.
function filterTable(group) {
  const rows = [...group.closest(".table").querySelectorAll("tbody tr")];
  const words = [...group.querySelectorAll("[aria-pressed=true]")].map((chip) => chip.dataset.word);
  for (const row of rows) row.hidden = words.length > 0 && !words.includes(row.dataset.word);
  group.closest(".table").classList.add("all");
  const shown = rows.filter((row) => !row.hidden).length;
  group.querySelector(".shown").textContent = words.length ? `${shown} of ${rows.length} shown` : "";
}

// On cards each cell says what it is, and stays a cell for those who listen to the page.
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
for (const chip of document.querySelectorAll(".chip[data-word]")) {
  chip.addEventListener("click", () => {
    chip.setAttribute("aria-pressed", String(chip.getAttribute("aria-pressed") !== "true"));
    filterTable(chip.closest(".chips"));
  });
}

// A table that is wider than its frame says so; on a phone it becomes cards.
const phone = matchMedia("(max-width: 600px)");
// Captions of answers are folded where the page is narrow; beside a plot there is room for them.
for (const figure of document.querySelectorAll(".answers figure")) {
  const alone = !figure.nextElementSibling && matchMedia("(max-width: 900px)").matches;
  const more = figure.querySelector("figcaption details");
  if (more && (phone.matches || alone)) more.open = false;
}
function fitTable(box) {
  const table = box.parentNode;
  table.classList.remove("cards");
  // Values of a joint side by side are too narrow to read on a phone.
  const values = phone.matches && table.querySelector("td.is-badge ~ td.is-badge");
  const wide = values || box.scrollWidth > box.clientWidth + 1;
  table.classList.toggle("cards", wide && phone.matches);
  box.classList.toggle("wide", wide && !phone.matches);
}
// Of many cards the first ones are shown; of many rows those around the marked one, and the first,
// but never all but one.
for (const button of document.querySelectorAll(".all-rows")) {
  const table = button.closest(".table");
  const rows = table.querySelectorAll("tbody tr").length;
  table.classList.toggle("short", rows > 13 && document.querySelector(".part") !== null);
  if (table.querySelector(".marked")) countHidden(table);
  button.addEventListener("click", () => table.classList.add("all"));
}
for (const box of document.querySelectorAll(".table-box")) {
  let width = 0;  // none while it is folded
  new ResizeObserver(() => {
    if (box.offsetWidth === width) return;
    width = box.offsetWidth;
    fitTable(box);
  }).observe(box);
}

// Statistics in detail are hidden until they are asked for; a link into them asks.
const statistics = document.getElementById("statistics");
function showDetail(on) {
  if (statistics) statistics.checked = on;
  document.body.classList.toggle("with-detail", on);
  document.querySelectorAll(".table-box").forEach(fitTable);
}
if (statistics) statistics.addEventListener("change", () => showDetail(statistics.checked));
function openTarget() {
  const target = location.hash && document.getElementById(location.hash.slice(1));
  if (!target) return;
  for (const part of target.querySelectorAll(":scope > .part")) part.open = true;
  unfold(target);
  target.scrollIntoView();
}
window.addEventListener("hashchange", openTarget);
openTarget();

// Copies and files are made here; nothing is sent. A cell that a spreadsheet would run is quoted.
function tableRows(table) {
  const text = (cell) => {
    const value = cell.dataset.key && !Number.isNaN(Number(cell.dataset.key))
      ? cell.dataset.key : (cell.childNodes.length ? cell.innerText : "").replace(/\s+/g, " ").trim();
    return /^[=+@\t\r]|^-(?![\d.])/.test(value) ? `'${value}` : value;
  };
  return [...table.rows].filter((row) => !row.hidden).map((row) => [...row.cells].map(text));
}
function say(button, word) {
  const before = button.textContent;
  button.textContent = word;
  setTimeout(() => { button.textContent = before; }, 1200);
}
async function copy(button, text) {
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    const area = document.createElement("textarea");
    area.value = text;
    document.body.append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
  }
  say(button, "copied");
}
for (const button of document.querySelectorAll(".copy")) {
  button.addEventListener("click", () => copy(button, button.dataset.copy));
}
for (const button of document.querySelectorAll(".copy-table")) {
  button.addEventListener("click", () => copy(button,
    tableRows(button.closest(".table").querySelector("table")).map((r) => r.join("\t")).join("\n")));
}
for (const button of document.querySelectorAll(".save-table")) {
  button.addEventListener("click", () => {
    const rows = tableRows(button.closest(".table").querySelector("table"));
    const quote = (x) => (/[",\n]/.test(x) ? `"${x.replaceAll('"', '""')}"` : x);
    const text = rows.map((r) => r.map(quote).join(",")).join("\r\n");
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob(["\ufeff", text], { type: "text/csv" }));
    link.download = `${button.closest("section, main").id || "table"}.csv`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    say(button, "saved");
  });
}

// A row and its mark in the pictures light up together.
const rowName = (row) => row.cells[0].firstChild.textContent.trim();
function unfold(inner) {
  for (let fold = inner.closest("details"); fold; fold = fold.parentNode.closest("details")) fold.open = true;
}
function light(section, name, on) {
  for (const one of section.querySelectorAll("[data-row]")) {
    if (one.dataset.row === name) one.classList.toggle("lit", on);
  }
  for (const row of section.querySelectorAll("tbody tr")) {
    if (rowName(row) === name) row.classList.toggle("lit", on);
  }
}
for (const section of document.querySelectorAll("section")) {
  if (!section.querySelector("[data-row]")) continue;
  const nameOf = (target) => {
    const mark = target.closest("[data-row]"), row = target.closest("tbody tr");
    return mark ? mark.dataset.row : row ? rowName(row) : null;
  };
  for (const [kind, on] of [["mouseover", true], ["mouseout", false]]) {
    section.addEventListener(kind, (event) => {
      const name = nameOf(event.target);
      if (name !== null) light(section, name, on);
    });
  }
  section.addEventListener("click", (event) => {
    const mark = event.target.closest("[data-row]");
    if (!mark) return;
    const row = [...section.querySelectorAll("tbody tr")].find((r) => rowName(r) === mark.dataset.row);
    if (row) { unfold(row); row.scrollIntoView({ block: "center" }); }
  });
}

// Paper cannot be clicked: folds are open in print, and a link opens the fold it leads into.
const closed = [];
window.addEventListener("beforeprint", () => {
  for (const fold of document.querySelectorAll("details:not([open]):not(.detail)")) {
    fold.open = true;
    closed.push(fold);
  }
});
window.addEventListener("afterprint", () => {
  for (const fold of closed.splice(0)) fold.open = false;
});
