// One sensor: the last hour, its figures, its errors, its frames, its controls.

import { action, field, guarded, requestPath, swap, twoSteps } from "./controls.js";
import { facts, h, intervalText, renew, setText, timeText } from "./dom.js";
import { answers, frameList, lineNotices } from "./line.js";
import { notice } from "./overview.js";
import { sensorFields } from "./sensor.js";
import { now, site } from "./stream.js";
import { worded } from "./units.js";

export function devicePage(root, key, name) {
  const label = h("p", { class: "facts", dir: "auto" }), fields = sensorFields(name, { span: 3600, title: "Last hour", axis: true });
  const notices = h("div"), fault = h("div"), stats = h("div"), config = h("div"), wind = h("div"), frames = h("div"), replies = h("div");
  const box = h("div", { class: "big" }, fields.speed, fields.more, fields.said), controls = h("div");
  let hour = [], built = null;
  root.append(h("h1", {}, name), h("p", {}, h("a", { href: `/line/${encodeURIComponent(key)}`, "data-link": "" }, `Line ${key}`)), label, notices, box, fault,
    h("h2", {}, "The last hour"), fields.canvas, h("h2", {}, "Controls"), controls, replies,
    h("div", { class: "columns" }, h("section", {}, h("h2", {}, "Wind"), wind), h("section", {}, h("h2", {}, "Statistics"), stats), h("section", {}, h("h2", {}, "Configuration"), config)),
    h("h2", {}, "Last frames"), frames);
  let asked = 0;
  // Asked for again with each whole, for a phone that slept knows only what the whole has: ten minutes.
  const askForHour = () => {
    asked = site.wholes;
    fetch(`/api/${encodeURIComponent(key)}/curve/${encodeURIComponent(name)}`).then((response) => response.json()).then(({ points }) => { hour = points; }).catch(() => {});
  };
  askForHour();
  return () => {
    const line = site.lines[key], device = line?.devices[name];
    if (!device) {
      setText(label, site.known ? "There is no such sensor: it may have been renamed or removed." : "Looking for the sensor ...");
      return;
    }
    if (!built) {
      built = { update() {} };
      controls.replaceChildren(...guarded(() => {
        built = deviceControls(key, name, () => site.lines[key]?.devices[name] ?? device);
        return built.elements;
      }));
    }
    built.update(device);
    if (asked !== site.wholes) askForHour();
    const newest = hour.length ? hour.at(-1)[0] : 0;
    hour = [...hour, ...(device.curve ?? []).filter((point) => point[0] > newest)].slice(-900);
    setText(label, [device.label, device.id === null ? null : `id ${device.id}`].filter(Boolean).join(" · "));
    const unitText = fields.fill(box, line, device, hour);
    renew(notices, lineNotices(line), () => lineNotices(line).map(notice));
    renew(fault, device.fault, () => device.fault ? faultBox(device.fault) : null);
    renew(stats, device.stats, () => statsTable(device.stats));
    renew(config, [device.config, device.profile, device.id, device.interval, device.enabled], () => configTable(device));
    renew(wind, [device.wind, unitText], () => windTable(device.wind));
    const own = (line.frames ?? []).filter((each) => line.line?.framing === "ascii" || Number.parseInt(each.hex, 16) === device.id || Number.parseInt(String(each.hex).slice(0, 2), 16) === device.id);
    renew(frames, own, () => frameList(own));
    const mine = (line.requests ?? []).filter((each) => each.parameters?.device === name);
    renew(replies, mine, () => answers(mine));
  };
}

function faultBox(fault) {
  const rest = [`${fault.count} times since ${timeText(fault.since, now())}: ${fault.message}.`, fault.remedy, fault.heard ? `Received last: ${fault.heard}` : ""];
  return notice({ title: `${fault.meaning[0].toUpperCase()}${fault.meaning.slice(1)} (${fault.code}).`, text: rest.filter(Boolean).join(" ") });
}

function statsTable(stats) {
  if (!stats) return h("p", { class: "empty" }, "Not published yet: every 30 s.");
  const ms = (value) => (typeof value === "number" ? `${value} ms` : null);
  return facts([["polls", stats.polls], ["good", stats.good], ["failed", Object.entries(stats.errors ?? {}).map(([code, count]) => `${code} ${count}`).join(", ") || "none"],
    ["answers within, half", ms(stats.rtt_ms?.p50)], ["answers within, 95 %", ms(stats.rtt_ms?.p95)], ["time-out", ms(stats.response_timeout_ms)], ["rest before each request", ms(stats.request_gap_ms)],
    ["last good value", stats.last_good_ts ? timeText(stats.last_good_ts, now()) : "never"]]);
}

function configTable(device) {
  const config = device.config ?? {};
  return facts([["slave id", device.id], ["profile", device.profile], ["interval", intervalText(device.interval ?? 1)], ["polled", device.enabled ? "yes" : "no: disabled"],
    ["response time-out", typeof config.response_timeout === "number" ? intervalText(config.response_timeout) : config.response_timeout], ["rest before each request", config.request_gap ? intervalText(config.request_gap) : null]]);
}

function windTable(wind) {
  if (!wind) return h("p", { class: "empty" }, "No wind statistics are published for it.");
  const speed = (value) => (typeof value === "number" ? worded(value, wind.unit ?? "m/s") : "–");
  const when = (ts) => (ts ? ` at ${timeText(ts, now())}` : "");
  const rows = [["mean of 2 min", speed(wind.mean_2m)], ["mean of 10 min", speed(wind.mean_10m)], ["gust (3 s) in 10 min", speed(wind.gust_10m) + when(wind.gust_10m_ts)], ["lull in 10 min", speed(wind.lull_10m) + when(wind.lull_10m_ts)],
    ["greatest value in 10 min", speed(wind.max_10m)], ["Beaufort", wind.beaufort ?? "–"], ["covered", typeof wind.coverage_10m === "number" ? `${Math.round(wind.coverage_10m * 100)} % of 10 min` : null]];
  if (typeof wind.direction_2m === "number") rows.push(["direction, 2 min", `${Math.round(wind.direction_2m)}°`]);
  if (wind.undersampled) rows.push(["gusts", "polled too seldom for gusts: at most 1 s between polls"]);
  return facts(rows);
}

const INTERVALS = [0.25, 0.5, 1, 2, 5, 10, 60];

function deviceControls(key, name, device) {
  const path = (request) => requestPath(key, request);
  const poll = action("Poll now", path("device/read"), () => ({ device: name }));
  const present = device().interval ?? 1, offered = INTERVALS.includes(present) ? INTERVALS : [...INTERVALS, present].sort((a, b) => a - b);
  const interval = h("select", {}, offered.map((each) => h("option", { value: `${Math.round(each * 1000)}ms`, selected: each === present }, intervalText(each))));
  const change = action("Set the interval", path("device/options"), () => ({ device: name, interval: interval.value }), { quiet: true });
  const enable = action("Enable", path("device/options"), () => ({ device: name, enabled: true }), { quiet: true });
  const disable = action("Disable", path("device/options"), () => ({ device: name, enabled: false }), { quiet: true });
  const trace = action("Trace for 1 min", path("line/trace"), () => ({ for: "1m" }), { quiet: true });
  const to = h("input", { type: "number", min: 1, max: 255, value: "", size: 4, inputMode: "numeric" });
  return {
    elements: [
      h("div", { class: "row" }, poll.button, field("Interval", interval), change.button, enable.button, disable.button, trace.button), poll.box, change.box, enable.box, disable.box, trace.box,
      twoSteps({ title: "Another slave id", fields: [field("New id", to)], path: path("device/readdress"), parameters: () => ({ device: name, to: Number(to.value) }),
        describe: () => `Change id ${device().id} to ${to.value} now`, warning: "The sensor itself will be written." }),
    ],
    // Of the two only the one that changes anything is offered.
    update({ enabled }) {
      swap(enable.button, disable.button, enabled === false);
    },
  };
}
