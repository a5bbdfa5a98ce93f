// The one stream: the whole at first, then what changed. It resumes by itself, and knows how old it is.

const SILENT = 5; // s without any event after which nothing is live

export const site = { lines: {}, known: false };
let heardNow = 0, heardAt = 0, heardDate = 0, lastId = "", source = null, listener = () => {};
const POINTS = 180;

// Epoch ms of the server. While a phone sleeps one of its two clocks may stand still, so the larger step counts.
export function now() {
  return heardNow + Math.max(performance.now() - heardAt, Date.now() - heardDate, 0);
}

export function silentFor() {
  return heardAt === 0 ? Infinity : Math.max(performance.now() - heardAt, Date.now() - heardDate) / 1000;
}

export function live() {
  return silentFor() < SILENT;
}

export function start(onChange) {
  listener = onChange;
  open();
  const wake = () => {
    if (document.visibilityState === "visible" && !live()) open();
  };
  document.addEventListener("visibilitychange", wake);
  window.addEventListener("pageshow", wake);
  window.addEventListener("online", wake);
  setInterval(() => {
    if (silentFor() > 2 * SILENT && document.visibilityState === "visible") open();
  }, 1000 * SILENT);
}

function open() {
  source?.close();
  source = new EventSource(lastId ? `/api/events?after=${encodeURIComponent(lastId)}` : "/api/events");
  source.addEventListener("state", (event) => take(event, (data) => {
    site.lines = data.lines;
    site.known = true;
  }));
  source.addEventListener("change", (event) => take(event, (data) => merge(data.lines)));
  source.onerror = () => {
    if (source.readyState === EventSource.CLOSED) setTimeout(() => !live() && open(), 2000);
  };
}

function take(event, apply) {
  const data = JSON.parse(event.data);
  lastId = event.lastEventId;
  heardNow = data.now;
  heardAt = performance.now();
  heardDate = Date.now();
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
