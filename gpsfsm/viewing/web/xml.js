// Colours for lines of XML. It reads line by line and needs no correct XML: what it does not
// understand keeps the colour of text.

// Written in two parts: in a page that holds this script it must not look like markup.
const COMMENT = "<" + "!--";
const TOKENS = /(<[/?!]?)([^\s<>/="']*)|("[^"]*"?|'[^']*'?)|([^\s<>="'/]+)(?=\s*=)|([/?]?>)/gu;

// Per line whether it begins inside a comment.
export function commentStarts(lines) {
  let open = false;
  return lines.map((line) => {
    const atStart = open;
    let at = 0;
    while (at >= 0) {
      const next = line.indexOf(open ? "-->" : COMMENT, at);
      if (next < 0) break;
      at = next + (open ? 3 : 4);
      open = !open;
    }
    return atStart;
  });
}

// colorLine(points, inComment) -> [{start, end, kind}], which cover the whole line; positions count
// code points. Kinds: comment, bracket, tag, name, value, "".
export function colorLine(points, inComment) {
  if (!points.length) return [];
  const text = points.join("");
  const parts = [];
  let at = 0;
  let open = inComment;
  while (at < text.length) {
    if (open) {
      const end = text.indexOf("-->", at);
      const stop = end < 0 ? text.length : end + 3;
      parts.push([at, stop, "comment"]);
      at = stop;
      open = false;
      continue;
    }
    const begin = text.indexOf(COMMENT, at);
    const stop = begin < 0 ? text.length : begin;
    if (stop > at) parts.push(...markupParts(text, at, stop));
    at = stop;
    open = begin >= 0;
  }
  return inPoints(parts, points, text);
}

function markupParts(text, from, to) {
  const parts = [];
  let at = from;
  TOKENS.lastIndex = from;
  const add = (start, end, kind) => end > start && parts.push([start, end, kind]);
  for (let found = TOKENS.exec(text); found && found.index < to; found = TOKENS.exec(text)) {
    const end = Math.min(to, found.index + found[0].length);
    add(at, found.index, "");
    if (found[1]) {
      add(found.index, found.index + found[1].length, "bracket");
      add(found.index + found[1].length, end, "tag");
    } else {
      add(found.index, end, found[3] ? "value" : found[4] ? "name" : "bracket");
    }
    at = end;
    if (end === found.index) TOKENS.lastIndex += 1;
  }
  add(at, to, "");
  return parts;
}

// From positions in UTF-16 units to code points.
function inPoints(parts, points, text) {
  if (points.length === text.length) return parts.map(([start, end, kind]) => ({ start, end, kind }));
  const pointAt = [];
  let unit = 0;
  points.forEach((point, number) => {
    for (let count = 0; count < point.length; count += 1) pointAt[unit + count] = number;
    unit += point.length;
  });
  pointAt[unit] = points.length;
  return parts.map(([start, end, kind]) => ({ start: pointAt[start], end: pointAt[end], kind }));
}
