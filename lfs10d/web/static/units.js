// Speeds in the viewer's unit; the choice is kept by the browser.

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

function plain(value) {
  return Number.isInteger(value) ? String(value) : value.toFixed(Math.abs(value) < 100 ? 2 : 1);
}
