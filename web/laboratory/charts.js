// The panels, drawn by uPlot, a classic script that the page loads before this one.
//
// The panels have the page's colours and are redrawn when its colour scheme changes. They share the
// pointer. Their legend and the readout are elements of the page.

const LOGARITHMIC = ["error", "quotient"];
// Heights in pixels, for a narrow and for a wide panel.
const HEIGHTS = [150, 170];
const WIDE = 400;
const MOST_LABELS = 5;
// How a line looks: its colour, if it has no axis, its width and its dashes.
const LOOKS = {
  run: { colour: "--ink", width: 2 },
  solution: { colour: "--muted", width: 1.5, dash: [6, 4] },
  limit: { colour: "--part", width: 2, dash: [2, 3] },
  pinned: { colour: "--missing-text", width: 1.5, dash: [10, 3, 2, 3] },
  velocity: { colour: "--ink", width: 1.5, dash: [5, 3] },
  bound: { colour: "--bad", width: 1.5 },
};

export class Charts {
  // `places` has the elements that contain the panels, by the panels' names. `tell` gets the index of the time at the
  // pointer or null, and `pick` that of a time that was clicked.
  constructor(places, tell, pick) {
    Object.assign(this, { places, tell, pick });
    this.drawn = new Map();
    this.shown = null;
    new ResizeObserver(() => this.resize()).observe(places.omega1);
  }

  // Show panels; `mark` is the time (s) of the chosen step, `end` the time and the reason of an early
  // end, or null.
  show(panels, times, mark, end) {
    this.shown = { panels, times, mark, end };
    for (const id of this.drawn.keys()) {
      if (!panels.some((panel) => panel.id === id)) this.remove(id);
    }
    for (const panel of panels) {
      const looks = panel.lines.map(({ name, look }) => name + look).join();
      if (this.drawn.get(panel.id)?.looks !== looks) this.remove(panel.id);
      const data = [times, ...panel.lines.map((line) => line.values)];
      const old = this.drawn.get(panel.id);
      if (old) {
        old.range = panel.range;
        old.chart.setData(data);
      } else {
        this.drawn.set(panel.id, this.made(panel, looks, data));
      }
    }
  }

  // Mark another step.
  mark(time) {
    if (this.shown === null) return;
    this.shown.mark = time;
    for (const { chart } of this.drawn.values()) chart.redraw(false, false);
  }

  // Redraw with the colours that apply now.
  recolour() {
    colours.clear();
    for (const id of [...this.drawn.keys()]) this.remove(id);
    if (this.shown) this.show(this.shown.panels, this.shown.times, this.shown.mark, this.shown.end);
  }

  remove(id) {
    this.drawn.get(id)?.chart.destroy();
    this.drawn.delete(id);
  }

  resize() {
    for (const [id, { chart }] of this.drawn) {
      const size = this.sizeOf(id);
      if (size.width > 0 && size.width !== chart.width) chart.setSize(size);
    }
  }

  sizeOf(id) {
    const width = this.places[id].clientWidth;
    return { width, height: HEIGHTS[width < WIDE ? 0 : 1] };
  }

  made(panel, looks, data) {
    const found = { looks, range: panel.range };
    const isLog = LOGARITHMIC.includes(panel.id);
    const options = {
      ...this.sizeOf(panel.id),
      scales: {
        x: { time: false },
        y: { distr: isLog ? 3 : 1, range: (_, low, high) => found.range(low, high) },
      },
      axes: [
        { ...axis(), size: 30 },
        isLog ? logarithmic(axis()) : { ...axis(), size: 64, values: labels },
      ],
      series: [{}, ...panel.lines.map(style)],
      hooks: {
        draw: [(chart) => this.annotate(chart, panel.id)],
        setCursor: [(chart) => panel.id === "omega1" && this.tell(chart.cursor.idx ?? null)],
        ready: [(chart) => this.listen(chart)],
      },
      legend: { show: false },
      cursor: { drag: { x: true, y: false }, sync: { key: "laboratory" } },
    };
    found.chart = new uPlot(options, data, this.places[panel.id]);
    return found;
  }

  // A click chooses a step; a drag shows a part of the time.
  listen(chart) {
    let from = 0;
    chart.over.addEventListener("pointerdown", (event) => (from = event.clientX));
    chart.over.addEventListener("click", (event) => {
      const { idx } = chart.cursor;
      if (Math.abs(event.clientX - from) < 4 && idx !== null && idx !== undefined) this.pick(idx);
    });
  }

  annotate(chart, id) {
    const { mark, end, panels } = this.shown;
    if (end !== null) line(chart, end.time, "--bad", [], id === "omega1" ? end.words : null);
    if (mark !== null) line(chart, mark, "--accent", [3, 3], null);
    const panel = panels.find((each) => each.id === id);
    if (panel && !id.startsWith("omega")) nameLines(chart, panel);
  }
}

// Colours of the style by name, as they apply now.
const colours = new Map();

// Return the current value of a colour of the style. It may depend on the colour scheme, which only
// the computed style of an element shows.
function colour(name) {
  if (!colours.has(name)) colours.set(name, computed(name));
  return colours.get(name);
}

function computed(name) {
  const probe = document.createElement("span");
  probe.style.color = `var(${name})`;
  document.body.append(probe);
  const found = getComputedStyle(probe).color;
  probe.remove();
  return found;
}

function style({ look, axis: number }) {
  const { colour: own, width, dash } = LOOKS[look];
  return {
    stroke: colour(number === null ? own : `--c${number + 1}`),
    width,
    dash,
    points: { show: false },
    spanGaps: true,
  };
}

// Draw a vertical line at a time (s), with words beside it.
function line(chart, time, name, dash, words) {
  const { ctx } = chart;
  const { left, top, width, height } = chart.bbox;
  const x = Math.round(chart.valToPos(time, "x", true));
  if (x < left || x > left + width) return;
  ctx.save();
  ctx.setLineDash(dash.map((length) => length * uPlot.pxRatio));
  ctx.strokeStyle = colour(name);
  ctx.lineWidth = 1.5 * uPlot.pxRatio;
  ctx.beginPath();
  ctx.moveTo(x, top);
  ctx.lineTo(x, top + height);
  ctx.stroke();
  if (words !== null) {
    const size = 12 * uPlot.pxRatio;
    ctx.font = `${size}px sans-serif`;
    const length = ctx.measureText(words).width;
    const from = x > left + width / 2 ? x - length - size / 2 : x + size / 2;
    ctx.fillStyle = colour("--paper");
    ctx.fillRect(from, top + size / 4, length, 1.3 * size);
    ctx.fillStyle = colour(name);
    ctx.textAlign = "left";
    ctx.fillText(words, from, top + 1.2 * size);
  }
  ctx.restore();
}

// Write each line's name at its last point, so that colour is not alone.
function nameLines(chart, { lines }) {
  const { ctx } = chart;
  const { left, top, width, height } = chart.bbox;
  const size = 11 * uPlot.pxRatio;
  ctx.save();
  ctx.font = `${size}px sans-serif`;
  ctx.textAlign = "right";
  const taken = [];
  lines.forEach(({ name, look, axis: number, values }) => {
    if (look === "pinned") return;
    const last = values.findLastIndex((value) => value !== null);
    if (last < 0) return;
    const x = chart.valToPos(chart.data[0][last], "x", true);
    let y = Math.min(Math.max(chart.valToPos(values[last], "y", true) - size / 3, top + size), top + height);
    while (taken.some((other) => Math.abs(other - y) < size)) y += size;
    if (y > top + height) y = Math.min(...taken) - size;
    taken.push(y);
    ctx.fillStyle = colour(number === null ? LOOKS[look].colour : `--c${number + 1}`);
    ctx.fillText(name, Math.min(Math.max(x, left + 2 * size), left + width) - size / 3, y);
  });
  ctx.restore();
}

function axis() {
  const drawn = { stroke: colour("--line"), width: 1 };
  return { stroke: colour("--muted"), grid: drawn, ticks: drawn, font: "12px sans-serif" };
}

// Label powers of ten only, and not too many of them.
function logarithmic(plain) {
  const all = (_, ticks) => ticks;
  const splits = (chart, _, low, high) => {
    const [from, to] = [Math.round(Math.log10(low)), Math.round(Math.log10(high))];
    const apart = Math.ceil((to - from) / MOST_LABELS);
    return Array.from({ length: Math.floor((to - from) / apart) + 1 }, (_, n) => 10 ** (from + n * apart));
  };
  return {
    ...plain,
    size: 64,
    splits,
    filter: all,
    grid: { ...plain.grid, filter: all },
    ticks: { ...plain.ticks, filter: all },
    values: (_, ticks) => ticks.map((tick) => tick.toExponential(0).replace("+", "")),
  };
}

// Format numbers in few characters.
function labels(_, ticks) {
  return ticks.map((tick) => {
    const size = Math.abs(tick);
    const long = tick !== 0 && (size < 1e-3 || size >= 1e5);
    return long ? tick.toExponential().replace("+", "") : String(tick);
  });
}
