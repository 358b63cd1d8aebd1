// Links into a page: what stands behind the "#" of its address says what is shown.
//
//   #plan=2&finding=GP303:6:5&step=4    in the second plan this finding, its scenario at step 4
//   #element=/Plan/Control.2/Runner.1   this element of the plan
//   #play=task&step=2   #view=compare&step=3   #run=7&at=1500000   #draft=… (see draftlink.js)
//
// A finding is named by rule, line and column, an element by its path, so a link still fits a report
// that was made again.
// Anybody can write an address: what has no form of these is left out, and none of it gets into the page.

const LONGEST_FRAGMENT = 8400;
const LONGEST_KEY = 240;
const FRAGMENT_FORMS = {
  view: /^(?:plan|summary|compare)$/,
  plan: /^[1-9]\d{0,5}$/,
  finding: /^[\w-]{1,40}:\d{1,9}:\d{1,9}(?::[1-9]\d{0,5})?$/,
  element: /^\/[\w/.~!*'()@%-]{0,240}$/,
  play: /^task$/,
  step: /^\d{1,9}$/,
  run: /^[1-9]\d{0,8}$/,
  at: /^\d{1,15}$/,
  draft: /^[\w-]{1,8000}$/,
};
const WRITE_MS = 250; // browsers refuse to write the address much more often

export const LINK_REFUSED = "The link points to something that is not here. That part of it was ignored.";

// parseFragment("#plan=2", ["plan"]) -> {values: {plan: "2"}, clean}; clean: nothing was left out.
export function parseFragment(hash, names) {
  const values = {};
  const text = hash.replace(/^#/, "");
  if (text.length > LONGEST_FRAGMENT) return { values, clean: false };
  let clean = true;
  for (const part of text ? text.split("&") : []) {
    const [, name = "", value = ""] = /^([a-z]+)=(.*)$/.exec(part) || [];
    if (names.includes(name) && !(name in values) && FRAGMENT_FORMS[name].test(value)) values[name] = value;
    else clean = false;
  }
  return { values, clean };
}

// The same the other way round; what is undefined is left out.
export function formatFragment(values) {
  const parts = Object.entries(values).filter(([, value]) => value !== undefined);
  return parts.length ? `#${parts.map(([name, value]) => `${name}=${value}`).join("&")}` : "";
}

const placeKey = ({ rule, line, column }) => `${rule}:${Math.max(0, line)}:${Math.max(0, column)}`;

// "GP303:6:5"; "GP303:6:5:2" is the second one there.
export function findingKey(plan, number) {
  if (!plan.findings[number]) return undefined;
  const key = placeKey(plan.findings[number]);
  const before = plan.findings.slice(0, number).filter((one) => placeKey(one) === key).length;
  return before ? `${key}:${before + 1}` : key;
}

// The number of the finding, or -1.
export function findingOfKey(plan, key) {
  const [, place, nth = "1"] = /^(.*?:\d+:\d+)(?::(\d+))?$/.exec(key) || [];
  let left = Number(nth);
  return plan.findings.findIndex((one) => placeKey(one) === place && (left -= 1) === 0);
}

// "/Plan/Control.2/Runner.1"; undefined for none, and for one with a path that fits in no link.
export function elementKey(plan, number) {
  const path = plan.elements[number]?.path ?? "";
  if (!path.startsWith("/") || /\p{Surrogate}/u.test(path)) return undefined;
  const key = encodeURIComponent(path.replace(/\[(\d+)\]/g, ".$1")).replaceAll("%2F", "/").replaceAll("%40", "@");
  return key.length <= LONGEST_KEY ? key : undefined;
}

// The number of the element, or -1.
export function elementOfKey(plan, key) {
  return plan.elements.findIndex((_, number) => elementKey(plan, number) === key);
}

// Keeps the address and the page together -> {open, write, writeSoon, link}
//   names: what may stand in the address;  state(): what does now;  refuse(): part of a link is of no use
//   show(values): shows that; false, or a promise of it, if something of it is not there
//   write(isNew): a new entry of the history, or else the last one is changed
/** @param {{names: string[], state: () => object, show: (values: any) => any, refuse: () => void}} hooks */
export function bindAddress({ names, state, show, refuse }) {
  let shown = location.hash;
  let showing = 0;
  let timer = 0;
  const link = (hash) => location.href.split("#")[0] + hash;

  function write(isNew = false) {
    if (showing) return;
    clearTimeout(timer);
    const hash = formatFragment(state());
    if (hash === shown) return;
    shown = hash;
    try {
      history[isNew ? "pushState" : "replaceState"](null, "", link(hash));
    } catch {
      // Some browsers let no page from disk change its address; what is copied is right all the same.
    }
  }

  async function open() {
    const { values, clean } = parseFragment(location.hash, names);
    shown = location.hash;
    showing += 1;
    let whole = true;
    try {
      const answer = show(values);
      whole = answer instanceof Promise ? await answer : answer;
    } finally {
      showing -= 1;
    }
    if (clean && whole) return;
    refuse();
    write();
  }

  const again = () => location.hash !== shown && open();
  addEventListener("popstate", again);
  addEventListener("hashchange", again);
  return {
    open,
    write,
    writeSoon() {
      clearTimeout(timer);
      timer = setTimeout(write, WRITE_MS);
    },
    link: (values) => link(formatFragment(values)),
  };
}
