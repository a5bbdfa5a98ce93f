// The token: without it the page is for reading.

import { setText } from "./dom.js";

export const session = { controls: false, open: false };
const button = document.getElementById("session"), dialog = document.getElementById("login");
const form = document.getElementById("login-form"), token = document.getElementById("token"), problem = document.getElementById("login-problem");
let changed = () => {};

// Sends JSON to the page's server; returns [status, answer], status 0 where the server is away.
export async function post(path, body) {
  try {
    const response = await fetch(path, { method: "POST", headers: { "Content-Type": "application/json", "X-Lfs10d": "1" }, body: JSON.stringify(body), credentials: "same-origin" });
    const answer = await response.json().catch(() => ({ words: `The page's server answered ${response.status}.` }));
    if (response.status === 401) await look();
    return [response.status, answer];
  } catch {
    return [0, { status: "lost", words: "The page's server cannot be reached. Is the network there?" }];
  }
}

async function look() {
  try {
    const response = await fetch("/api/session", { credentials: "same-origin" });
    if (!response.ok) return;
    const { controls, open } = await response.json();
    const other = controls !== session.controls || open !== session.open;
    Object.assign(session, { controls, open });
    button.hidden = !controls;
    setText(button, open ? "Close controls" : "Enter token");
    if (other) changed();
  } catch {
    // The stream's banner tells that the server is away.
  }
}

export function askForToken() {
  setText(problem, "");
  dialog.showModal();
  token.focus();
}

export function initSession(onChange) {
  changed = onChange;
  button.addEventListener("click", async () => {
    if (!session.open) return askForToken();
    await post("/api/logout", {});
    await look();
  });
  document.getElementById("login-cancel").addEventListener("click", () => dialog.close());
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const [status, answer] = await post("/api/login", { token: token.value.trim() });
    if (status === 200) {
      token.value = "";
      dialog.close();
      await look();
    } else setText(problem, answer.words);
  });
  look();
}
