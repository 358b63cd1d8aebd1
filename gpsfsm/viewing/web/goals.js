// The places that a plan sends the robot to, as far as they stand in it as numbers.

const NUMBER = "(-?\\d+(?:\\.\\d+)?(?:[eE][-+]?\\d+)?)";
const X = new RegExp(`\\bx=${NUMBER}`);
const Y = new RegExp(`\\by=${NUMBER}`);
const MOST = 200;

// Goals {x, y, text, element} in the order of the plan, a place that is named twice once.
export function goalsOf(plan) {
  if (!plan) return [];
  const found = new Map();
  plan.elements.forEach((each, element) => {
    if (each.kind !== "runner" || found.size >= MOST) return;
    const [x, y] = [X.exec(each.detail), Y.exec(each.detail)];
    if (!x || !y) return;
    const place = `${Number(x[1])} ${Number(y[1])}`;
    if (!found.has(place)) {
      found.set(place, { x: Number(x[1]), y: Number(y[1]), text: `${each.label}, line ${each.line}`, element });
    }
  });
  return [...found.values()];
}
