// A pen that writes SVG: what paint.js needs of a canvas, so that one picture can be painted on both.
// Nothing in it is loaded from elsewhere: colours are written out, and the font is whatever is there.

import { el, svg, visibleText } from "./dom.js";

const NO_XML = /\p{Surrogate}|[\ufffe\uffff]/gu;
const ANCHORS = { left: "start", center: "middle", right: "end" };
const short = (value) => String(Math.round(value * 100) / 100);

export class SvgPen {
  fillStyle = "#000";
  strokeStyle = "#000";
  lineWidth = 1;
  globalAlpha = 1;
  font = "10px sans-serif";
  textAlign = "left";
  lineJoin = "miter";
  /** @type {any} */
  ruler = null;

  constructor() {
    this.path = "";
    this.dash = [];
    this.shift = [0, 0];
    this.kept = [];
    this.here = [0, 0];
    this.marks = [];
  }

  save() {
    this.kept.push(this.shift);
  }

  restore() {
    this.shift = this.kept.pop() || [0, 0];
  }

  translate(x, y) {
    this.shift = [this.shift[0] + x, this.shift[1] + y];
  }

  setLineDash(dash) {
    this.dash = dash;
  }

  // -- paths

  beginPath() {
    this.path = "";
  }

  to(letter, x, y, before = "") {
    this.here = [x, y];
    this.path += `${letter}${before}${short(x + this.shift[0])} ${short(y + this.shift[1])}`;
  }

  moveTo(x, y) {
    this.to("M", x, y);
  }

  lineTo(x, y) {
    this.to(this.path ? "L" : "M", x, y);
  }

  closePath() {
    this.path += "Z";
  }

  round(radius, x, y, clockwise = 1) {
    this.to("A", x, y, `${short(radius)} ${short(radius)} 0 0 ${clockwise} `);
  }

  rect(x, y, width, height) {
    this.roundRect(x, y, width, height, 0);
  }

  roundRect(x, y, width, height, wanted) {
    const radius = Math.max(0, Math.min(wanted, width / 2, height / 2));
    const [right, bottom] = [x + width, y + height];
    const corner = (toX, toY) => radius && this.round(radius, toX, toY);
    this.moveTo(x + radius, y);
    this.lineTo(right - radius, y);
    corner(right, y + radius);
    this.lineTo(right, bottom - radius);
    corner(right - radius, bottom);
    this.lineTo(x + radius, bottom);
    corner(x, bottom - radius);
    this.lineTo(x, y + radius);
    corner(x + radius, y);
    this.closePath();
  }

  // Whole circles only: paint.js draws no others.
  arc(x, y, radius) {
    this.moveTo(x + radius, y);
    this.round(radius, x - radius, y);
    this.round(radius, x + radius, y);
    this.closePath();
  }

  // From here towards a corner, around it, and on towards a point.
  arcTo(x, y, toX, toY, radius) {
    const [fromX, fromY] = this.here;
    const one = [fromX - x, fromY - y];
    const other = [toX - x, toY - y];
    const [long, far] = [Math.hypot(...one), Math.hypot(...other)];
    const turn = one[0] * other[1] - one[1] * other[0];
    const cosine = (one[0] * other[0] + one[1] * other[1]) / (long * far || 1);
    if (!radius || Math.abs(turn) < 1e-6) {
      this.lineTo(x, y);
      return;
    }
    const cut = radius / Math.tan(Math.acos(Math.max(-1, Math.min(1, cosine))) / 2);
    this.lineTo(x + (one[0] / long) * cut, y + (one[1] / long) * cut);
    this.round(radius, x + (other[0] / far) * cut, y + (other[1] / far) * cut, turn < 0 ? 1 : 0);
  }

  fill() {
    this.put({ fill: this.fillStyle });
  }

  stroke() {
    this.put({
      fill: "none", stroke: this.strokeStyle, "stroke-width": short(this.lineWidth), "stroke-linejoin": this.lineJoin,
      "stroke-dasharray": this.dash.length ? this.dash.map(short).join(" ") : null,
    });
  }

  put(style) {
    if (!this.path) return;
    this.marks.push(svg("path", { d: this.path, ...style, opacity: this.alpha }));
  }

  get alpha() {
    return this.globalAlpha < 1 ? short(this.globalAlpha) : null;
  }

  // -- words

  fillText(text, x, y, most = Infinity) {
    const isWide = most < Infinity && this.widthOf(text) > most;
    const fitted = isWide ? { textLength: short(most), lengthAdjust: "spacingAndGlyphs" } : {};
    this.write(text, x, y, { fill: this.fillStyle, ...fitted });
  }

  widthOf(text) {
    this.ruler ??= el("canvas").getContext("2d");
    this.ruler.font = this.font.replace(/px .*/, "px sans-serif");
    return this.ruler.measureText(text).width;
  }

  strokeText(text, x, y) {
    this.write(text, x, y, {
      fill: "none", stroke: this.strokeStyle, "stroke-width": short(this.lineWidth), "stroke-linejoin": "round",
      "aria-hidden": "true",
    });
  }

  write(text, x, y, style) {
    const [, weight, size] = /^(?:(\d+) )?([\d.]+)px/.exec(this.font) || [];
    this.marks.push(
      svg(
        "text",
        {
          x: short(x + this.shift[0]), y: short(y + this.shift[1]), ...style, "font-size": size, "font-weight": weight,
          "text-anchor": ANCHORS[this.textAlign], opacity: this.alpha,
        },
        xmlText(text),
      ),
    );
  }

  // The file: what was drawn of this part of the picture, on paper of a colour.
  file({ left, top, width, height }, scale, { title, paper }) {
    const [x, y, across, along] = [left, top, width, height].map(short);
    const root = svg(
      "svg",
      {
        viewBox: `${x} ${y} ${across} ${along}`, width: short(width * scale), height: short(height * scale),
        "font-family": "sans-serif", role: "img",
      },
      svg("title", {}, xmlText(title)),
      svg("rect", { x, y, width: across, height: along, fill: paper }),
      this.marks,
    );
    return `<?xml version="1.0" encoding="UTF-8"?>\n${new XMLSerializer().serializeToString(root)}\n`;
  }
}

// Without what no XML may hold.
function xmlText(text) {
  return visibleText(text).replace(NO_XML, "\ufffd");
}
