// A curve on a canvas: the band from least to greatest, the mean, and a mark for each step with failed polls.
// A step is [start in s, mean, least, greatest, failed polls]; where a value is missing the curve has a gap.

import { marks, shown } from "./units.js";

const STEP = 4;
const LINE_HEIGHT = 14; // px of a text of the scale
const waiting = new Map();
const watcher = typeof IntersectionObserver === "undefined" ? null : new IntersectionObserver((entries) => {
  for (const entry of entries) {
    entry.target.seen = entry.isIntersecting;
    if (entry.isIntersecting && entry.target.curve) request(entry.target);
  }
}, { rootMargin: "200px" });

export function watch(canvas) {
  watcher?.observe(canvas);
}

// Draws soon, where the canvas can be seen: `span` in s up to `end`, gaps longer than `longest` s stay open.
export function draw(canvas, points, { end, span, unit, longest, axis = false }) {
  canvas.curve = { points, end, span, unit, longest, axis };
  if (!watcher || canvas.seen) request(canvas);
}

function request(canvas) {
  if (waiting.size === 0) requestAnimationFrame(() => {
    const all = [...waiting.keys()];
    waiting.clear();
    all.forEach(paint);
  });
  waiting.set(canvas, true);
}

export function redrawAll() {
  document.querySelectorAll("canvas").forEach((canvas) => canvas.curve && request(canvas));
}

function paint(canvas) {
  const { points, end, span, unit, longest, axis } = canvas.curve;
  const scale = window.devicePixelRatio || 1;
  const width = canvas.clientWidth, height = canvas.clientHeight;
  if (!width || !height) return;
  if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
  }
  const style = getComputedStyle(canvas), color = (name) => style.getPropertyValue(name).trim();
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.font = "12px system-ui, sans-serif";
  const begin = end - span, top = axis ? 24 : 3, bottom = height - (axis ? 26 : 8), left = axis ? 44 : 0;
  const seen = points.filter((point) => point[0] + STEP >= begin && point[0] <= end);
  const values = seen.filter((point) => point[1] !== null);
  const least = Math.min(0, ...values.map((point) => point[2]));
  const greatest = Math.max(least + 1, ...values.map((point) => point[3])) * 1.05;
  const x = (time) => left + ((time - begin) / span) * (width - left);
  const y = (value) => bottom - ((value - least) / (greatest - least)) * (bottom - top);
  pen.strokeStyle = color("--line");
  pen.lineWidth = 1;
  pen.beginPath();
  pen.moveTo(left, y(0) + 0.5);
  pen.lineTo(width, y(0) + 0.5);
  pen.stroke();
  if (axis) scaleOf(pen, { begin, span, width, height, left, x, y, greatest, unit, color });
  for (const run of runs(values, longest)) {
    pen.fillStyle = color("--band");
    pen.beginPath();
    run.forEach((point, index) => (index ? pen.lineTo : pen.moveTo).call(pen, x(point[0] + STEP / 2), y(point[3])));
    [...run].reverse().forEach((point) => pen.lineTo(x(point[0] + STEP / 2), y(point[2])));
    pen.fill();
    pen.strokeStyle = color("--curve");
    pen.lineWidth = 2;
    pen.lineJoin = "round";
    pen.beginPath();
    run.forEach((point, index) => (index ? pen.lineTo : pen.moveTo).call(pen, x(point[0] + STEP / 2), y(point[1])));
    if (run.length === 1) pen.lineTo(x(run[0][0] + STEP), y(run[0][1]));
    pen.stroke();
  }
  pen.fillStyle = color("--bad");
  for (const point of seen) {
    if (point[4] > 0) pen.fillRect(x(point[0]), bottom + 2, Math.max(1.5, (STEP / span) * (width - left)), 5);
  }
}

function runs(points, longest) {
  const found = [];
  let last = null;
  for (const point of points) {
    if (last === null || point[0] - last > longest) found.push([]);
    found.at(-1).push(point);
    last = point[0];
  }
  return found;
}

function scaleOf(pen, { begin, span, width, height, left, x, y, greatest, unit, color }) {
  pen.fillStyle = color("--soft");
  pen.fillText(shown(0, unit)[1], 2, 11);
  const [zero, ...others] = marks(greatest, unit), drawn = [];
  for (const [value, words] of [zero, ...others.reverse()]) {
    if (drawn.some((each) => Math.abs(each - y(value)) < LINE_HEIGHT)) continue; // Beaufort numbers lie close together
    drawn.push(y(value));
    pen.fillText(words, 2, y(value) + 4);
    pen.globalAlpha = 0.35;
    pen.beginPath();
    pen.moveTo(left, Math.round(y(value)) + 0.5);
    pen.lineTo(width, Math.round(y(value)) + 0.5);
    pen.stroke();
    pen.globalAlpha = 1;
  }
  let free = -Infinity;
  for (let minute = Math.ceil(begin / 600) * 600; minute < begin + span; minute += 600) {
    const text = new Date(minute * 1000).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit", hour12: false });
    const wide = pen.measureText(text).width, place = Math.min(x(minute), width - wide);
    if (place < free) continue;
    pen.fillText(text, place, height - 4);
    free = place + wide + 6;
  }
}
