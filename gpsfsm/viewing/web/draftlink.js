// A plan in a link: its text, compressed, stands behind the "#" of the address, which no browser sends
// to a server. Anybody can write such a link, so what comes out of it is only ever text in the editor.

const LONGEST_CODE = 8000;
const LONGEST_TEXT = 200_000; // of a few thousand letters somebody could make gigabytes

// packText("<Plan …") -> a promise of letters, digits, "-" and "_"; "" if they would be too many
export async function packText(text) {
  const packed = await through(new CompressionStream("deflate-raw"), new TextEncoder().encode(text));
  const code = btoa(String.fromCharCode(...packed)).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "");
  return code.length <= LONGEST_CODE ? code : "";
}

// The text again; a promise that fails if it is none.
export async function unpackText(code) {
  const letters = atob(code.replaceAll("-", "+").replaceAll("_", "/"));
  const packed = Uint8Array.from(letters, (letter) => letter.charCodeAt(0));
  const bytes = await through(new DecompressionStream("deflate-raw"), packed);
  return new TextDecoder("utf-8", { fatal: true }).decode(bytes);
}

async function through(stream, bytes) {
  const reader = new Blob([bytes]).stream().pipeThrough(stream).getReader();
  const parts = [];
  let size = 0;
  for (let part = await reader.read(); !part.done; part = await reader.read()) {
    size += part.value.length;
    if (size > LONGEST_TEXT) throw new RangeError("the text is too long");
    parts.push(...part.value);
  }
  return Uint8Array.from(parts);
}
