// All lines at a glance.

import { h, renew, setText, timeText } from "./dom.js";
import { lineFacts, lineNotices } from "./line.js";
import { sensorFields } from "./sensor.js";
import { now, site } from "./stream.js";

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
      const noted = [...lineNotices(line), ...troubles(key, line)];
      renew(notices, noted, () => noted.map(notice));
      const order = line.order ?? [];
      renew(empty, line.known && !order.length, () => (line.known && !order.length
        ? ["There are no sensors on this line yet: ", h("a", { href: `/line/${encodeURIComponent(key)}`, "data-link": "" }, "mount the first"), "."] : null));
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
function troubles(key, line) {
  if (line.source?.kind === "none" || line.error) return [];
  const bad = (line.order ?? []).map((name) => line.devices[name]).filter((device) => device?.fault);
  if (!bad.length) return [];
  const items = bad.slice(0, 4).map(({ name, fault }) => ({ name, href: `/device/${encodeURIComponent(key)}/${encodeURIComponent(name)}`,
    text: `${fault.meaning} since ${timeText(fault.since, now())}. ${fault.remedy}` }));
  const text = bad.length > 4 ? `The first four of ${bad.length}:` : "";
  return [{ title: `${bad.length} of ${line.order.length} sensors ${bad.length === 1 ? "has" : "have"} a fault.`, text, items }];
}

export function notice({ title, text, mild, items = [] }) {
  return h("div", { class: mild ? "notice mild" : "notice" }, h("p", {}, h("b", {}, title), text ? ` ${text}` : ""),
    items.length ? h("ul", {}, items.map((each) => h("li", {}, h("a", { href: each.href, "data-link": "" }, each.name), ` ${each.text}`))) : null);
}

function card(key, name) {
  const link = h("a", { href: `/device/${encodeURIComponent(key)}/${encodeURIComponent(name)}`, "data-link": "" }, name);
  const label = h("span", { class: "label", dir: "auto" }), id = h("span", { class: "id" });
  const fields = sensorFields(name, { span: 600, title: "Last ten minutes" });
  const box = h("article", { class: "card" }, h("h3", {}, link), id, label, fields.speed, fields.more, fields.canvas, fields.said);
  return {
    element: h("li", {}, box),
    update(line, device) {
      setText(label, device.label ?? "");
      setText(id, device.id === null ? "" : `id ${device.id}`);
      fields.fill(box, line, device, device.curve ?? []);
    },
  };
}
