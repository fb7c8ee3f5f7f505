"use strict";
// Numbers on axes: from values to pixels, and round numbers to mark them with.

// A range of values over a range of pixels; `to` leads to pixels, `from` back.
function newScale(range, log, first, last) {
  const forth = log ? Math.log10 : Number;
  const back = log ? (value) => 10 ** value : Number;
  const [low, high] = range.map(forth);
  const slope = (last - first) / (high - low || 1);
  return { to: (value) => first + (forth(value) - low) * slope, from: (pixel) => back(low + (pixel - first) / slope) };
}

// A range a part wider on both sides; of no width, one that has some.
function widen([low, high], part, log) {
  if (!(low <= high)) return log ? [1, 10] : [0, 1];
  if (log) return [low / (high / low || 1) ** part, high * (high / low || 1) ** part];
  const room = (high - low || Math.abs(low) || 1) * part;
  return [low - room, high + room];
}

function ticks([low, high], log, most) {
  if (log) {
    const decades = Math.log10(high / low);
    const digits = decades < 2 ? [1, 2, 5] : [1];
    const stride = Math.max(1, Math.ceil(decades / most));
    const marks = [];
    for (let n = Math.floor(Math.log10(low)); n <= Math.log10(high); n += stride)
      for (const digit of digits) marks.push(digit * 10 ** n);
    return marks.filter((mark) => mark >= low && mark <= high);
  }
  const step = roundUp((high - low) / most);
  const marks = [];
  for (let i = Math.ceil(low / step); i * step <= high; i++) marks.push(i * step);
  return marks;
}

function roundUp(step) {
  const power = 10 ** Math.floor(Math.log10(step));
  return [1, 2, 5, 10].find((digit) => digit * power >= step * 0.999) * power;
}

// A number, its digits as fine as a step of its axis.
function printNumber(value, step) {
  const size = Math.abs(value);
  if (size > 0 && (size >= 1e5 || size < 1e-3)) {
    const digits = Math.max(0, Math.min(6, Math.floor(Math.log10(size)) - Math.floor(Math.log10(step))));
    const [mantissa, power] = value.toExponential(digits).split("e");
    return `${mantissa}×10${[...String(Number(power))].map((c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] ?? "⁻").join("")}`.replace("-", "−");
  }
  const decimals = Math.max(0, Math.min(9, -Math.floor(Math.log10(step) + 1e-9)));
  const text = value.toFixed(decimals);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−");
}
