// Speaks to the service: requests, streams of events, the token, whether it can be reached, and the
// head of the page, which shows that.
//
// A token is kept for the tab alone and shown in a header, never in an address. Streams are read
// with fetch, since an EventSource can show no header; a stream that breaks begins again behind the
// last event that has arrived, so that none is missed and none comes twice.

import { el, replaceContent, visibleText } from "./dom.js";

const TOKEN_KEY = "gpsfsm-token";
const FIRST_PAUSE_MS = 500;
const LONGEST_PAUSE_MS = 5000;
const SILENCE_MS = 45000; // the service sends a comment at least every 10 seconds

function beside(path) {
  return new URL(`.${path}`, document.baseURI);
}

export class ServiceError extends Error {
  constructor(status, detail, problem) {
    super(detail);
    this.name = "ServiceError";
    this.status = status;
    this.problem = problem || {};
    this.retryAfter = 0;
  }
}

// `onConnection` gets "connected", "lost" or "token", whenever that changes.
// Paths begin at the service, which a reverse proxy may show below a path of its own: /plant/v1/…
export function createClient({ onConnection, fetcher = (path, request) => fetch(beside(path), request) }) {
  /** @type {(() => void)[]} */
  const waiting = [];
  const shared = { connection: "", token: storedToken(), probing: false };

  function connectionIs(state) {
    if (shared.connection !== state) {
      shared.connection = state;
      onConnection(state);
    }
    if (state === "connected") {
      for (const go of waiting.splice(0)) {
        go();
      }
    } else if (state === "lost") {
      probe();
    }
  }

  async function probe() {
    if (shared.probing) {
      return;
    }
    shared.probing = true;
    let pause = FIRST_PAUSE_MS;
    while (shared.connection === "lost") {
      await sleep(pause);
      pause = Math.min(pause * 2, LONGEST_PAUSE_MS);
      try {
        const answer = await fetcher("/health", { cache: "no-store" });
        if (answer.status === 200) {
          connectionIs("connected");
        }
      } catch {
        // still away
      }
    }
    shared.probing = false;
  }

  /**
   * @param {string} method
   * @param {string} path
   * @param {{json?: any, signal?: AbortSignal, headers?: Record<string, string>}} options
   */
  async function ask(method, path, { json, signal, headers = {} } = {}) {
    /** @type {Record<string, string>} */
    const sent = { ...headers };
    if (shared.token) {
      sent.Authorization = `Bearer ${shared.token}`;
    }
    /** @type {RequestInit} */
    const request = { method, headers: sent, signal, cache: "no-store" };
    if (json !== undefined) {
      sent["Content-Type"] = "application/json";
      request.body = JSON.stringify(json);
    }
    let answer;
    try {
      answer = await fetcher(path, request);
    } catch (error) {
      if (error.name === "AbortError") {
        throw error;
      }
      connectionIs("lost");
      throw new ServiceError(0, "the service cannot be reached");
    }
    if (answer.status === 401) {
      connectionIs("token");
    } else {
      connectionIs("connected");
    }
    if (!answer.ok) {
      throw await failureOf(answer);
    }
    return answer;
  }

  async function request(method, path, options) {
    const answer = await ask(method, path, options);
    try {
      return await answer.json();
    } catch (error) {
      if (error.name === "AbortError") {
        throw error;
      }
      connectionIs("lost");
      throw new ServiceError(0, "the answer of the service was cut off");
    }
  }

  // Follows a stream until its "end" event or until `signal` says so. `after` is the number of the
  // last event that has arrived; `onEvent` gets {id, event, data} with data taken apart.
  /** @param {string} path @param {{after?: number | string, signal: AbortSignal, onEvent: (event: any) => void}} options */
  async function follow(path, { after = 0, signal, onEvent }) {
    let last = after;
    let pause = FIRST_PAUSE_MS;
    while (!signal.aborted) {
      try {
        const headers = { Accept: "text/event-stream" };
        if (last) {
          headers["Last-Event-ID"] = String(last);
        }
        const answer = await ask("GET", path, { headers, signal });
        const ended = await readStream(answer, signal, (message) => {
          pause = FIRST_PAUSE_MS;
          if (message.id) {
            last = Number(message.id);
          }
          onEvent(message);
        });
        if (ended) {
          return;
        }
      } catch (error) {
        if (signal.aborted || error.name === "AbortError") {
          return;
        }
        if (error instanceof ServiceError && error.status !== 0 && !passing(error.status)) {
          throw error;
        }
      }
      await waitFor(pause, signal);
      pause = Math.min(pause * 2, LONGEST_PAUSE_MS);
    }
  }

  // Until the service is there again, at most some time; at once if the stream alone has ended.
  function waitFor(pause, signal) {
    if (shared.connection === "connected") {
      return sleep(pause);
    }
    return new Promise((done) => {
      waiting.push(() => done(undefined));
      signal.addEventListener("abort", done, { once: true });
    });
  }

  function setToken(text) {
    shared.token = text.trim();
    keepToken(shared.token);
    shared.connection = "";
  }

  return {
    get: (path, options) => request("GET", path, options),
    post: (path, json, options) => request("POST", path, { ...options, json }),
    follow,
    setToken,
    connection: () => shared.connection,
  };
}

function passing(status) {
  return status === 401 || status === 429 || status >= 500;
}

async function failureOf(answer) {
  let problem = {};
  try {
    problem = await answer.json();
  } catch {
    // an answer that is no problem document; its status says enough
  }
  const detail = problem.detail || `the service answered with status ${answer.status}`;
  const error = new ServiceError(answer.status, detail, problem);
  error.retryAfter = Number(answer.headers.get("Retry-After")) || 0;
  return error;
}

// Reads events until the stream is over. Whether its last event was "end".
async function readStream(answer, signal, onMessage) {
  const reader = answer.body.getReader();
  const parser = eventParser(onMessage);
  const decoder = new TextDecoder();
  try {
    while (!parser.ended()) {
      const { done, value } = await patient(reader.read());
      if (done || signal.aborted) {
        break;
      }
      parser.feed(decoder.decode(value, { stream: true }));
    }
  } finally {
    reader.cancel().catch(() => {});
  }
  return parser.ended();
}

// A connection may die without a word; then nothing comes any more, not even a comment.
function patient(reading) {
  let timer;
  const silence = new Promise((_, refuse) => {
    timer = setTimeout(() => refuse(new ServiceError(0, "the stream is silent")), SILENCE_MS);
  });
  return Promise.race([reading, silence]).finally(() => clearTimeout(timer));
}

// Takes server-sent events apart, however the text is cut into pieces.
export function eventParser(onMessage) {
  let rest = "";
  /** @returns {{id: string, event: string, data: string[]}} */
  const emptyFields = () => ({ id: "", event: "", data: [] });
  let fields = emptyFields();
  let ended = false;

  function line(text) {
    if (text === "") {
      if (fields.data.length) {
        const event = fields.event || "message";
        ended = ended || event === "end";
        onMessage({ id: fields.id, event, data: JSON.parse(fields.data.join("\n")) });
      }
      fields = emptyFields();
      return;
    }
    const colon = text.indexOf(":");
    if (colon === 0) {
      return; // a comment
    }
    const name = colon < 0 ? text : text.slice(0, colon);
    const value = colon < 0 ? "" : text.slice(colon + 1).replace(/^ /, "");
    if (name === "data") {
      fields.data.push(value);
    } else if (name === "id" || name === "event") {
      fields[name] = value;
    }
  }

  return {
    feed(text) {
      const lines = (rest + text).split("\n");
      rest = lines.pop() ?? "";
      for (const each of lines) {
        line(each.endsWith("\r") ? each.slice(0, -1) : each);
      }
    },
    ended: () => ended,
  };
}

export function sleep(milliseconds) {
  return new Promise((done) => setTimeout(done, milliseconds));
}

function storedToken() {
  try {
    return sessionStorage.getItem(TOKEN_KEY) || "";
  } catch {
    return ""; // a browser that keeps nothing
  }
}

function keepToken(token) {
  try {
    if (token) {
      sessionStorage.setItem(TOKEN_KEY, token);
    } else {
      sessionStorage.removeItem(TOKEN_KEY);
    }
  } catch {
    // it is kept in memory alone
  }
}

// -- the head: whether the service can be reached, the token, the theme, and short messages ------

const TOAST_MS = 8000;
const MOST_TOASTS = 4;

const SAID = {
  "": ["…", "connecting", "open"],
  connected: ["●", "connected", "good"],
  lost: ["○", "connection lost", "bad"],
  token: ["●", "token needed", "ask"],
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
  /** @type {{away: boolean, form: HTMLElement | null, refused: HTMLElement}} */
  const shared = { away: false, form: null, refused: el("span", { class: "token-refused" }) };

  function show(state) {
    const again = state === "connected" && shared.away;
    shared.away = state === "lost" || (shared.away && state !== "connected");
    const [sign, words, kind] = SAID[state];
    pill.className = `connection ${kind}`;
    replaceContent(pill, el("span", { "aria-hidden": "true" }, sign), el("span", { class: "connection-words" }, ` ${words}`));
    pill.title = words;
    banner.hidden = state !== "lost" && state !== "token";
    banner.classList.toggle("asks", state === "token");
    if (state === "lost") {
      const words = "The service cannot be reached. The page keeps trying; a run continues where it was once the service is back.";
      replaceContent(banner, words);
    } else if (state === "token") {
      askForToken();
    }
    if (again) toast("The service is back.");
    return again;
  }

  function askForToken() {
    if (banner.contains(shared.form)) {
      shared.refused.textContent = "The service did not accept this token.";
      return;
    }
    const field = el("input", { type: "password", autocomplete: "off", spellcheck: "false", id: "service-token" });
    const send = el("button", { class: "button primary", type: "submit" }, "Sign in");
    shared.refused.textContent = "";
    const form = el(
      "form",
      { class: "token-form" },
      el("label", { for: "service-token" }, "Token of the service"),
      el("div", { class: "token-row" }, field, send),
      shared.refused,
      el("p", { class: "token-hint" }, "A line of the file that the service was started with: ", el("code", {}, "--token-file"), ". Closing this tab forgets it."),
    );
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      if (field.value.trim()) onToken(field.value);
    });
    shared.form = form;
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
      if (service.real) words.push("real runners");
      words.push(service.model ? `model ${service.model}` : "no model");
      facts.textContent = words.join(" · ");
    },
  };
}
