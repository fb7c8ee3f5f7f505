"use strict";
// What a figure is drawn from: its columns, decoded when they are asked for, and handed out as CSV.

const numbersOfFigures = new Map();

function numbersOf(figure) {
  if (!numbersOfFigures.has(figure)) {
    const numbers = JSON.parse(figure.querySelector("script.numbers").textContent);
    numbers.columns = numbers.columns.map(decode);
    numbersOfFigures.set(figure, numbers);
  }
  return numbersOfFigures.get(figure);
}

// A column is [start, step, count], or base 64: single (f) or double (d) precision, or steps above a value (h).
function decode(column) {
  if (Array.isArray(column)) {
    const [start, step, count] = column;
    return Float64Array.from({ length: count }, (_, i) => start + i * step);
  }
  const [start, step] = column[0] === "h" ? column.slice(1).split(",").map(Number) : [];
  const text = column.slice(1 + column.lastIndexOf(","));
  const bytes = Uint8Array.from(atob(step ? text : column.slice(1)), (letter) => letter.charCodeAt(0));
  if (step) return Float64Array.from(new Uint16Array(bytes.buffer), (code) => (code === 65535 ? NaN : start + code * step));
  return column[0] === "f" ? new Float32Array(bytes.buffer) : new Float64Array(bytes.buffer);
}

function csv(numbers) {
  const quote = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const print = (value, column) =>
    typeof value === "string" ? quote(value) : Number.isFinite(value) ? String(Number(value.toPrecision(column instanceof Float32Array ? 7 : 12))) : "";
  const columns = [];
  for (const panel of numbers.panels)
    for (const mark of panel.marks) {
      const head = (field, label) => [panel.title, mark.label || mark.kind, field, label].filter(Boolean).join(" | ");
      if (mark.names?.length) columns.push({ head: head("name"), values: mark.names });
      for (const [field, place] of Object.entries(mark.columns))
        columns.push({ head: head(field, field === "x" ? panel.x_label : panel.y_label), values: numbers.columns[place] });
    }
  const rows = [columns.map((column) => quote(column.head)).join(",")];
  const length = Math.max(0, ...columns.map((column) => column.values.length));
  for (let i = 0; i < length; i++)
    rows.push(columns.map(({ values }) => (i < values.length ? print(values[i], values) : "")).join(","));
  return rows.join("\r\n") + "\r\n";
}

function save(text, name, type = "text/csv", start = "\uFEFF") {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([start, text], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

// An element for the page, for all scripts, which share their names.
function newElement(tag, words = "", attributes = {}) {
  const element = document.createElement(tag);
  element.textContent = words;
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

function newButton(words, label, act) {
  const button = newElement("button", words, { type: "button" });
  if (label) button.setAttribute("aria-label", label);
  button.addEventListener("click", act);
  return button;
}

// A row of buttons right after a figure's drawing, made when the first of them is.
function toolsOf(figure) {
  let tools = figure.querySelector(":scope > .tools");
  if (!tools) {
    tools = newElement("div", "", { class: "tools" });
    figure.querySelector(".drawing").after(tools);
  }
  return tools;
}

// The picture of a figure as a file: with the colours of paper in place of names, which drawing programs do not know.
function drawing(figure) {
  const { src } = figure.querySelector(".drawing img");
  const picture = decodeURIComponent(src.slice(src.indexOf(",") + 1));
  const colours = new Map([...(/:root\{(.*?)\}/.exec(picture)?.[1] ?? "").matchAll(/(--\w+):([^;]+)/g)].map(([, name, colour]) => [name, colour]));
  return picture.replace(/var\((--\w+)\)/g, (_, name) => colours.get(name));
}

for (const figure of document.querySelectorAll("figure:has(> script.numbers)")) {
  const name = figure.querySelector("figcaption a").textContent.replace(/\W+$/, "");
  const file = `${document.title.split(" – ")[0]}-${name}`.toLowerCase().replace(/[^a-z0-9.]+/g, "-");
  toolsOf(figure).append(
    newButton("SVG", `${name} as SVG, a drawing for a paper`, () => save(drawing(figure), `${file}.svg`, "image/svg+xml", "")),
    newButton("CSV", `Numbers of ${name} as CSV`, () => save(csv(numbersOf(figure)), `${file}.csv`)),
  );
}
