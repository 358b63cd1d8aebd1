// Keys of the whole page, and the overlay that explains them.

import { el } from "./dom.js";

const TYPED_INTO = new Set(["INPUT", "TEXTAREA", "SELECT"]);

// bindKeys([{key: "f", word: "Show everything", run}, …]) -> unbind. Keys are those of
// KeyboardEvent.key; nothing is taken from fields in which one types.
export function bindKeys(bindings) {
  const byKey = new Map(bindings.flatMap((binding) => [].concat(binding.key).map((key) => [key, binding])));
  const onKey = (event) => {
    if (event.defaultPrevented || event.altKey || event.ctrlKey || event.metaKey) return;
    const { target } = event;
    if (TYPED_INTO.has(target.tagName) || target.isContentEditable) return;
    if (event.key === " " && target.closest("button, summary, a, [role=button]")) return;
    if (document.querySelector("dialog[open]")) return;
    const binding = byKey.get(event.key);
    if (!binding) return;
    event.preventDefault();
    binding.run();
  };
  document.addEventListener("keydown", onKey);
  return () => document.removeEventListener("keydown", onKey);
}

const KEY_WORDS = { " ": "space", ArrowUp: "↑", ArrowDown: "↓" };

// helpDialog(bindings, more) -> <dialog>; `more`: [[keys, words], …] of what panes do themselves.
export function helpDialog(bindings, more) {
  const rows = [...bindings.filter((one) => one.word).map((one) => [[].concat(one.key), one.word]), ...more];
  const dialog = el(
    "dialog",
    { class: "help", "aria-label": "Keys" },
    el("h2", {}, "Keys"),
    el(
      "div",
      { class: "help-columns" },
      el(
        "dl",
        {},
        rows.map(([keys, words]) => [
          el("dt", {}, keys.map((key) => [el("kbd", {}, KEY_WORDS[key] || key), " "])),
          el("dd", {}, words),
        ]),
      ),
    ),
    el(
      "p",
      {},
      "Click an element in the tree, the automaton or the text: it is shown in all three. ",
      "Drag to move the automaton, use the wheel to zoom, click a folded box to unfold it and the ",
      "sign ⊟ of a control to fold it.",
    ),
    el("form", { method: "dialog" }, el("button", { autofocus: true }, "Close")),
  );
  dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
  return dialog;
}
