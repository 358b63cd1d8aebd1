// A list of rows of the same height of which only those in view are in the page.

import { el, oncePerFrame } from "./dom.js";

const EXTRA_ROWS = 8;
// Browsers draw no element that is higher than some 33 million pixels.
const HIGHEST = 16_000_000;
const PRINTED_ROWS = 4000;

// virtualRows(scroller, {rowHeight, row, classes}) -> {setCount, redraw, restyle, show, …}
//   row(number) -> element; it is made again whenever it comes into view or is redrawn
//   classes(number) -> its classes; restyle() sets only these and what update(element, number)
//   changes, which is what pointing at rows and playing needs
/**
 * @param {HTMLElement} scroller
 * @param {{rowHeight: number, row: (number: number) => HTMLElement, classes: (number: number) => string,
 *   update?: (element: HTMLElement, number: number) => void}} options
 */
export function virtualRows(scroller, { rowHeight, row, classes, update = () => {} }) {
  const room = el("div", { class: "rows-room" });
  scroller.append(room);
  let count = 0;
  const paper = matchMedia("print");
  let printing = false;
  let drawn = new Map(); // number -> row
  // Kept here, since asking the page for them would make it lay itself out at once.
  let height = scroller.clientHeight;
  let scrolled = 0;

  function draw(keep = false) {
    if (!printing && !height) {
      drawn = new Map(); // in a tab that is not shown; drawn when it is
      room.replaceChildren();
      return;
    }
    const [first, last] = printing ? [0, Math.min(count, PRINTED_ROWS)] : inView();
    const fragment = document.createDocumentFragment();
    const before = drawn;
    drawn = new Map();
    for (let number = first; number < last; number += 1) {
      const made = (keep && before.get(number)) || row(number);
      made.className = classes(number);
      update(made, number);
      if (!printing) made.style.top = `${number * rowHeight}px`;
      drawn.set(number, made);
      fragment.append(made);
    }
    if (printing && count > PRINTED_ROWS) {
      fragment.append(el("p", {}, `… ${count - PRINTED_ROWS} more rows are not printed`));
    }
    room.replaceChildren(fragment);
  }

  function inView() {
    const first = Math.floor(scrolled / rowHeight) - EXTRA_ROWS;
    const last = Math.ceil((scrolled + height) / rowHeight) + EXTRA_ROWS;
    return [Math.max(0, first), Math.min(count, last)];
  }

  function restyle() {
    for (const [number, made] of drawn) {
      const names = classes(number);
      if (made.className !== names) made.className = names;
      update(made, number);
    }
  }

  // What scrolls into view is made, what is there already stays. On paper all is there, and it is as
  // high as its rows: to make some because it has grown would go on and on.
  function scroll() {
    if (printing || paper.matches) return;
    scrolled = scroller.scrollTop;
    height = scroller.clientHeight;
    const [first, last] = inView();
    if (drawn.has(first) && drawn.has(last - 1) && drawn.size <= last - first) return;
    draw(true);
  }

  const redraw = oncePerFrame(() => draw());
  const rescroll = oncePerFrame(scroll);
  const print = (on) => () => {
    if (printing === on) return;
    printing = on;
    scroller.classList.toggle("printing", on);
    draw();
  };
  const [before, after] = [print(true), print(false)];
  const changed = () => (paper.matches ? before() : after());
  scroller.addEventListener("scroll", rescroll, { passive: true });
  addEventListener("beforeprint", before);
  addEventListener("afterprint", after);
  paper.addEventListener("change", changed);
  const watcher = new ResizeObserver(scroll);
  watcher.observe(scroller);

  return {
    setCount(number) {
      count = Math.min(number, Math.floor(HIGHEST / rowHeight));
      room.style.height = `${count * rowHeight}px`;
      draw();
    },
    redraw,
    restyle: oncePerFrame(restyle),
    // Scrolls as little as is needed to see the row; far ones come into the middle.
    show(number) {
      const top = number * rowHeight;
      const visible = top >= scrolled && top + rowHeight <= scrolled + height;
      if (visible || !height) return;
      const highest = Math.max(0, count * rowHeight - height);
      scrolled = Math.min(highest, Math.max(0, top - (height - rowHeight) / 2));
      scroller.scrollTop = scrolled;
      draw(true);
    },
    pageSize: () => Math.max(1, Math.floor(height / rowHeight) - 1),
    destroy() {
      watcher.disconnect();
      removeEventListener("beforeprint", before);
      removeEventListener("afterprint", after);
      paper.removeEventListener("change", changed);
      room.remove();
    },
  };
}
