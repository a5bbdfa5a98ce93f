// All lines at a glance.

import { draw, watch } from "./curve.js";
import { h, renew, setClass, setText } from "./dom.js";
import { lineFacts, lineNotices } from "./line.js";
import { ageWords, main, old, state, windWords } from "./sensor.js";
import { now, site } from "./stream.js";
import { shown } from "./units.js";

export function overview(root) {
  const sections = new Map();
  const empty = h("p", { class: "empty" });
  root.append(h("h1", {}, "All lines"), empty);
  return () => {
    const keys = Object.keys(site.lines);
    setText(empty, !site.known ? "Looking for the daemons ..." : keys.length ? "" : "No line is configured: start lfs10d web with a configuration file.");
    empty.hidden = empty.textContent === "";
    for (const key of keys) {
      if (!sections.has(key)) {
        sections.set(key, section(key));
        root.append(sections.get(key).element);
      }
      sections.get(key).update(site.lines[key]);
    }
    for (const [key, each] of sections) if (!(key in site.lines)) { each.element.remove(); sections.delete(key); }
  };
}

function section(key) {
  const facts = h("p", { class: "facts" }), notices = h("div"), list = h("ul", { class: "cards" }), empty = h("p", { class: "empty" });
  const element = h("section", { "aria-label": `Line ${key}` },
    h("h2", {}, h("a", { href: `/line/${encodeURIComponent(key)}`, "data-link": "" }, key)), facts, notices, list, empty);
  const cards = new Map();
  return {
    element,
    update(line) {
      setText(facts, lineFacts(line));
      const noted = [...lineNotices(line), ...troubles(line)];
      renew(notices, noted, () => noted.map(notice));
      const order = line.order ?? [];
      setText(empty, line.known && !order.length ? "There are no sensors on this line yet: mount one from the page of the line." : "");
      empty.hidden = empty.textContent === "";
      for (const name of order) {
        if (!cards.has(name)) cards.set(name, card(key, name));
        if (line.devices[name]) cards.get(name).update(line, line.devices[name]);
      }
      for (const [name, each] of cards) if (!order.includes(name)) { each.element.remove(); cards.delete(name); }
      const wanted = order.map((name) => cards.get(name).element);
      if (wanted.some((each, index) => list.children[index] !== each)) list.replaceChildren(...wanted);
    },
  };
}

// Which sensors are silent and why, above the cards: with many sensors nobody finds them below.
function troubles(line) {
  if (line.source?.kind === "none" || line.error) return [];
  const bad = (line.order ?? []).map((name) => line.devices[name]).filter((device) => device?.fault);
  if (!bad.length) return [];
  const named = bad.slice(0, 4).map((device) => `${device.name} ${device.fault.meaning} (${device.fault.remedy})`);
  const rest = bad.length > 4 ? `; and ${bad.length - 4} more` : "";
  return [{ title: `${bad.length} of ${line.order.length} sensors ${bad.length === 1 ? "has" : "have"} a fault:`, text: `${named.join("; ")}${rest}` }];
}

export function notice({ title, text, mild }) {
  return h("div", { class: mild ? "notice mild" : "notice" }, h("p", {}, h("b", {}, title), text ? ` ${text}` : ""));
}

function card(key, name) {
  const part = (tag, kind) => h(tag, { class: kind });
  const link = h("a", { href: `/device/${encodeURIComponent(key)}/${encodeURIComponent(name)}`, "data-link": "" }, name);
  const label = h("span", { class: "label", dir: "auto" }), id = part("span", "id"), figure = h("span"), unit = h("small");
  const more = part("p", "more"), said = part("p", "state"), words = h("span"), aged = part("span", "age");
  const canvas = h("canvas", { role: "img" });
  watch(canvas);
  said.append(words, " ", aged);
  const box = h("article", { class: "card" }, h("h3", {}, link), id, label, h("p", { class: "speed" }, figure, " ", unit), more, canvas, said);
  return {
    element: h("li", {}, box),
    update(line, device) {
      const [value, itsUnit] = main(device), [text, unitText] = shown(value, itsUnit), [kind, stateText] = state(line, device);
      setText(label, device.label ?? "");
      setText(id, device.id === null ? "" : `id ${device.id}`);
      setText(figure, text);
      setText(unit, unitText);
      setText(more, windWords(device));
      setText(words, stateText);
      setText(aged, ageWords(line, device));
      setClass(said, "good", kind === "good");
      setClass(said, "bad", kind === "bad");
      setClass(box, "bad", kind === "bad");
      setClass(box, "old", old(line, device));
      const described = `Last ten minutes of ${name}: now ${text} ${unitText}, ${stateText}`;
      if (canvas.getAttribute("aria-label") !== described) canvas.setAttribute("aria-label", described);
      draw(canvas, device.curve ?? [], { end: now() / 1000, span: 600, unit: itsUnit, longest: 3 * (device.interval ?? 1) + 8 });
    },
  };
}
