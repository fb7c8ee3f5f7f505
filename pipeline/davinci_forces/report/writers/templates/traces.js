"use strict";
// Traces that zoom: drawn when they come into view, over the picture that is there without any script.

const [RIGHT, TOP, NUMBERS, LABEL] = [14, 6, 20, 18]; // [px] about the axes
const LOWEST = 125; // [px] of a panel
const FONT = "12px system-ui, sans-serif";
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name);

class Panel {
  constructor(panel, columns, plot) {
    Object.assign(this, panel, { plot, zoom: null });
    this.marks = panel.marks.map((mark) => {
      const data = Object.fromEntries(Object.entries(mark.columns).map(([field, place]) => [field, columns[place]]));
      return { ...mark, data, sorted: data.x ? isSorted(data.x) : false, hidden: false };
    });
    const label = [panel.title, panel.y_label].filter(Boolean).join(", ") || "traces";
    this.picture = newElement("canvas");
    this.cursor = newElement("canvas", "", { role: "img", "aria-label": label });
    this.area = newElement("div", "", { class: "area" });
    this.area.append(this.picture, this.cursor);
    this.element = newElement("div", "", { class: "panel" });
    this.element.append(this.heading(), this.area);
  }

  heading() {
    const heading = newElement("div", "", { class: "legend" });
    if (this.title) heading.append(newElement("b", this.title));
    for (const mark of this.marks.filter((one) => one.label)) {
      const entry = newButton(mark.label, "", () => {
        mark.hidden = !mark.hidden;
        entry.setAttribute("aria-pressed", String(!mark.hidden));
        this.draw();
      });
      entry.setAttribute("aria-pressed", "true");
      const sample = newElement("span", "", { class: `sample ${mark.style ? "line " + mark.style : "area"}` });
      sample.style.setProperty("--mark", `var(--${mark.colour})`);
      entry.prepend(sample);
      heading.append(entry);
    }
    return heading;
  }

  range(axis) {
    const columns = this.marks.filter((mark) => MARKS[mark.kind]?.[axis]).flatMap((mark) => MARKS[mark.kind][axis](mark));
    const log = this[`${axis}_log`];
    const range = extent(log ? columns.map((column) => column.filter((value) => value > 0)) : columns);
    return this[`${axis}_range`] ?? widen(range, axis === "x" ? 0.01 : 0.06, log);
  }

  draw() {
    const [width, height] = [this.area.clientWidth, this.area.clientHeight];
    if (!width) return;
    const left = this.plot.left;
    const frame = { left, right: width - RIGHT, top: TOP, bottom: height - NUMBERS - (this.last ? LABEL : 0) };
    frame.x = newScale(this.plot.view, this.x_log, frame.left, frame.right);
    frame.y = newScale(this.zoom ?? (this.whole ??= this.range("y")), this.y_log, frame.bottom, frame.top);
    this.frame = frame;
    const context = clear(this.picture, width, height);
    this.clear = () => clear(this.cursor, width, height);
    this.clear();
    this.drawAxes(context, frame, height);
    context.save();
    context.beginPath();
    context.rect(frame.left, frame.top, frame.right - frame.left, frame.bottom - frame.top);
    context.clip();
    for (const mark of this.marks.filter((one) => !one.hidden && MARKS[one.kind])) {
      context.lineWidth = 1.2;
      context.strokeStyle = context.fillStyle = colour(`--${mark.colour}`);
      MARKS[mark.kind].draw(context, mark, frame);
    }
    context.restore();
  }

  drawAxes(context, frame, height) {
    const [grid, axes, words] = ["--grid", "--axes", "--words"].map(colour);
    const across = ticks([frame.x.from(frame.left), frame.x.from(frame.right)], this.x_log, Math.max(2, (frame.right - frame.left) / 90));
    const up = ticks([frame.y.from(frame.bottom), frame.y.from(frame.top)], this.y_log, Math.max(2, (frame.bottom - frame.top) / 28));
    const step = (marks) => (marks.length > 1 ? Math.abs(marks[1] - marks[0]) : Math.abs(marks[0]) || 1);
    this.steps = { x: step(across), y: step(up) };
    context.fillStyle = grid;
    for (const value of across) context.fillRect(Math.round(frame.x.to(value)), frame.top, 1, frame.bottom - frame.top);
    for (const value of up) context.fillRect(frame.left, Math.round(frame.y.to(value)), frame.right - frame.left, 1);
    context.fillStyle = axes;
    context.fillRect(frame.left, frame.bottom, frame.right - frame.left, 1);
    context.fillRect(frame.left, frame.top, 1, frame.bottom - frame.top);
    context.fillStyle = words;
    context.textAlign = "center";
    for (const value of across) context.fillText(printNumber(value, this.steps.x), frame.x.to(value), frame.bottom + 15);
    if (this.last) context.fillText(this.x_label, (frame.left + frame.right) / 2, height - 5);
    context.textAlign = "right";
    for (const value of up) context.fillText(printNumber(value, this.steps.y), frame.left - 5, frame.y.to(value) + 4);
    this.drawLabel(context, frame);
  }

  // The label of y in as many lines as it needs, its unit on the last.
  drawLabel(context, frame) {
    const room = frame.bottom - frame.top + 10;
    const parts = this.y_label.match(/^(.*) (\[.*\])$/);
    const lines = parts && context.measureText(this.y_label).width > room ? parts.slice(1) : [this.y_label];
    context.save();
    context.translate(12, (frame.top + frame.bottom) / 2);
    context.rotate(-Math.PI / 2);
    context.textAlign = "center";
    lines.forEach((line, i) => context.fillText(line, 0, 14 * i, room));
    context.restore();
  }

  // A line at a value of x, and what the marks are there.
  point(x, first) {
    const context = this.clear();
    const across = this.frame.x.to(x);
    if (!(across >= this.frame.left && across <= this.frame.right)) return;
    const print = (value) => (Number.isFinite(value) ? printNumber(value, this.steps.y / 100) : "–");
    const lines = first ? [{ words: `${this.x_label.replace(/ \[(.*)\]$/, "")} ${printNumber(x, this.steps.x / 100)}${unit(this.x_label)}` }] : [];
    for (const mark of this.marks) {
      if (mark.hidden || !MARKS[mark.kind]?.say || !mark.sorted || !mark.data.x.length) continue;
      const i = nearest(mark.data.x, x);
      if (Math.abs(this.frame.x.to(mark.data.x[i]) - across) > 12) continue;
      lines.push({ mark, words: `${mark.label || this.title} ${MARKS[mark.kind].say(mark, i, print)}${unit(this.y_label)}`.trim() });
    }
    context.fillStyle = colour("--axes");
    context.fillRect(Math.round(across), this.frame.top, 1, this.frame.bottom - this.frame.top);
    if (lines.length) this.drawNote(context, lines, across);
  }

  drawNote(context, lines, across) {
    const wide = Math.max(...lines.map((line) => context.measureText(line.words).width)) + 24;
    const left = across + 10 + wide < this.frame.right ? across + 10 : Math.max(across - 10 - wide, 2);
    fill(context, 0.92, () => {
      context.fillStyle = colour("--panel");
      context.fillRect(left, this.frame.top + 2, wide, 16 * lines.length + 6);
    });
    context.textAlign = "left";
    lines.forEach((line, i) => {
      if (line.mark) {
        context.fillStyle = colour(`--${line.mark.colour}`);
        context.fillRect(left + 5, this.frame.top + 16 * i + 9, 9, 4);
      }
      context.fillStyle = colour("--words");
      context.fillText(line.words, left + 18, this.frame.top + 16 * i + 16);
    });
  }
}

class Plot {
  constructor(figure) {
    const numbers = numbersOf(figure);
    this.element = newElement("div", "", { class: "plot" });
    this.element.style.setProperty("--columns", numbers.across);
    this.panels = numbers.panels.map((panel) => new Panel(panel, numbers.columns, this));
    this.panels.forEach((panel, i) => {
      panel.last = i + numbers.across >= this.panels.length;
      panel.area.style.height = `${Math.max(numbers.height - 34, LOWEST) + (panel.last ? LABEL : 0)}px`;
      this.listen(panel);
    });
    this.element.append(...this.panels.map((panel) => panel.element));
    const drawing = figure.querySelector(".drawing");
    drawing.append(this.element);
    drawing.setAttribute("role", "group");
    drawing.setAttribute("aria-label", drawing.querySelector("img").alt);
    drawing.classList.add("live");
    this.whole = this.panels[0].x_range ?? extent(this.panels.map((panel) => panel.range("x")));
    this.log = this.panels[0].x_log;
    this.view = this.whole;
    toolsOf(figure).prepend(
      newButton("‹", "Earlier", () => this.move(-0.5)),
      newButton("›", "Later", () => this.move(0.5)),
      newButton("−", "Zoom out", () => this.scale(2)),
      newButton("+", "Zoom in", () => this.scale(0.5)),
      newButton("All", "Show all", () => this.reset()),
    );
  }

  get left() {
    return this.element.clientWidth < 500 ? 56 : 72;
  }

  draw() {
    for (const panel of this.panels) panel.draw();
  }

  // Canvases of figures out of sight would take hundreds of megabytes.
  forget() {
    for (const { picture, cursor } of this.panels) picture.width = cursor.width = picture.height = cursor.height = 0;
  }

  show(range) {
    const scale = newScale(this.whole, this.log, 0, 1);
    const [low, high] = range.map(scale.to);
    const width = Math.min(1, Math.max(high - low, 1e-7));
    const start = Math.min(Math.max(low, 0), 1 - width);
    this.view = width === 1 ? this.whole : [scale.from(start), scale.from(start + width)];
    this.draw();
  }

  // A move by a part of what is seen, and a zoom about a place in it.
  move(part) {
    const scale = newScale(this.view, this.log, 0, 1);
    this.show([scale.from(part), scale.from(1 + part)]);
  }

  scale(factor, about = 0.5) {
    const scale = newScale(this.view, this.log, 0, 1);
    this.show([scale.from(about - about * factor), scale.from(about + (1 - about) * factor)]);
  }

  reset() {
    for (const panel of this.panels) panel.zoom = null;
    this.show(this.whole);
  }

  point(x) {
    this.panels.forEach((panel, i) => panel.point(x, i === 0));
  }

  listen(panel) {
    const { cursor } = panel;
    let start = null;
    const place = (event) => {
      const edge = cursor.getBoundingClientRect();
      return { x: event.clientX - edge.left, y: event.clientY - edge.top };
    };
    cursor.addEventListener("pointerdown", (event) => {
      start = { ...place(event), view: this.view };
      if (event.pointerType !== "touch") cursor.setPointerCapture(event.pointerId);
    });
    cursor.addEventListener("pointermove", (event) => {
      const now = place(event);
      const isZoomed = this.view !== this.whole || this.panels.some((one) => one.zoom);
      if (event.pointerType === "touch" && start && isZoomed) {
        const scale = newScale(start.view, this.log, panel.frame.left, panel.frame.right);
        this.show([panel.frame.left, panel.frame.right].map((edge) => scale.from(edge + start.x - now.x)));
      }
      this.point(panel.frame.x.from(now.x));
      if (start && event.pointerType !== "touch") outline(panel, start, now);
    });
    cursor.addEventListener("pointerup", (event) => {
      if (start && event.pointerType !== "touch") this.choose(panel, start, place(event));
      start = null;
    });
    cursor.addEventListener("pointercancel", () => (start = null));
    cursor.addEventListener("pointerleave", () => this.panels.forEach((one) => one.clear()));
    cursor.addEventListener("dblclick", () => this.reset());
    cursor.addEventListener("wheel", (event) => {
      if (!event.ctrlKey) return; // the page scrolls
      event.preventDefault();
      const { left, right } = panel.frame;
      this.scale(event.deltaY > 0 ? 1.25 : 0.8, (place(event).x - left) / (right - left));
    }, { passive: false });
  }

  // Zoom to what was dragged over: to a range of x, and to one of y if the drag was high as well.
  choose(panel, start, end) {
    if (Math.abs(end.x - start.x) < 6) return;
    if (isHigh(start, end)) panel.zoom = [start.y, end.y].sort((a, b) => b - a).map(panel.frame.y.from);
    this.show([start.x, end.x].sort((a, b) => a - b).map(panel.frame.x.from));
  }
}

const isHigh = (start, end) => Math.abs(end.y - start.y) > 24;
const unit = (label) => (/\[(.*)\]$/.exec(label)?.[1] ?? "").replace(/^/, " ").trimEnd();

function outline(panel, start, now) {
  const context = panel.clear();
  const [top, bottom] = isHigh(start, now) ? [start.y, now.y] : [panel.frame.top, panel.frame.bottom];
  context.fillStyle = colour("--axes");
  fill(context, 0.25, () => box(context, start.x, top, now.x, bottom));
}

// An empty canvas of a size, sharp on any screen.
function clear(canvas, width, height) {
  const ratio = window.devicePixelRatio || 1;
  const [across, up] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== across || canvas.height !== up) [canvas.width, canvas.height] = [across, up];
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = FONT;
  return context;
}

const plots = new Map();
const inSight = new Set();
const sight = new IntersectionObserver((entries) => {
  for (const { target, isIntersecting } of entries) {
    if (isIntersecting) {
      if (!plots.has(target)) plots.set(target, new Plot(target));
      inSight.add(target);
      plots.get(target).draw();
    } else if (inSight.delete(target)) plots.get(target).forget();
  }
}, { rootMargin: "300px" });
for (const figure of document.querySelectorAll("figure.zoomable")) sight.observe(figure);

const redraw = () => inSight.forEach((figure) => plots.get(figure).draw());
window.addEventListener("resize", redraw);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
