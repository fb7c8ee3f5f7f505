"use strict";
// How each mark is drawn on a canvas, what range of x and y it takes, and what it says at a place.

const DASHES = { solid: [], dashed: [7, 3], dotted: [1.5, 2.5], dashdot: [8, 3, 1.5, 3] };

// Where a column that never decreases reaches a value; the column's length if it does not.
function reach(column, value) {
  let [low, high] = [0, column.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (column[middle] < value) low = middle + 1;
    else high = middle;
  }
  return low;
}

function isSorted(column) {
  for (let i = 1; i < column.length; i++) if (!(column[i] >= column[i - 1])) return false;
  return true;
}

function nearest(column, value) {
  const i = reach(column, value);
  return i > 0 && (i === column.length || value - column[i - 1] < column[i] - value) ? i - 1 : i;
}

function extent(columns) {
  let [low, high] = [Infinity, -Infinity];
  for (const column of columns)
    for (const value of column) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
  return [low, high];
}

// The samples that are to be seen, and one more on each side.
function visible(mark, frame) {
  const { x } = mark.data;
  if (!mark.sorted) return [0, x.length];
  return [Math.max(0, reach(x, frame.x.from(frame.left)) - 1), Math.min(x.length, reach(x, frame.x.from(frame.right)) + 1)];
}

function trace(context, x, y, frame, first = 0, last = x.length) {
  let down = false;
  for (let i = first; i < last; i++) {
    const [across, up] = [frame.x.to(x[i]), frame.y.to(y[i])];
    if (!Number.isFinite(up) || !Number.isFinite(across)) down = false;
    else if (down) context.lineTo(across, up);
    else {
      context.moveTo(across, up);
      down = true;
    }
  }
}

function stroke(context, mark, draw) {
  context.setLineDash(DASHES[mark.style] ?? []);
  context.beginPath();
  draw();
  context.stroke();
  context.setLineDash([]);
}

function fill(context, alpha, draw) {
  context.globalAlpha = alpha;
  draw();
  context.globalAlpha = 1;
}

const box = (context, a, b, c, d) => context.fillRect(Math.min(a, c), Math.min(b, d), Math.abs(c - a), Math.abs(d - b));

const ofX = ({ data }) => [data.x];
const sayY = (mark, i, print) => print(mark.data.y[i]);
const endsOfX = (frame) => [frame.x.from(frame.left), frame.x.from(frame.right)];

const MARKS = {
  Line: {
    draw(context, mark, frame) {
      const [first, last] = visible(mark, frame);
      stroke(context, mark, () => trace(context, mark.data.x, mark.data.y, frame, first, last));
    },
    x: ofX,
    y: ({ data }) => [data.y],
    say: sayY,
  },
  Band: {
    draw(context, mark, frame) {
      const { x, lower, upper } = mark.data;
      const [first, last] = visible(mark, frame);
      const isKnown = (i) => !Number.isNaN(lower[i] + upper[i]);
      fill(context, 0.25, () => {
        for (let i = first; i < last; i++) {
          const start = i;
          while (i < last && isKnown(i)) i++;
          context.beginPath();
          for (let k = start; k < i; k++) context.lineTo(frame.x.to(x[k]), frame.y.to(upper[k]));
          for (let k = i - 1; k >= start; k--) context.lineTo(frame.x.to(x[k]), frame.y.to(lower[k]));
          context.fill();
        }
      });
    },
    x: ofX,
    y: ({ data }) => [data.lower, data.upper],
    say: (mark, i, print) => `${print(mark.data.lower[i])} to ${print(mark.data.upper[i])}`,
  },
  Points: {
    draw(context, mark, frame) {
      const { x, y, y_std: std } = mark.data;
      Object.assign(context, { textAlign: "center", strokeStyle: colour("--paper"), lineWidth: 3, lineJoin: "round" });
      for (let i = 0; i < x.length; i++) {
        const [across, up] = [frame.x.to(x[i]), frame.y.to(y[i])];
        context.fillRect(across - 2, up - 2, 4, 4);
        if (std) context.fillRect(across - 0.5, frame.y.to(y[i] + std[i]), 1, frame.y.to(y[i] - std[i]) - frame.y.to(y[i] + std[i]));
        const words = [mark.names?.[i] ?? "", across, up + (y[i] < 0 ? 15 : -7)];
        context.strokeText(...words); // a halo, which covers the lines behind the words
        context.fillText(...words);
      }
    },
    x: ofX,
    y: ({ data: { y, y_std: std } }) => (std ? [y.map((v, i) => v - std[i]), y.map((v, i) => v + std[i])] : [y]),
    say: sayY,
  },
  Stems: {
    draw(context, mark, frame) {
      const { x, y } = mark.data;
      for (let i = 0; i < x.length; i++) box(context, frame.x.to(x[i]) - 0.6, frame.y.to(0), frame.x.to(x[i]) + 0.6, frame.y.to(y[i]));
    },
    x: ofX,
    y: ({ data }) => [data.y, [0]],
    say: sayY,
  },
  Histogram: {
    draw(context, mark, frame) {
      const { edges, counts } = mark.data;
      fill(context, 0.75, () => counts.forEach((count, i) =>
        box(context, frame.x.to(edges[i]), frame.y.to(0), frame.x.to(edges[i + 1]), frame.y.to(count))));
    },
    x: ({ data }) => [data.edges],
    y: ({ data }) => [data.counts, [0]],
  },
  HLine: {
    draw: (context, mark, frame) =>
      stroke(context, mark, () => trace(context, endsOfX(frame), [mark.y, mark.y], frame)),
    y: (mark) => [[mark.y]],
  },
  VLine: {
    draw: (context, mark, frame) =>
      stroke(context, mark, () => trace(context, [mark.x, mark.x], [frame.y.from(frame.bottom), frame.y.from(frame.top)], frame)),
    x: (mark) => [[mark.x]],
  },
  HBand: {
    draw: (context, mark, frame) =>
      fill(context, 0.22, () => box(context, frame.left, frame.y.to(mark.lower), frame.right, frame.y.to(mark.upper))),
    y: (mark) => [[mark.lower, mark.upper]],
  },
  VSpan: {
    draw: (context, mark, frame) =>
      fill(context, 0.18, () => box(context, frame.x.to(mark.start), frame.top, frame.x.to(mark.end), frame.bottom)),
    x: (mark) => [[mark.start, mark.end]],
  },
  Reference: {
    draw(context, mark, frame) {
      const ends = endsOfX(frame);
      stroke(context, mark, () => trace(context, ends, ends.map((x) => mark.intercept + mark.slope * x), frame));
    },
  },
};
