"use strict";
// Tables that can be sorted and searched, long ones folded; and the key of a number, which shows and copies.

const [FOLDED_BEYOND, SHOWN_FOLDED, SEARCHED_FROM, SORTED_FROM] = [15, 10, 10, 3];

for (const region of document.querySelectorAll(".table")) prepareTable(region);

function prepareTable(region) {
  const body = region.querySelector("tbody");
  const rows = [...body.rows];
  const state = { words: "", folded: rows.length > FOLDED_BEYOND && !region.matches(".whole") };
  const update = () => {
    let shown = 0;
    for (const row of body.rows) {
      row.hidden = state.words ? !row.textContent.toLowerCase().includes(state.words) : state.folded && shown >= SHOWN_FOLDED;
      shown += !row.hidden;
    }
    return shown;
  };
  if (rows.length >= SORTED_FROM) for (const head of region.querySelectorAll("thead th")) makeSortable(head, body, rows, update);
  const scroll = region.querySelector(".scroll");
  const name = scroll.getAttribute("aria-label");
  fadeWhereCut(scroll);
  if (rows.length >= SEARCHED_FROM) scroll.before(newSearch(name, rows.length, state, update));
  if (!state.folded) return;
  const fold = newButton("", "", () => {
    state.folded = !state.folded;
    said();
  });
  const said = () => {
    update();
    fold.textContent = state.folded ? `Show all ${rows.length} rows` : `Show ${SHOWN_FOLDED} rows`;
    fold.setAttribute("aria-expanded", String(!state.folded));
  };
  fold.className = "fold";
  scroll.after(fold);
  region.addEventListener("unfold", () => {
    Object.assign(state, { folded: false, words: "" });
    said();
  });
  said();
}

// Fade the right edge of a table that goes on beyond it, so that a reader knows to scroll.
function fadeWhereCut(scroll) {
  const update = () => scroll.classList.toggle("cut", scroll.scrollWidth - scroll.clientWidth - scroll.scrollLeft > 4); // px
  scroll.addEventListener("scroll", update, { passive: true });
  new ResizeObserver(update).observe(scroll);
}

function newSearch(name, count, state, update) {
  const search = newElement("div", "", { class: "tools" });
  const field = newElement("input", "", { type: "search", placeholder: "Filter rows", "aria-label": `Filter the rows of ${name}` });
  const found = newElement("output");
  field.addEventListener("input", () => {
    state.words = field.value.trim().toLowerCase();
    const shown = update();
    found.textContent = state.words ? `${shown} of ${count}` : "";
  });
  search.append(field, found);
  return search;
}

function makeSortable(head, body, rows, update) {
  const button = newButton("", "", () => {
    const now = head.getAttribute("aria-sort");
    for (const other of head.parentNode.cells) other.removeAttribute("aria-sort");
    const next = { ascending: "descending", descending: "" }[now] ?? "ascending";
    if (next) head.setAttribute("aria-sort", next);
    body.append(...(next ? sorted(rows, head.cellIndex, next === "ascending" ? 1 : -1) : rows));
    update();
  });
  button.append(...head.childNodes);
  button.title = "Sort";
  head.append(button);
}

function sorted(rows, column, sign) {
  const keyed = rows.map((row) => ({ row, words: row.cells[column].textContent.trim(), value: valueOf(row.cells[column].textContent) }));
  const compare = (a, b) => {
    if (Number.isNaN(a.value) !== Number.isNaN(b.value)) return Number.isNaN(a.value) ? 1 : -1;
    return sign * (Number.isNaN(a.value) ? a.words.localeCompare(b.words, "en", { numeric: true }) : a.value - b.value);
  };
  return keyed.sort(compare).map(({ row }) => row);
}

// The number that a cell prints: 1.2, −3.4 ± 0.5, (1.2 ± 0.3) × 10⁻⁴.
function valueOf(text) {
  const [, number, power] = /^[\s(<]*([−-]?\d[\d.]*)[^×]*(?:× 10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+))?/.exec(text) ?? [];
  if (!number || /^\s*\d[\d.]*[a-z_]/i.test(text)) return NaN;
  const exponent = [...(power ?? "")].map((c) => (c === "⁻" ? "-" : "⁰¹²³⁴⁵⁶⁷⁸⁹".indexOf(c))).join("");
  return Number(`${number.replace("−", "-")}e${exponent || 0}`);
}

const note = newElement("div", "", { class: "key", role: "status" });
document.querySelector("main").append(note);

document.addEventListener("click", (event) => {
  const cell = event.target.closest("td[data-key]");
  if (cell && !event.target.closest("a")) showKey(cell.dataset.key);
  else if (!note.contains(event.target)) note.replaceChildren();
});
document.addEventListener("keydown", (event) => event.key === "Escape" && note.replaceChildren());

async function showKey(key) {
  const code = newElement("code", key);
  const link = newElement("a", "link", { href: `#key=${encodeURIComponent(key)}` });
  const said = newElement("span");
  note.replaceChildren(code, said, link);
  said.textContent = (await copy(key, code)) ? "copied" : "";
}

async function copy(text, element) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    getSelection().selectAllChildren(element); // the reader copies it
    return false;
  }
}

// What an address names may be in a folded part or table.
function openTarget() {
  const name = decodeURIComponent(location.hash.slice(1));
  const key = name.startsWith("key=") ? name.slice(4) : "";
  const target = key ? document.querySelector(`td[data-key="${CSS.escape(key)}"]`) : document.getElementById(name);
  if (!target) return;
  for (let parent = target; parent; parent = parent.parentElement) if (parent.tagName === "DETAILS") parent.open = true;
  for (const old of document.querySelectorAll(".found")) old.classList.remove("found");
  if (key) {
    target.closest(".table").dispatchEvent(new Event("unfold"));
    target.classList.add("found");
  }
  target.scrollIntoView({ block: key ? "center" : "start" });
}
window.addEventListener("hashchange", openTarget);
openTarget();
