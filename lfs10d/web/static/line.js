// One line: its state, its controls, its frames.

import { action, answerBox, field, guarded, requestPath, swap, tell, twoSteps } from "./controls.js";
import { ageText, facts, h, renew, setText, timeText, together } from "./dom.js";
import { notice } from "./overview.js";
import { main, old, state } from "./sensor.js";
import { now, site } from "./stream.js";
import { worded } from "./units.js";
import { post } from "./session.js";

export function lineFacts(line) {
  const { port, baudrate, databits, parity, stopbits, load_pct: load, polls_per_s: polls, activity, open } = line.line ?? {};
  const words = [];
  if (port) words.push(port);
  if (baudrate) words.push(`${together(baudrate, "baud")} ${databits ?? ""}${(parity ?? "").slice(0, 1).toUpperCase()}${stopbits ?? ""}`.trim());
  if (line.source?.kind !== "none") {
    if (typeof load === "number" && open !== false) words.push(`load ${together(Math.round(load), "%")}`);
    if (typeof polls === "number" && open !== false) words.push(together(polls.toFixed(1), "polls/s"));
    if (activity && activity !== "polling") words.push(activity.replaceAll("_", " "));
  }
  const broker = line.broker ?? {};
  if (line.source?.kind === "none" && line.reached) words.push(line.daemon === "offline" ? "daemon offline" : "no daemon");
  else words.push(broker.connected ? `broker connected${broker.waiting > 20 ? `, ${broker.waiting} samples wait` : ""}` : "broker away");
  return words.join(" · ");
}

// What is wrong between the daemon and this page: [title, what to do].
function away(line) {
  if (line.daemon === "offline") return ["The daemon is offline.", "Start it, or see its log: journalctl -u lfs10d."];
  if (line.reached) return ["There is no daemon.", "Is it running, with this line.name and this mqtt.base_topic?"];
  return ["The broker is away.", `Check the network and the broker${line.known ? "; the daemon measures on and keeps its samples" : ""}.`];
}

export function lineNotices(line) {
  const found = [];
  const source = line.source ?? { kind: "none", words: "" };
  if (source.kind === "none") {
    const [title, remedy] = away(line);
    found.push({ title, text: `${cap(source.words.replace(/^not live: /, ""))} ${remedy}` });
  } else if (source.kind === "status") {
    found.push({ title: "The broker is away.", text: `${line.broker?.waiting ?? 0} samples wait for it. These values come from the daemon's status file: ${source.words.replace(/^live from /, "")}.`, mild: true });
  }
  if (line.error) found.push({ title: `${cap(line.error.meaning)}`, text: `Since ${timeText(line.error.since, now())}: ${line.error.message}. ${line.error.remedy}` });
  else if (line.line?.open === false && source.kind !== "none") found.push({ title: "The port is not open.", text: line.line.activity === "paused" ? "The line is paused, and goes on by itself." : "" });
  if (line.line?.requests === "denied") found.push({ title: "The broker lets no request through.", text: "Check its topic rules for the daemon's user.", mild: true });
  if (line.info?.clock === "unsynced" && source.kind !== "none") found.push({ title: "The gateway's clock is not set.", text: "Times of its samples are wrong until it is; ages on this page are right.", mild: true });
  if (line.scan) found.push({ title: "A scan is under way.", text: together(Math.round(line.scan.percent ?? 0), "%"), mild: true });
  if (line.mounting?.running) found.push({ title: "Sensors are being mounted.", text: `${line.mounting.words} ${line.mounting.problem}`.trim(), mild: true });
  return found;
}

function cap(words) {
  return words ? `${words[0].toUpperCase()}${words.slice(1)}.` : "";
}

export function linePage(root, key) {
  const parts = Object.fromEntries(["notices", "facts", "sensors", "scan", "mounting", "mounted", "answers", "frames", "events"].map((name) => [name, h("div", { class: name.startsWith("mount") ? name : "" })]));
  const summary = h("p", { class: "facts" });
  let update = () => {};
  root.append(h("h1", {}, `Line ${key}`), summary, parts.notices, h("h2", {}, "Sensors"), parts.sensors,
    h("h2", {}, "Controls"), ...guarded(() => {
      const controls = lineControls(key, parts);
      update = controls.update;
      return controls.elements;
    }), parts.answers,
    h("div", { class: "columns" }, h("section", {}, h("h2", {}, "The line"), parts.facts), h("section", {}, h("h2", {}, "Events"), parts.events)),
    h("h2", {}, "Last frames"), parts.frames);
  return () => {
    const line = site.lines[key];
    if (!line) {
      setText(summary, site.known ? "There is no such line." : "Looking for the line ...");
      return;
    }
    setText(summary, lineFacts(line));
    renew(parts.notices, lineNotices(line), () => lineNotices(line).map(notice));
    const rows = (line.order ?? []).filter((name) => line.devices[name]).map((name) => {
      const device = line.devices[name];
      return [name, device.id, device.label ?? "", worded(...main(device)), state(line, device)[1], old(line, device)];
    });
    renew(parts.sensors, rows, () => rows.length ? sensorTable(key, rows) : h("p", { class: "empty" }, "There are no sensors on this line yet."));
    renew(parts.facts, [line.line, line.info, line.source], () => lineTable(line));
    renew(parts.events, line.events, () => eventList(line.events ?? []));
    renew(parts.frames, line.frames, () => frameList(line.frames ?? []));
    renew(parts.answers, line.requests, () => answers(line.requests ?? []));
    renew(parts.scan, line.scan, () => line.scan ? scanProgress(line.scan) : null);
    renew(parts.mounting, [line.mounting?.words, line.mounting?.problem], () => mountingState(line.mounting));
    const mounted = (line.mounting?.adopted ?? []).map((each) => [each, line.devices[each.device]]).map(([each, device]) => [each, device ? worded(...main(device)) : "", device ? state(line, device) : ["", ""]]);
    renew(parts.mounted, mounted, () => mountedList(key, mounted));
    update(line);
  };
}

function sensorTable(key, rows) {
  const head = ["sensor", "id", "label", "value", "state"].map((name) => h("th", { scope: "col", class: name === "label" ? "wide" : "" }, name));
  return h("div", { class: "table", tabIndex: 0, role: "region", "aria-label": "Sensors" }, h("table", {}, h("thead", {}, h("tr", {}, head)), h("tbody", {}, rows.map(([name, id, label, value, words, isOld]) =>
    h("tr", { class: isOld ? "old" : "" }, h("td", {}, h("a", { href: `/device/${encodeURIComponent(key)}/${encodeURIComponent(name)}`, "data-link": "" }, name)), h("td", {}, String(id ?? "")),
      h("td", { dir: "auto", class: "wide" }, label), h("td", { class: isOld ? "figure age" : "figure" }, value), h("td", {}, words))))));
}

function lineTable(line) {
  const { line: state = {}, info = {} } = line;
  const us = (value) => (typeof value === "number" ? `${(value / 1000).toFixed(2)} ms` : null);
  return facts([
    ["source", line.source?.words], ["port", state.port], ["framing", state.framing], ["activity", state.activity?.replaceAll("_", " ")],
    ["longest cycle", state.cycle_s ? `${state.cycle_s} s` : null], ["exchanges", state.exchanges],
    ["failed polls", Object.entries(state.errors ?? {}).map(([code, count]) => `${code} ${count}`).join(", ") || "none"],
    ["silence required", us(state.gap_required_us)], ["silence kept, least", us(state.gap_us?.min)],
    ["samples waiting", state.store?.depth], ["samples dropped", state.store?.dropped],
    ["gateway", info.host], ["version", info.version], ["clock", info.clock], ["running since", info.started ? timeText(info.started, now()) : null],
    ["changes not in the file", info.changes],
  ]);
}

export function answers(requests) {
  const newest = [...requests].reverse().slice(0, 6);
  if (!newest.length) return null;
  return [h("h2", {}, "Answers"), h("div", { role: "log", "aria-label": "Answers" }, newest.map((each) => h("div", { class: `answer ${each.status === "ok" ? "ok" : each.status === "running" ? "" : "bad"}` },
    h("b", {}, each.name), ` ${Object.entries(each.parameters ?? {}).map(([name, value]) => `${name} ${typeof value === "object" ? JSON.stringify(value) : value}`).join(", ")} at ${timeText(each.began, now())}: `,
    each.status === "running" ? "under way ..." : each.words, each.data?.found ? foundTable(each.data.found) : null)))];
}

function foundTable(found) {
  if (!found.length) return h("p", {}, "No device was found.");
  const head = ["id", "baud", "device"].map((name) => h("th", { scope: "col" }, name));
  return h("table", {}, h("thead", {}, h("tr", {}, head)), h("tbody", {}, found.map((each) => h("tr", {}, h("td", {}, String(each.id)), h("td", {}, String(each.baudrate)),
    h("td", {}, `${each.device ?? each.profile ?? "unknown device"}${each.id === 1 ? ", the factory id" : ""}${each.suspect ? ", suspect" : ""}${each.duplicate ? ", two devices?" : ""}`)))));
}

export function frameList(frames) {
  if (!frames.length) return h("p", { class: "empty" }, "Start a trace to see the frames on the line.");
  return h("ul", { class: "frames", tabIndex: 0, "aria-label": "Frames, the newest first" }, [...frames].reverse().slice(0, 60).map((each) =>
    h("li", {}, `${new Date(each.ts).toLocaleTimeString([], { hour12: false })} ${each.direction === "tx" ? "sent" : "received"} ${each.text} [${each.hex}]`)));
}

function eventList(events) {
  if (!events.length) return h("p", { class: "empty" }, "None since this page's server was started.");
  return h("ul", {}, [...events].reverse().slice(0, 12).map((each) => {
    const rest = Object.entries(each).filter(([name]) => !["v", "ts", "type", "time"].includes(name));
    return h("li", {}, `${timeText(each.ts, now())} ${String(each.type).replaceAll("_", " ")}: ${rest.map(([name, value]) => `${name} ${typeof value === "object" ? JSON.stringify(value) : value}`).join(", ")}`);
  }));
}

function scanProgress(scan) {
  const percent = Math.round(scan.percent ?? 0);
  return [h("progress", { max: 100, value: percent, "aria-label": "Progress of the scan" }), h("p", {}, `${percent} %, ${scan.baudrate} baud, id ${scan.slave}, about ${ageText(scan.remaining_s ?? 0)} to go`)];
}

function mountingState(mounting) {
  if (!mounting) return null;
  return [h("p", { class: "answer", role: "status" }, h("b", {}, mounting.words)), mounting.problem ? h("p", { class: "problem" }, mounting.problem) : null];
}

// Each with what it measures now: who turns its cups sees them turn.
function mountedList(key, mounted) {
  if (!mounted.length) return null;
  return h("ol", {}, mounted.map(([each, value, [kind, words]]) => h("li", {}, h("a", { href: `/device/${encodeURIComponent(key)}/${encodeURIComponent(each.device)}`, "data-link": "" }, each.words),
    h("p", { class: "speed" }, value), h("p", { class: `state ${kind}` }, words))));
}

function lineControls(key, parts) {
  const path = (name) => requestPath(key, name);
  const trace = action("Trace for 1 min", path("line/trace"), () => ({ for: "1m" }), { quiet: true });
  const length = h("select", {}, ["1m", "5m", "10m"].map((each) => h("option", { value: each }, each.replace("m", " min"))));
  const pause = action("Pause the line", path("line/pause"), () => ({ for: length.value }), { quiet: true });
  const cancel = action("Go on, end scan or trace", path("line/cancel"), () => ({}), { quiet: true });
  const ids = h("input", { value: "1-32", size: 8, inputMode: "numeric" });
  const scan = action("Scan", path("line/scan"), () => ({ ids: ids.value }), { running: "Scanning while polling goes on ..." });
  const stop = action("Cancel the scan", path("line/cancel"), () => ({}), { quiet: true });
  const names = h("input", { placeholder: "mast-top, mast-low", size: 18, autocapitalize: "none", autocomplete: "off", spellcheck: false, enterKeyHint: "go" });
  const box = answerBox();
  const begin = h("button", { type: "submit" }, "Mount sensors");
  const end = h("button", { type: "button", class: "quiet", hidden: true, onclick: () => post(`/api/${encodeURIComponent(key)}/mounting/stop`, {}) }, "All are mounted");
  const mount = async (event) => {
    event.preventDefault();
    const given = names.value.split(/[\s,]+/).filter(Boolean);
    const [status, answer] = await post(`/api/${encodeURIComponent(key)}/mounting/start`, { names: given });
    if (status !== 200) return tell(box, "lost", answer.words);
    box.hidden = true;
    form.scrollIntoView();
  };
  const rate = h("select", {}, ["9600", "19200"].map((each) => h("option", { value: each }, each)));
  const cycle = h("input", { type: "checkbox" });
  const reload = action("Read the files again", path("config/reload"), () => ({}), { quiet: true });
  const wishes = h("div", {}, h("p", {}, "Connect one factory-new sensor at a time. Each gets a free id, the line's rate, and is polled at once."), field("Names, in order (or none)", names));
  const form = h("form", { class: "mount", onsubmit: mount }, h("fieldset", {}, h("legend", {}, "Mount sensors one by one"), parts.mounting, parts.mounted, wishes, h("div", { class: "row" }, begin, end), box));
  const elements = [
    form,
    h("fieldset", {}, h("legend", {}, "Look for devices"), h("div", { class: "row" }, field("Slave ids", ids), scan.button, stop.button), parts.scan, scan.box, stop.box),
    h("fieldset", {}, h("legend", {}, "The line"), h("div", { class: "row" }, field("For", length), pause.button, cancel.button, trace.button, reload.button), pause.box, cancel.box, trace.box, reload.box),
    twoSteps({ title: "Another baud rate for all", fields: [field("To", rate), h("label", { class: "check" }, cycle, "sensors must be switched off and on")], path: path("line/baudrate"),
      parameters: () => ({ to: Number(rate.value), ...(cycle.checked ? { power_cycle: true } : {}) }), describe: () => `Move all to ${rate.value} baud now`, warning: "All sensors and the port will move; polling stops for a moment." }),
  ];
  // What is under way can be ended, and is not begun a second time.
  const update = (line) => {
    wishes.hidden = line.mounting?.running === true;
    swap(end, begin, wishes.hidden);
    stop.button.hidden = line.line?.activity !== "scanning";
  };
  return { elements, update };
}
