"""What holds of every page: axe-core has no serious objection to it, and it fits its window."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any, Literal

import pytest

from tests.browser_support import NEXT_FRAME
from tests.conftest import REPO

if TYPE_CHECKING:
    from collections.abc import Sequence

    from playwright.sync_api import Page

__all__ = ["audited", "misfits", "needs_axe", "objections"]

SIZES = (1280, 800), (390, 844)
"""Windows of a desk and of a phone."""
_AXE = REPO / "node_modules" / "axe-core" / "axe.min.js"
_RUN = """async () => {
  const result = await axe.run(document, { resultTypes: ["violations"] });
  return result.violations
    .filter(({ impact }) => impact === "serious" || impact === "critical")
    .flatMap(({ id, help, nodes }) => nodes.map(
      ({ target, any, all, none }) => [
        id, target.join(" "),
        [...any, ...all, ...none].map(({ message }) => message).join("; ") || help,
      ].join(": "),
    ));
}"""

_CONTROLS = "a[href], button, input, select, textarea, summary, [role=tab], [role=menuitem]"
_MISFITS = """async ([selector, least]) => {
  const misfits = [];
  const root = document.scrollingElement;
  if (root.scrollWidth > root.clientWidth) {
    misfits.push(`the page is ${root.scrollWidth} wide, the window ${root.clientWidth}`);
  }
  const nameOf = (one) => {
    const label = one.getAttribute("aria-label") || one.labels?.[0]?.innerText;
    const words = label || one.innerText || "";
    return `${one.tagName.toLowerCase()}.${one.className} '${words.trim().slice(0, 40)}'`;
  };
  const shown = (one) => one.checkVisibility({ visibilityProperty: true });
  const dialog = document.querySelector("dialog[open]");
  const before = [root.scrollLeft, root.scrollTop];
  for (const one of (dialog || document).querySelectorAll(selector)) {
    if (!shown(one)) continue;
    const scrolled = [];
    for (let at = one.parentElement; at; at = at.parentElement) {
      scrolled.push([at, at.scrollLeft, at.scrollTop]);
    }
    one.scrollIntoView({ block: "center", inline: "center", behavior: "instant" });
    const target = one.labels?.length && !one.offsetHeight ? one.labels[0] : one;
    const box = target.getBoundingClientRect();
    const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
    if (box.x < -1 || box.right > innerWidth + 1) {
      misfits.push(`${nameOf(one)} reaches from ${Math.round(box.x)} to ${Math.round(box.right)}`);
    } else {
      const there = document.elementFromPoint(x, y);
      if (!there) misfits.push(`${nameOf(one)} is out of view`);
      else if (!target.contains(there) && !there.closest("label")?.contains(one)) {
        misfits.push(`${nameOf(one)} is covered by ${nameOf(there)}`);
      }
      const label = one.labels?.[0]?.getBoundingClientRect();
      const across = Math.max(box.width, label?.width || 0);
      const down = Math.max(box.height, label?.height || 0);
      if (Math.min(across, down) < least) {
        misfits.push(`${nameOf(one)} is ${Math.round(across)} by ${Math.round(down)}`);
      }
    }
    for (const [at, left, top] of scrolled) Object.assign(at, { scrollLeft: left, scrollTop: top });
  }
  root.scrollTo({ left: before[0], top: before[1], behavior: "instant" });
  return misfits;
}"""
"""Each control is scrolled into view; there it must be whole, on top and large enough."""


_NO_AXE = "axe-core is not installed: npm install --no-save axe-core"
needs_axe = pytest.mark.skipif(not _AXE.is_file(), reason=_NO_AXE)
"""For a test that would leave something behind if it was skipped at its first audit."""


@cache
def _axe() -> str:
    if not _AXE.is_file():
        pytest.skip(_NO_AXE)
    return _AXE.read_text(encoding="utf-8")


def objections(page: Page) -> list[str]:
    """What axe-core calls serious or critical, with the elements that it means."""
    page.evaluate(_axe())
    violations: list[str] = page.evaluate(_RUN)
    return violations


def audited(
    page: Page,
    *,
    sizes: Sequence[tuple[int, int]] = SIZES,
    themes: Sequence[Literal["light", "dark"]] = ("light", "dark"),
    fits: bool = True,
) -> list[str]:
    """What is wrong with a page in windows of these sizes and in these themes; at the end of it the
    page is as it was, in a window of the first size."""
    complaints = []
    for width, height in sizes:
        page.set_viewport_size({"width": width, "height": height})
        for theme in themes:
            page.emulate_media(color_scheme=theme)
            page.evaluate(NEXT_FRAME)
            complaints += [f"{width} {theme}: {each}" for each in objections(page)]
        if fits:
            complaints += [
                f"{width}: {each}" for each in misfits(page, least=24 if width < 600 else 18)
            ]
    page.emulate_media(color_scheme=themes[0])
    page.set_viewport_size({"width": sizes[0][0], "height": sizes[0][1]})
    page.evaluate(NEXT_FRAME)
    return complaints


def misfits(page: Page, *, least: int = 24) -> list[str]:
    """Controls that a hand cannot reach or hit, and a page that is wider than its window."""
    arguments: Any = [_CONTROLS, least]
    places: list[str] = page.evaluate(_MISFITS, arguments)
    return places
