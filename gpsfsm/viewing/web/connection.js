// The head of the live page: whether the service can be reached, the token it asks for, the theme,
// and short messages.

import { el, replaceContent, visibleText } from "./dom.js";

const TOAST_MS = 8000;
const MOST_TOASTS = 4;

const SAID = {
  "": ["…", "connecting", "open"],
  connected: ["●", "connected", "good"],
  lost: ["○", "connection lost", "bad"],
  token: ["⚿", "token needed", "bad"],
};

// hooks: onToken(text). -> {show, describe, toast, head}; `show` says whether the service is back.
export function mountConnection(root, { onToken }) {
  const pill = el("span", { class: "connection", role: "status" });
  const facts = el("span", { class: "service-facts" });
  const searchPlace = el("div", { class: "search-place" });
  const tools = el("div", { class: "live-tools" });
  const head = el(
    "header",
    { class: "live-header" },
    el("h1", { class: "live-brand" }, "gpsfsm"),
    facts,
    el("span", { class: "live-gap" }),
    searchPlace,
    pill,
    tools,
  );
  const banner = el("div", { class: "live-banner", role: "alert", hidden: true });
  const toasts = el("div", { class: "toasts", role: "status", "aria-live": "polite" });
  root.append(head, banner);
  document.body.append(toasts);
  const shared = { away: false, form: null, refused: null };

  function show(state) {
    const again = state === "connected" && shared.away;
    shared.away = state === "lost" || (shared.away && state !== "connected");
    const [sign, words, kind] = SAID[state];
    pill.className = `connection ${kind}`;
    replaceContent(pill, el("span", { "aria-hidden": "true" }, sign), ` ${words}`);
    banner.hidden = state !== "lost" && state !== "token";
    if (state === "lost") {
      const words = "The service cannot be reached. What is shown stays; it is tried again, and the run goes on where it was.";
      replaceContent(banner, words);
    } else if (state === "token") {
      askForToken();
    }
    if (again) toast("The service is there again.");
    return again;
  }

  function askForToken() {
    if (banner.contains(shared.form)) {
      shared.refused.textContent = "This token was not accepted.";
      return;
    }
    const field = el("input", { type: "password", autocomplete: "off", spellcheck: "false", "aria-label": "Token of the service" });
    const send = el("button", { class: "button primary", type: "submit" }, "Use it");
    const refused = el("span", { class: "token-refused" });
    const form = el("form", { class: "token-form" }, el("label", {}, "This service asks for a token: ", field), send, refused);
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      if (field.value.trim()) onToken(field.value);
    });
    Object.assign(shared, { form, refused });
    replaceContent(banner, form);
    field.focus();
  }

  function toast(text) {
    const close = el("button", { class: "toast-close", type: "button", "aria-label": "Close" }, "×");
    const item = el("div", { class: "toast" }, el("span", {}, visibleText(text)), close);
    const gone = () => item.remove();
    close.addEventListener("click", gone);
    setTimeout(gone, TOAST_MS);
    toasts.append(item);
    while (toasts.children.length > MOST_TOASTS) toasts.firstChild.remove();
  }

  show("");
  return {
    show,
    toast,
    head,
    tools,
    searchPlace,
    describe(service) {
      const words = [`version ${service.version}`];
      if (!service.queue) words.push("checks only");
      words.push(service.model ? `model ${service.model}` : "no model");
      facts.textContent = words.join(" · ");
    },
  };
}
