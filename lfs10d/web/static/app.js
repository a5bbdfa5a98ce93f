// The page: which view is shown, and what the bar above it says.

import { redrawAll } from "./curve.js";
import { devicePage } from "./device.js";
import { ageText, setClass, setText } from "./dom.js";
import { linePage } from "./line.js";
import { overview } from "./overview.js";
import { old } from "./sensor.js";
import { initSession } from "./session.js";
import { live, silentFor, site, sleeping, start } from "./stream.js";
import { choose, chosen } from "./units.js";

const root = document.getElementById("main"), banner = document.getElementById("banner"), unit = document.getElementById("unit");
let update = () => {};

function show() {
  const [, kind = "", key = "", name = ""] = location.pathname.split("/").map(decodeURIComponent);
  root.replaceChildren();
  if (kind === "line") update = linePage(root, key);
  else if (kind === "device") update = devicePage(root, key, name);
  else update = overview(root);
  refresh();
}

function refresh() {
  update();
  const lines = Object.values(site.lines), faults = lines.reduce((count, line) => count + (line.error ? 1 : 0)
    + Object.values(line.devices).filter((device) => device.fault).length, 0);
  setText(document.querySelector("title"), `${faults ? `${faults} ${faults === 1 ? "fault" : "faults"} - ` : ""}lfs10d`);
  const gone = silentFor(), away = lines.filter((line) => line.source?.kind === "none").length;
  if (live()) setText(banner, away ? `${away === 1 ? "One line is" : `${away} lines are`} not live` : liveWords(lines));
  else if (sleeping()) setText(banner, "NOT LIVE: this page was asleep.");
  else setText(banner, gone === Infinity ? "Connecting to the page's server ..."
    : `NOT LIVE: nothing has come from the page's server for ${ageText(gone)}. Is the network there? It is tried again by itself.`);
  setClass(banner, "wrong", (!live() && gone !== Infinity) || away > 0);
}

function liveWords(lines) {
  if (!lines.length) return "No line is shown";
  const polled = lines.flatMap((line) => Object.values(line.devices).map((device) => [line, device])).filter(([, device]) => device.enabled !== false);
  const silent = polled.filter(([line, device]) => old(line, device)).length;
  return silent ? `Live; ${silent} of ${polled.length} sensors without a new value` : "Live";
}

document.addEventListener("click", (event) => {
  const link = event.target.closest?.("a[data-link]");
  if (!link || event.ctrlKey || event.metaKey || event.shiftKey || event.button) return;
  event.preventDefault();
  history.pushState(null, "", link.href);
  show();
  window.scrollTo(0, 0);
  root.focus({ preventScroll: true });
});
window.addEventListener("popstate", show);
window.addEventListener("resize", redrawAll);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redrawAll);
unit.value = chosen();
unit.addEventListener("change", () => {
  choose(unit.value);
  refresh();
  redrawAll();
});
initSession(() => show());
show();
start(refresh);
setInterval(refresh, 1000);
