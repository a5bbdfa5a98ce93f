// Elements and texts. Nothing is ever set as HTML: what comes from a broker is text.

export function h(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "class") element.className = value;
    else if (name in element && name !== "list" && name !== "form") element[name] = value;
    else element.setAttribute(name, value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return element;
}

export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function setClass(element, name, on) {
  if (element.classList.contains(name) !== on) element.classList.toggle(name, on);
}

// Builds the content of an element anew where the data is other than last time.
export function renew(element, data, build) {
  const key = JSON.stringify(data);
  if (element.dataset.key === key) return;
  element.dataset.key = key;
  element.replaceChildren(...[build()].flat().filter((child) => child !== null && child !== undefined));
}

export function facts(rows) {
  const shown = rows.filter(([, value]) => value !== null && value !== undefined && value !== "");
  return h("table", {}, h("tbody", {}, shown.map(([name, value]) => h("tr", {}, h("th", { scope: "row" }, name), h("td", {}, String(value))))));
}

// Figure and unit with a space that never breaks.
export function together(figure, unit) {
  return unit ? `${figure}\u00a0${unit}` : String(figure);
}

export function ageText(seconds) {
  if (seconds < 100) return together(Math.round(seconds), "s");
  if (seconds < 6000) return together(Math.round(seconds / 60), "min");
  if (seconds < 360000) return together(Math.round(seconds / 3600), "h");
  return together(Math.round(seconds / 86400), "days");
}

export function timeText(ts, now) {
  const then = new Date(ts);
  if (Number.isNaN(then.getTime())) return "?";
  const clock = then.toLocaleTimeString([], { hour: "2-digit", minute: "2-digit", hour12: false });
  const today = new Date(now).toDateString() === then.toDateString();
  return today ? clock : `${then.toLocaleDateString([], { day: "numeric", month: "short" })} ${clock}`;
}

export function intervalText(seconds) {
  if (seconds === 0) return "as fast as the line allows";
  return seconds < 1 ? together(Math.round(seconds * 1000), "ms") : seconds % 60 === 0 ? together(seconds / 60, "min") : together(seconds, "s");
}
