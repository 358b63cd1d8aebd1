// The view of a picture: cytoscape moves it (drag, wheel, pinch) and holds what can be pointed at,
// which is what is in view and large enough.

import { debounce, prefersLessMotion } from "./dom.js";
import { viewOf } from "./paint.js";

const FIT_PADDING = 24;
const LARGEST_FIT = 1.15;
const GOOD_TO_READ = 0.6;
const NUDGE_MARGIN = 50; // pixels
const MOST_TARGETS = 500;
const SMALLEST_TARGET = 5; // pixels
const TARGETS_WAIT_MS = 60;

const SHAPES = [
  {
    selector: "node",
    style: {
      width: "data(width)",
      height: "data(height)",
      shape: "rectangle",
      "background-opacity": 0,
      "border-width": 0,
      "overlay-opacity": 0,
      "z-index": "data(level)",
      "z-index-compare": "manual",
    },
  },
  { selector: "core", style: { "active-bg-opacity": 0 } },
];


// The camera of one pane. `box` is the pane, `touch` an element in it for cytoscape.
export class GraphCamera {
  constructor(box, touch) {
    this.box = box;
    this.picture = { items: [], groups: [], width: 1, height: 1 };
    this.fitted = false; // whether all of the picture is in view, and is to stay so
    this.cy = globalThis.cytoscape({
      container: touch,
      style: SHAPES,
      elements: [],
      autoungrabify: true,
      autounselectify: true,
      boxSelectionEnabled: false,
      minZoom: 0.02,
      maxZoom: 3,
      layout: { name: "preset" },
    });
    this.targetSoon = debounce(() => this.setTargets(), TARGETS_WAIT_MS);
    this.cy.on("viewport resize", this.targetSoon);
  }

  get zoom() {
    return this.cy.zoom();
  }

  // Another picture; the view stays where it is.
  setPicture(picture) {
    this.picture = picture;
    this.cy.elements().remove();
    this.targetSoon();
  }

  // What can be pointed at: the largest things in view.
  setTargets() {
    if (this.cy.destroyed()) return;
    const view = this.viewNow();
    const least = SMALLEST_TARGET / view.zoom;
    const isTarget = ({ box }) =>
      box.height >= least && box.x < view.right && box.x + box.width > view.left &&
      box.y < view.bottom && box.y + box.height > view.top;
    const shapes = [
      ...this.picture.groups.filter(isTarget).map(groupShape),
      ...this.picture.items.map(itemShape).filter((one, number) => isTarget(this.picture.items[number])),
    ];
    const wanted = new Map(shapes.slice(0, MOST_TARGETS).map((one) => [one.data.id, one]));
    this.cy.batch(() => {
      this.cy.nodes().forEach((node) => {
        const { x, y } = node.position();
        const same = wanted.get(node.id());
        if (same && same.position.x === x && same.position.y === y) wanted.delete(node.id());
        else this.cy.remove(node);
      });
      this.cy.add([...wanted.values()]);
    });
  }

  viewNow() {
    return viewOf(this.cy.pan(), this.cy.zoom(), this.box.clientWidth, this.box.clientHeight);
  }

  // All of it if that can be read, else its beginning, but for pictures that are large anyway.
  openView() {
    this.fit(false);
    const [width, height] = [this.box.clientWidth, this.box.clientHeight];
    const across = Math.min(0.9, (width - 2 * FIT_PADDING) / this.picture.width);
    if (this.cy.zoom() >= GOOD_TO_READ || across < GOOD_TO_READ || !height) return;
    const x = (width - this.picture.width * across) / 2;
    this.moveTo({ zoom: across, pan: { x, y: FIT_PADDING } }, false);
    this.fitted = false;
  }

  fit(animate = true) {
    const [width, height] = [this.box.clientWidth, this.box.clientHeight];
    if (!width || !height) return;
    const across = (width - 2 * FIT_PADDING) / this.picture.width;
    const along = (height - 2 * FIT_PADDING) / this.picture.height;
    const zoom = Math.min(LARGEST_FIT, across, along);
    this.moveTo({
      zoom,
      pan: {
        x: (width - this.picture.width * zoom) / 2,
        y: (height - this.picture.height * zoom) / 2,
      },
    }, animate);
    this.fitted = true;
  }

  moveTo(view, animate) {
    this.cy.stop(true);
    if (animate && !prefersLessMotion()) this.cy.animate(view, { duration: 160 });
    else this.cy.viewport(view);
  }

  // Into the middle, large enough to be read.
  showBox(box) {
    const [width, height] = [this.box.clientWidth, this.box.clientHeight];
    const fitting = Math.min((width - 80) / box.width, (height - 80) / box.height);
    const zoom = Math.min(Math.max(this.cy.zoom(), 0.9), Math.max(0.05, fitting), 1.3);
    const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
    this.fitted = false;
    this.moveTo({ zoom, pan: { x: width / 2 - x * zoom, y: height / 2 - y * zoom } }, true);
  }

  // As little movement as is needed to see the box; none if it is in view.
  nudgeTo(box) {
    const view = this.viewNow();
    const margin = NUDGE_MARGIN / view.zoom;
    const shift = (low, high, from, to) => {
      if (low >= from && high <= to) return 0;
      return low < from ? from + margin - low : to - margin - high;
    };
    const across = shift(box.x, box.x + box.width, view.left, view.right);
    const along = shift(box.y, box.y + box.height, view.top, view.bottom);
    if (!across && !along) return;
    this.fitted = false;
    const pan = { x: view.pan.x + across * view.zoom, y: view.pan.y + along * view.zoom };
    this.moveTo({ zoom: view.zoom, pan }, true);
  }

  zoomBy(factor) {
    this.fitted = false;
    this.cy.zoom({
      level: this.cy.zoom() * factor,
      renderedPosition: { x: this.box.clientWidth / 2, y: this.box.clientHeight / 2 },
    });
  }

  moveBy(x, y) {
    this.fitted = false;
    this.cy.panBy({ x, y });
  }

  // Keeps what stood at one place of the picture where it is seen, though it is elsewhere now.
  keep(before, after) {
    const { x, y } = this.cy.pan();
    const { zoom } = this;
    this.fitted = false;
    this.cy.viewport({ zoom, pan: { x: x + (before.x - after.x) * zoom, y: y + (before.y - after.y) * zoom } });
  }

  resized() {
    this.cy.resize();
    if (this.fitted) this.fit(false);
  }

  destroy() {
    this.cy.destroy();
  }
}

function shape(id, box, data, level) {
  return {
    group: "nodes",
    pannable: true, // dragging it moves the view
    data: { id, width: box.width, height: box.height, level, ...data },
    position: { x: box.x + box.width / 2, y: box.y + box.height / 2 },
  };
}

function groupShape(group) {
  const data = { node: -1, group: group.group, element: group.element, folded: false };
  return shape(`g${group.group}`, group.box, data, group.depth);
}

function itemShape(item, number) {
  const data = { node: item.node, group: item.group, element: item.element, folded: item.kind === "folded" };
  return shape(`i${number}`, item.box, data, 100000);
}
