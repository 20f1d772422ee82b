// Curves of a chart whose axes are in the page. The page has the box and the ranges of the axes as
// data of the picture; the same curves are drawn by pyharness/edition/story.py without scripts.

// Draw a curve through points, or remove it if there are none.
export function draw(chart, name, x, y) {
  const { box, ranges, isLogarithmic } = frameOf(chart);
  const [left, top, right, bottom] = box;
  const across = (value) => left + ((value - ranges.x[0]) / (ranges.x[1] - ranges.x[0])) * (right - left);
  const up = (value) => {
    const share = ((isLogarithmic ? Math.log10(value) : value) - ranges.y[0]) / (ranges.y[1] - ranges.y[0]);
    // What is outside by far is just outside.
    return bottom - Math.min(Math.max(share, -1), 2) * (bottom - top);
  };
  const points = [];
  x.forEach((each, n) => {
    if (!isLogarithmic || y[n] > 0) points.push(`${across(each).toFixed(1)},${up(y[n]).toFixed(1)}`);
  });
  chart.querySelector(`[data-curve="${name}"]`).setAttribute("points", points.join(" "));
}

// Draw a line across the whole chart at a place of the horizontal axis.
export function mark(chart, name, x) {
  const { ranges, isLogarithmic } = frameOf(chart);
  const [low, high] = ranges.y.map((value) => (isLogarithmic ? 10 ** value : value));
  draw(chart, name, [x, x], [low, high]);
}

function frameOf(chart) {
  const numbers = (text) => text.split(" ").map(Number);
  const { box, x, y, logarithmic } = chart.dataset;
  return {
    box: numbers(box),
    ranges: { x: numbers(x), y: numbers(y) },
    isLogarithmic: logarithmic !== undefined,
  };
}
