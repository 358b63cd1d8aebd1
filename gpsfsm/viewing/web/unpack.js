// Lists of objects that were packed as columns (gpsfsm/viewing/packing.py); the rest stays as it is.

// unpack(value) -> the document; a document that is not packed comes back as it is
export function unpack(value) {
  if (Array.isArray(value)) return value.map(unpack);
  if (value === null || typeof value !== "object") return value;
  if (Array.isArray(value.$columns)) return unpackRows(value.$columns, value.$rows);
  const found = {};
  for (const [name, part] of Object.entries(value)) found[name] = unpack(part);
  return found;
}

function unpackRows(columns, count) {
  const rows = Array.from({ length: count }, () => ({}));
  for (const column of columns) {
    const values = columnValues(column);
    values.forEach((value, place) => {
      rows[column.at ? column.at[place] : place][column.name] = value;
    });
  }
  return rows;
}

function columnValues(column) {
  if (column.of) return column.of.map((number) => column.values[number]);
  if (!column.steps) return column.all.map(unpack);
  let value = 0;
  return column.steps.map((step) => (value += step));
}
