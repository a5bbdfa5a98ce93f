// The one stream: the whole at first, then what changed. It resumes by itself, and knows how old it is.

const SILENT = 5; // s without any event after which nothing is live

export const site = { lines: {}, known: false, wholes: 0 };
const POINTS = 180;
const DRIFT = 0.01; // by which the two sides' clocks may differ

let asleep = false; // hidden or frozen: what is seen first on waking is the page as it was
let source = null, listener = () => {};
// Our clock: ms up to the last event, and both of the browser's clocks then.
let clock = 0, ticks = performance.now(), date = Date.now();
let ahead = -Date.now(); // by how much our clock is ahead of the server's, of an event that came without delay
let anew = true; // the next event is the first of its connection
let sent = -Infinity; // when the newest event was sent, by our clock

// While a phone sleeps one of its two clocks may stand still, so the larger step counts.
function local() {
  return clock + Math.max(performance.now() - ticks, Date.now() - date, 0);
}

// Epoch ms of the server.
export function now() {
  return local() - ahead;
}

// s since the newest event was sent: one that waited for a sleeping phone to wake is old when it comes.
export function silentFor() {
  return (local() - sent) / 1000;
}

export function sleeping() {
  return asleep;
}

export function live() {
  return silentFor() < SILENT && !asleep;
}

export function start(onChange) {
  listener = onChange;
  open();
  const look = (sleeps) => {
    asleep = sleeps;
    if (!asleep && silentFor() >= SILENT) open();
    listener();
  };
  const byVisibility = () => look(document.visibilityState === "hidden");
  for (const name of ["visibilitychange", "resume"]) document.addEventListener(name, byVisibility);
  for (const name of ["pageshow", "online"]) window.addEventListener(name, byVisibility);
  document.addEventListener("freeze", () => look(true));
  window.addEventListener("pagehide", () => look(true));
  setInterval(() => {
    if (silentFor() > 2 * SILENT && document.visibilityState === "visible") open();
  }, 1000 * SILENT);
}

// Begins with the whole, for what a server kept is old; the browser itself resumes after a short interruption.
function open() {
  source?.close();
  anew = true;
  source = new EventSource("/api/events");
  source.addEventListener("state", (event) => take(event, (data) => {
    site.lines = data.lines;
    site.known = true;
    site.wholes += 1;
  }));
  source.addEventListener("change", (event) => take(event, (data) => merge(data.lines)));
  source.onerror = () => {
    if (source.readyState === EventSource.CLOSED) setTimeout(() => silentFor() >= SILENT && open(), 2000);
  };
}

function take(event, apply) {
  const data = JSON.parse(event.data), here = local();
  ahead = anew ? here - data.now : Math.min(ahead + DRIFT * (here - clock), here - data.now);
  anew = false;
  sent = data.now + ahead;
  clock = here;
  ticks = performance.now();
  date = Date.now();
  apply(data);
  listener(data.lines);
}

function merge(lines) {
  for (const [key, delta] of Object.entries(lines)) {
    const line = (site.lines[key] ??= { devices: {}, order: [], frames: [], requests: [] });
    const { devices = {}, frames = [], ...rest } = delta;
    Object.assign(line, rest);
    line.frames = [...(line.frames ?? []), ...frames].slice(-200);
    for (const [name, { points = [], ...device }] of Object.entries(devices)) {
      const known = (line.devices[name] ??= { curve: [] });
      Object.assign(known, device);
      known.curve ??= [];
      for (const point of points) if (!known.curve.length || point[0] > known.curve.at(-1)[0]) known.curve.push(point);
      if (known.curve.length > POINTS) known.curve.splice(0, known.curve.length - POINTS);
    }
    for (const name of Object.keys(line.devices)) if (!line.order.includes(name)) delete line.devices[name];
  }
}
