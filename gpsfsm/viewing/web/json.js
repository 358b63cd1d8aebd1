// Lines of JSON in the text pane: their colours, and what of a long line is left out.

// A text, with the colon and the value behind it if it names a member; or a brace.
const JSON_PARTS = /("(?:[^"\\]|\\.)*"?)(\s*:\s*)?("(?:[^"\\]|\\.)*"|[-\d][\d.eE+-]*|true|false|null)?(\s*,\s*)?|[{}]/gu;
const LEFT_OUT = ["index", "element", "need", "line", "column", "origin"];
const KEYS_LEFT_OUT = ["id", "name", "source", "event", "target", "action"];

export const isJson = (text) => /^\s*[{[]/u.test(text);

// [[start, end, kind]] in UTF-16 units, as markupParts gives it for XML.
export function jsonParts(text, from, to) {
  const parts = [];
  let at = from;
  const add = (start, end, kind) => end > start && parts.push([start, end, kind]);
  for (const { 0: whole, 1: first, 2: colon, 3: value, index } of text.slice(0, to).matchAll(JSON_PARTS)) {
    if (index < at) continue;
    add(at, index, "");
    const middle = index + (first ? first.length : whole.length);
    add(index, middle, first ? (colon ? "name" : "value") : "bracket");
    const start = middle + (colon || "").length;
    add(middle, start, "");
    if (value) add(start, start + value.length, "value");
    at = start + (value || "").length;
  }
  add(at, to, "");
  return parts;
}

// Where a line says nothing that tells one runner or connection from another; in UTF-16 units.
//   {"id": "go", "kind": "runner", "interface": "nav2/WaypointRunner", "parameters": {"x": 1}}
//   {"go", …WaypointRunner, {"x": 1}}
export function jsonFolds(text) {
  const folds = [];
  const names = {};
  let depth = -1; // inside the parameters, whose names are the user's own
  for (const { 0: whole, 1: first, 2: colon, 3: value = "", 4: comma = "", index } of text.matchAll(JSON_PARTS)) {
    if (depth >= 0 || !first) {
      if (depth >= 0 && !first) depth += whole === "{" ? 1 : -1;
      if (depth === 0) depth = -1;
      continue;
    }
    if (!colon) continue;
    const key = first.slice(1, -1);
    const start = index + first.length + colon.length;
    const isAgain = (key === "provider" && value === names.interface) || (key === "kind" && value === '"runner"');
    const slash = value.lastIndexOf("/");
    names[key] = value;
    if (key === "parameters" && text[start] === "{") {
      folds.push([index, start]);
      depth = 0;
    } else if (isAgain || LEFT_OUT.includes(key)) folds.push([index, start + value.length + comma.length]);
    else if (key === "interface" && slash > 0) {
      folds.push([index, start + slash + 1, true], [start + value.length - 1, start + value.length]);
    } else if (KEYS_LEFT_OUT.includes(key)) folds.push([index, start]);
  }
  if (folds.length && !folds.some(([, , sign]) => sign)) folds[0][2] = true;
  return folds;
}
