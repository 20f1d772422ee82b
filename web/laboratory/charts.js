// Two charts drawn by uPlot, a classic script that the page loads before this one.
//
// The charts have the page's colours and are redrawn when its colour scheme changes. The legend and
// the choice of components are elements of the page, so that they can be used without a mouse.

const COMPONENTS = ["U1", "U2", "U3"];
// Heights in pixels, for a narrow and for a wide chart.
const HEIGHTS = { omega: [280, 360], error: [200, 250] };
const WIDE = 600;
// A run that leaves the solution is shown as far beyond the solution as the solution's own size.
// Its error is shown up to this multiple of that size.
const FARTHEST_ERROR = 100;
const MOST_LABELS = 6;

export class Charts {
  // `omega` and `error` are the elements that contain the charts, `readout` is the element for the
  // numbers at the pointer. `isShown` says whether a component, counted from 0, is to be drawn.
  constructor(omega, error, readout, isShown) {
    this.places = { omega, error };
    this.readout = readout;
    this.isShown = isShown;
    this.drawn = {};
    this.shown = null;
    new ResizeObserver(() => this.resize()).observe(omega);
  }

  // Show an experiment.
  show(found) {
    this.shown = found;
    this.data = { omega: omegaData(found), error: errorData(found) };
    for (const name of ["omega", "error"]) {
      if (this.drawn[name]) this.drawn[name].setData(this.data[name]);
      else this.drawn[name] = this.made(name);
    }
  }

  // Redraw with the components that are selected now.
  choose() {
    for (const chart of Object.values(this.drawn)) {
      chart.batch(() => {
        for (let n = 1; n < chart.series.length; n++) {
          chart.setSeries(n, { show: this.isShown((n - 1) % COMPONENTS.length) });
        }
      });
    }
  }

  // Redraw with the colours that apply now.
  recolour() {
    for (const name of Object.keys(this.drawn)) this.drawn[name].destroy();
    this.drawn = {};
    if (this.shown) this.show(this.shown);
  }

  resize() {
    for (const [name, chart] of Object.entries(this.drawn)) {
      const size = this.sizeOf(name);
      if (size.width > 0 && size.width !== chart.width) chart.setSize(size);
    }
  }

  sizeOf(name) {
    const width = this.places[name].clientWidth;
    return { width, height: HEIGHTS[name][width < WIDE ? 0 : 1] };
  }

  made(name) {
    const options = {
      ...this.sizeOf(name),
      scales: { x: { time: false }, y: this.scale(name) },
      axes: [axis(), name === "error" ? logarithmic(axis()) : { ...axis(), size: 56, values: labels }],
      series: [{}, ...this.series(name)],
      hooks: { draw: [(chart) => this.markEnd(chart)], setCursor: [(chart) => this.tell(chart)] },
      legend: { show: false },
      cursor: { drag: { x: true, y: false } },
    };
    return new uPlot(options, this.data[name], this.places[name]);
  }

  series(name) {
    const line = (axis, more) => ({
      stroke: colour(`--c${axis + 1}`),
      show: this.isShown(axis),
      points: { show: false },
      ...more,
    });
    const run = COMPONENTS.map((_, axis) => line(axis, { width: 2 }));
    if (name === "error") return run;
    return [...run, ...COMPONENTS.map((_, axis) => line(axis, { width: 1.25, dash: [6, 4] }))];
  }

  // Show the numbers at the pointer.
  tell(chart) {
    const n = chart.cursor.idx;
    const [time, ...columns] = this.data.omega;
    if (n === null || n === undefined || n >= time.length) {
      this.readout.textContent = "";
      return;
    }
    const told = COMPONENTS.map((name, axis) => {
      const [run, truth] = [columns[axis][n], columns[axis + COMPONENTS.length][n]];
      return `${name} ${number(run)} (solution ${number(truth)})`;
    });
    this.readout.textContent = `${number(time[n])} s: ${told.join(", ")}`;
  }

  scale(name) {
    const range = name === "error" ? "errorRange" : "omegaRange";
    return { distr: name === "error" ? 3 : 1, range: (_, low, high) => this[range](low, high) };
  }

  // Return the least and the greatest value of the solution.
  extent() {
    const values = [...this.shown.truth.flat(), ...this.shown.scene.initial.omega];
    const least = values.reduce((x, y) => Math.min(x, y), Infinity);
    const most = values.reduce((x, y) => Math.max(x, y), -Infinity);
    return { least, most, size: Math.max(Math.abs(least), Math.abs(most), 1e-300) };
  }

  omegaRange(low, high) {
    const { least, most, size } = this.extent();
    const from = Math.max(low ?? 0, least - size);
    const to = Math.min(high ?? 0, most + size);
    const margin = 0.06 * (to - from) || 0.5 * size;
    return [from - margin, to + margin];
  }

  // Return a range from one power of ten to another.
  errorRange(low, high) {
    if (!(low > 0)) return [1e-17, 1];
    const from = Math.max(Math.floor(Math.log10(low)), -300);
    const farthest = Math.max(FARTHEST_ERROR * this.extent().size, 10 * low);
    const to = Math.ceil(Math.log10(Math.min(high, farthest)));
    return [10 ** from, 10 ** Math.max(to, from + 1)];
  }

  // Draw a line where the run ended before all steps were done.
  markEnd(chart) {
    const { run } = this.shown;
    if (run.ended === "complete") return;
    const time = this.shown.times[Math.max(run.rows.length - 1, 0)];
    const { ctx } = chart;
    const { left, top, width, height } = chart.bbox;
    const x = Math.round(chart.valToPos(time, "x", true));
    if (x < left || x > left + width) return;
    ctx.save();
    ctx.setLineDash([]);
    ctx.strokeStyle = colour("--bad");
    ctx.lineWidth = 2 * uPlot.pxRatio;
    ctx.beginPath();
    ctx.moveTo(x, top);
    ctx.lineTo(x, top + height);
    ctx.stroke();
    const words = run.stop ? `step ${run.stop.step}: ${run.stop.variable}` : "overflow";
    const size = 13 * uPlot.pxRatio;
    ctx.font = `${size}px sans-serif`;
    const length = ctx.measureText(words).width;
    const from = x > left + width / 2 ? x - length - size / 2 : x + size / 2;
    ctx.fillStyle = colour("--paper");
    ctx.fillRect(from, top + size / 2, length, 1.3 * size);
    ctx.fillStyle = colour("--bad");
    ctx.textAlign = "left";
    ctx.fillText(words, from, top + 1.5 * size);
    ctx.restore();
  }
}

// Return the current value of a colour of the style. It may depend on the colour scheme, which only
// the computed style of an element shows.
function colour(name) {
  const probe = document.createElement("span");
  probe.style.color = `var(${name})`;
  document.body.append(probe);
  const found = getComputedStyle(probe).color;
  probe.remove();
  return found;
}

function number(value) {
  return value === null || value === undefined ? "-" : String(Number(value.toPrecision(5)));
}

function axis() {
  const line = { stroke: colour("--line"), width: 1 };
  return { stroke: colour("--muted"), grid: line, ticks: line, font: "12px sans-serif" };
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
    size: 56,
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

// Return the times with 0 before them, and the rows and the solution where they exist.
function omegaData({ scene, run, times, truth }) {
  const start = scene.initial.omega;
  const column = (rows, first, at) => [
    first,
    ...times.map((_, n) => (n < rows.length ? rows[n][at] : null)),
  ];
  return [
    [0, ...times],
    ...start.map((first, axis) => column(run.rows, first, axis + 1)),
    ...start.map((first, axis) => column(truth, first, axis)),
  ];
}

// An error of zero has no place on a logarithmic scale.
function errorData({ times, errors }) {
  const column = (axis) => times.map((_, n) => errors[n]?.[axis] || null);
  return [[0, ...times], ...COMPONENTS.map((_, axis) => [null, ...column(axis)])];
}
