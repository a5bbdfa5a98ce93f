// Speeds in the viewer's unit; the choice is kept by the browser.

import { together } from "./dom.js";

const FACTORS = { "m/s": 1, "km/h": 3.6, kn: 3600 / 1852 };
const BEAUFORT = [0.3, 1.6, 3.4, 5.5, 8.0, 10.8, 13.9, 17.2, 20.8, 24.5, 28.5, 32.7];
const KEY = "lfs10d.unit";

export function chosen() {
  try {
    const kept = localStorage.getItem(KEY);
    return kept === "bft" || kept in FACTORS ? kept : "m/s";
  } catch {
    return "m/s";
  }
}

export function choose(unit) {
  try {
    localStorage.setItem(KEY, unit);
  } catch {
    // Private windows keep nothing.
  }
}

export function beaufort(metersPerSecond) {
  const rounded = Math.round(metersPerSecond * 10) / 10;
  return BEAUFORT.filter((bound) => rounded >= bound).length;
}

// Figure and unit of a value; only speeds are converted.
export function shown(value, unit, choice = chosen()) {
  if (typeof value !== "number") return ["–", ""];
  if (unit !== "m/s") return [plain(value), unit === "1" ? "" : unit ?? ""];
  if (choice === "bft") return [String(beaufort(value)), "Bft"];
  return [(value * FACTORS[choice]).toFixed(1), choice];
}

export function worded(value, unit) {
  return together(...shown(value, unit));
}

// Values of a scale up to `greatest` that are round in the viewer's unit, each other in words: [value, words].
export function marks(greatest, unit, choice = chosen()) {
  if (unit === "m/s" && choice === "bft") return [0, ...BEAUFORT].map((bound, force) => [bound, String(force)]).filter(([bound]) => bound <= greatest);
  const factor = unit === "m/s" ? FACTORS[choice] : 1, raw = (greatest * factor) / 4, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 2.5, 5, 10].map((each) => each * power).find((each) => each >= raw) / factor;
  return Array.from({ length: Math.floor(greatest / step) + 1 }, (_, count) => [count * step, shown(count * step, unit, choice)[0]]);
}

function plain(value) {
  return Number.isInteger(value) ? String(value) : value.toFixed(Math.abs(value) < 100 ? 2 : 1);
}
