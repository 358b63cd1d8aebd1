// Light or dark: as the system has it, or as the button says.

import { el } from "./dom.js";

const THEME_KEY = "gpsfsm-theme";
const THEMES = ["auto", "light", "dark"];
const THEME_SIGNS = { auto: "◐", light: "☀", dark: "☾" };

// Storage is refused in some pages that are opened from disk.
function storedTheme() {
  try {
    return localStorage.getItem(THEME_KEY) || "auto";
  } catch {
    return "auto";
  }
}

function keepTheme(theme) {
  try {
    localStorage.setItem(THEME_KEY, theme);
  } catch {
    // It is then forgotten when the page is closed.
  }
}

// themeButton() -> <button> with a method `next()`
export function themeButton() {
  let theme = storedTheme();
  if (!THEMES.includes(theme)) theme = "auto";
  const button = el("button", { type: "button", class: "tool theme-button" });
  function show() {
    const title = `Theme: ${theme} (t)`;
    button.textContent = THEME_SIGNS[theme];
    button.title = title;
    button.setAttribute("aria-label", title);
    if (theme === "auto") delete document.documentElement.dataset.theme;
    else document.documentElement.dataset.theme = theme;
  }
  button.next = () => {
    theme = THEMES[(THEMES.indexOf(theme) + 1) % THEMES.length];
    keepTheme(theme);
    show();
  };
  button.addEventListener("click", button.next);
  // Paper is light.
  addEventListener("beforeprint", () => (document.documentElement.dataset.theme = "light"));
  addEventListener("afterprint", show);
  show();
  return button;
}
