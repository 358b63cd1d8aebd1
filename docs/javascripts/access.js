// What keyboards and screen readers lack in the theme.
document$.subscribe(() => {
  document.querySelector(".md-search")?.setAttribute("aria-label", "Search");

  // The name of the list of versions has to say what it shows. The list may come late.
  const named = () => {
    const list = document.querySelector(".md-version__current");
    list?.setAttribute("aria-label", `${list.innerText.trim()}: select version`);
  };
  named();
  new MutationObserver(named)
    .observe(document.querySelector(".md-header__topic"), { childList: true });

  // Tables that are wider than the page scroll in a box, which can be focused while it does.
  const focusable = (box) => {
    if (box.scrollWidth > box.clientWidth) {
      box.tabIndex = 0;
      box.setAttribute("role", "group");
      box.setAttribute("aria-label", "Table");
    } else for (const name of ["tabindex", "role", "aria-label"]) box.removeAttribute(name);
  };
  const sizes = new ResizeObserver((changes) => changes.forEach(({ target }) => focusable(target)));
  document.querySelectorAll(".md-typeset__scrollwrap").forEach((box) => sizes.observe(box));
});
