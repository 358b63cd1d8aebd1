// The other layout: layered by dagre, which follows the edges and not the plan. For graphs of up to
// some hundred items; larger ones keep the layout by structure.

export const MOST_LAYERED = 400;

// Moves items, groups and ways of a picture to where dagre puts them.
export function layeredPicture(picture) {
  const { dagre } = globalThis;
  for (const edge of picture.edges) edge.full = edge.way;
  if (!dagre || picture.items.length > MOST_LAYERED) return;
  const graph = new dagre.graphlib.Graph({ multigraph: true });
  graph.setGraph({ rankdir: "TB", nodesep: 36, ranksep: 44, edgesep: 14, marginx: 20, marginy: 20 });
  graph.setDefaultEdgeLabel(() => ({}));
  picture.items.forEach((item, number) =>
    graph.setNode(`i${number}`, { width: item.box.width, height: item.box.height }),
  );
  picture.edges.forEach((edge, number) => {
    if (edge.loop) return;
    if (edge.open) graph.setNode(`o${number}`, { width: 10, height: 10 });
    const target = edge.open ? `o${number}` : `i${edge.target}`;
    graph.setEdge(`i${edge.source}`, target, { weight: edge.kind === "SUCCEEDED" ? 3 : 1 }, `e${number}`);
  });
  dagre.layout(graph);
  picture.items.forEach((item, number) => {
    const at = graph.node(`i${number}`);
    item.box = { ...item.box, x: at.x - at.width / 2, y: at.y - at.height / 2 };
  });
  picture.edges.forEach((edge, number) => {
    if (edge.loop) {
      const { x, y, width, height } = picture.items[edge.source].box;
      const [right, middle] = [x + width, y + height / 2];
      edge.way = [[right, middle + 6], [right + 16, middle + 6], [right + 16, middle - 6], [right + 2, middle - 6]];
    } else {
      const target = edge.open ? `o${number}` : `i${edge.target}`;
      const { points } = graph.edge(`i${edge.source}`, target, `e${number}`);
      edge.way = points.map((point) => [point.x, point.y]);
    }
    Object.assign(edge, { merged: false, full: edge.way, curved: true });
  });
  picture.groups = []; // controls are not drawn: dagre does not keep what is in them together
  const size = graph.graph();
  Object.assign(picture, { width: size.width, height: size.height });
}
