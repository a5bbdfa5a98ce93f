// What is shown of a sensor: its state in words, its value and its age, its curve. Old is never shown as live.

import { draw, watch } from "./curve.js";
import { ageText, h, setClass, setText, timeText } from "./dom.js";
import { live, now } from "./stream.js";
import { shown, worded } from "./units.js";

const WAY = 1; // s from the sensor to the eye, beyond three intervals

export function age(device) {
  return device.good_at === null || device.good_at === undefined ? null : Math.max(0, (now() - device.good_at) / 1000);
}

export function old(line, device) {
  const seconds = age(device);
  const interval = Math.max(device.interval ?? 1, device.interval === 0 ? line.line?.cycle_s ?? 1 : 0);
  return seconds === null || seconds > 3 * interval + WAY || device.online === false || !live() || line.source?.kind === "none";
}

export function main(device) {
  const name = Object.keys(device.values ?? {})[0];
  return name === undefined ? [null, Object.values(device.units ?? {})[0] ?? "m/s"] : [device.values[name], device.units[name]];
}

// [class, words] of a sensor's state.
export function state(line, device) {
  if (device.enabled === false) return ["", "disabled"];
  if (line.line?.activity === "paused") return ["", "the line is paused"];
  const gone = line.source?.kind === "none" || !live();
  if (device.fault && !gone) return ["bad", `${device.online ? "" : "offline: "}${device.fault.meaning} since ${timeText(device.fault.since, now())}`];
  if (device.error && device.error !== "starting" && !gone) return ["bad", device.error_words];
  if (old(line, device)) return ["", age(device) === null ? "no value yet" : "no new value"];
  const partly = device.errors ? Object.keys(device.errors) : [];
  return partly.length ? ["", `partly good: no ${partly.join(", ").replaceAll("_", " ")}`] : ["good", "good"];
}

export function ageWords(line, device) {
  if (!old(line, device) || device.enabled === false) return "";
  const seconds = age(device);
  return seconds === null ? "" : ` · last value ${ageText(seconds)}\u00a0ago`;
}

// The fields of a sensor that its card and its page share, and what fills them; `axis`: the tall curve, with a scale.
export function sensorFields(name, { span, title, axis = false }) {
  const figure = h("span"), unit = h("small"), words = h("span"), aged = h("span", { class: "age" });
  const speed = h("p", { class: "speed" }, figure, " ", unit), more = h("p", { class: "more" }), said = h("p", { class: "state" }, words, aged);
  const canvas = h("canvas", { class: axis ? "tall" : "", role: "img" });
  watch(canvas);
  return {
    speed, more, said, canvas,
    fill(box, line, device, points) {
      const [value, itsUnit] = main(device), [text, unitText] = shown(value, itsUnit), [kind, stateText] = state(line, device);
      setText(figure, text);
      setText(unit, unitText);
      setText(more, windWords(device, old(line, device)));
      setText(words, stateText);
      setText(aged, ageWords(line, device));
      setClass(said, "good", kind === "good");
      setClass(said, "bad", kind === "bad");
      setClass(box, "bad", kind === "bad");
      setClass(box, "old", old(line, device));
      const described = `${title} of ${name}: now ${text} ${unitText}, ${stateText}`;
      if (canvas.getAttribute("aria-label") !== described) canvas.setAttribute("aria-label", described);
      draw(canvas, points, { end: now() / 1000, span, unit: itsUnit, longest: 3 * (device.interval ?? 1) + 8, axis });
      return unitText;
    },
  };
}

// Gust, mean and direction, as far as the daemon publishes them; of an old value it is said that they are old too.
export function windWords(device, isOld) {
  const wind = device.wind, words = [];
  if (wind) {
    for (const [name, key] of [["gust", "gust_10m"], ["mean", "mean_10m"]]) {
      if (typeof wind[key] === "number") words.push(`${name} ${worded(wind[key], wind.unit ?? "m/s")}`);
    }
    if (typeof wind.direction_2m === "number") words.push(`from ${Math.round(wind.direction_2m)}°`);
  }
  for (const [name, value] of Object.entries(device.values ?? {}).slice(1)) {
    words.push(`${name.replaceAll("_", " ")} ${worded(value, device.units[name])}`);
  }
  return words.length && isOld ? `last known: ${words.join(" · ")}` : words.join(" · ");
}
