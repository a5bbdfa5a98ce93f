// Forms that send requests; each shows its answer in words.

import { h, setText } from "./dom.js";
import { askForToken, post, session } from "./session.js";

export function requestPath(key, name) {
  return `/api/${encodeURIComponent(key)}/request/${name}`;
}

export function answerBox() {
  return h("p", { class: "answer", role: "status", hidden: true });
}

export function tell(box, status, words) {
  box.hidden = false;
  box.className = `answer ${status === "ok" ? "ok" : status === "running" ? "" : "bad"}`;
  setText(box, words);
}

// Sends a request, with its button disabled meanwhile; returns the answer.
export async function send(button, box, path, parameters, running = "Under way ...") {
  const before = button.textContent;
  button.disabled = true;
  tell(box, "running", running);
  const [, answer] = await post(path, parameters);
  button.disabled = false;
  setText(button, before);
  tell(box, answer.status, answer.words ?? "Done.");
  return answer;
}

// A button that sends a request.
export function action(text, path, parameters, { quiet = false, running } = {}) {
  const box = answerBox();
  const button = h("button", { type: "button", class: quiet ? "quiet" : "", onclick: () => send(button, box, path, parameters(), running) }, text);
  return { button, box };
}

// Shows the first of two buttons or the other; who had the one on the keyboard has the other then.
export function swap(first, other, showFirst) {
  const [shown, hidden] = showFirst ? [first, other] : [other, first];
  if (hidden.hidden && !shown.hidden) return;
  const focused = document.activeElement === hidden;
  hidden.hidden = true;
  shown.hidden = false;
  if (focused) shown.focus();
}

// A change that is tried first and carried out by a second click.
export function twoSteps({ title, fields, path, parameters, describe, warning }) {
  const box = answerBox();
  const carry = h("button", { type: "button", hidden: true, onclick: async () => {
    carry.hidden = true;
    await send(attempt, box, path, parameters(), "Under way; this may take a minute ...");
  } }, "");
  const attempt = h("button", { type: "button", class: "quiet", onclick: async () => {
    carry.hidden = true;
    const answer = await send(attempt, box, path, { ...parameters(), dry_run: true }, "Trying it without a change ...");
    if (answer.status === "ok") {
      tell(box, "ok", `It can be done. ${warning}`);
      setText(carry, describe());
      carry.hidden = false;
      carry.focus();
    }
  } }, "Try it first (changes nothing)");
  const form = h("fieldset", { onchange: () => { carry.hidden = true; } }, h("legend", {}, title), h("div", { class: "row" }, fields, attempt, carry), box);
  return form;
}

export function field(text, input) {
  return h("label", {}, text, input);
}

// The controls, or why there are none.
export function guarded(build) {
  if (session.open) return build();
  if (!session.controls) return [h("p", { class: "empty" }, "This page is for reading: lfs10d web was started without a token.")];
  return [h("p", {}, h("button", { type: "button", class: "quiet", onclick: askForToken }, "Enter the token to poll, change, scan and mount"))];
}
