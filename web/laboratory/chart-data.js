// From experiments to the lines of the panels: names, values at the shared times, and ranges.
import { brief } from "./experiment.js";
import { quotientsOf } from "./why.js";

const AXES = [0, 1, 2];
// A run that leaves the solution is shown as far beyond the solution as the solution's own size. Its
// error is shown up to this multiple of that size.
const FARTHEST_ERROR = 100;

// Return the times (s) that all panels share, and the panels. A panel has an `id`, its `lines`, and
// `range`, which returns the ends of its scale. A line has a `name`, a `look`, an `axis` for its
// colour, or null, and values at the times, null where there is none. `pinned` and `limit` are null
// if they are not shown.
export function panelsOf(found, pinned, limit, shown) {
  const times = sharedTimes(found, pinned);
  const place = new Map(times.map((time, n) => [key(time), n]));
  const column = (own, rows, first, at) => {
    const values = times.map(() => null);
    values[0] = first;
    rows.forEach((row, n) => {
      values[place.get(key(own[n]))] = row === null ? null : at(row);
    });
    return values;
  };
  const of = (experiment, rows, first, at) => column(experiment.times, rows, first, at);
  const unknowns = (experiment, look, from, starts) =>
    AXES.map((axis) => ({
      name: `${from === 1 ? "U" : "V"}${axis + 1}`,
      look,
      axis,
      values: of(experiment, experiment.run.rows, starts[axis], (row) => row[axis + from]),
    }));
  const omega = (axis) => {
    const start = found.scene.initial.omega[axis];
    const lines = [unknowns(found, "run", 1, found.scene.initial.omega)[axis]];
    const more = (name, look, values) => lines.push({ name, look, axis: null, values });
    if (shown.solution) more("solution", "solution", of(found, found.truth, start, (row) => row[axis]));
    if (limit !== null) more("limit", "limit", of(found, limit, start, (row) => row[axis]));
    if (pinned !== null) {
      const first = pinned.scene.initial.omega[axis];
      more("pinned", "pinned", of(pinned, pinned.run.rows, first, (row) => row[axis + 1]));
    }
    return { id: `omega${axis + 1}`, lines, range: componentRange(found, axis) };
  };
  const errors = (experiment, look) =>
    AXES.map((axis) => ({
      name: `U${axis + 1}`,
      look,
      axis,
      values: of(experiment, experiment.errors, null, (row) => row[axis] || null),
    }));

  const panels = AXES.map(omega);
  const both = (lines) => [
    ...lines(found, "run"),
    ...(pinned === null ? [] : lines(pinned, "pinned")),
  ];
  panels.push({ id: "error", lines: both(errors), range: errorRange(found) });
  const rest = [0, 0, 0];
  panels.push({ id: "velocity", lines: both((each, look) => unknowns(each, look, 4, rest)), range: velocityRange(found) });
  if (found.tests.length > 0) {
    panels.push({ id: "quotient", lines: quotientLines(found, of, times), range: powersRange });
  }
  if (pinned !== null) {
    panels.push({ id: "difference", lines: differenceLines(found, pinned, of), range: differenceRange(found) });
  }
  return { times, panels };
}

// Return the values of all panels at the time of an index, as a text, or an empty text for null.
export function readout(shown, index) {
  if (index === null || shown === null || !(index < shown.times.length)) return "";
  const told = shown.panels.flatMap(({ id, lines }) => {
    const values = lines
      .filter((line) => line.values[index] !== null)
      .map(({ name, look, values: column }) => {
        const of = look === "pinned" && name !== "pinned" ? " pinned" : "";
        return `${name}${of} ${brief(column[index], 5)}`;
      });
    if (values.length === 0) return [];
    return id.startsWith("omega") ? values.join(", ") : `${id}: ${values.join(", ")}`;
  });
  return `${brief(shown.times[index], 5)} s: ${told.join("; ")}`;
}

// Times that agree to 12 digits count as one time.
function key(time) {
  return Number(time.toPrecision(12));
}

function sharedTimes(found, pinned) {
  const all = new Map([[0, 0]]);
  for (const each of pinned === null ? [found] : [found, pinned]) {
    for (const time of each.times) if (!all.has(key(time))) all.set(key(time), time);
  }
  return [...all.values()].sort((one, other) => one - other);
}

// The tested variables have their own axis and colour; those of the velocity are drawn dashed.
function quotientLines(found, of, times) {
  const steps = quotientsOf(found.tests);
  const lines = steps[0].map(([name], n) => ({
    name,
    look: name[0] === "V" ? "velocity" : "run",
    axis: name.length === 2 && name !== "UV" ? Number(name[1]) - 1 : null,
    values: of(found, steps, null, (step) => (Number.isFinite(step[n][1]) ? step[n][1] || null : null)),
  }));
  const { lipschitz } = found.state;
  return [...lines, { name: "limit", look: "bound", axis: null, values: times.map(() => lipschitz) }];
}

// The difference of omega, this run minus the pinned run, at the times that both have.
function differenceLines(found, pinned, of) {
  return AXES.map((axis) => {
    const [own, other] = [found, pinned].map((each) =>
      of(each, each.run.rows, each.scene.initial.omega[axis], (row) => row[axis + 1]),
    );
    const values = own.map((value, n) => (value === null || other[n] === null ? null : value - other[n]));
    return { name: `U${axis + 1}`, look: "run", axis, values };
  });
}

// Return the size of the solution: its largest component in absolute value (rad/s).
function sizeOf({ truth, scene }) {
  const values = [...truth.flat(), ...scene.initial.omega];
  return values.reduce((most, each) => Math.max(most, Math.abs(each)), 1e-300);
}

function componentRange(found, axis) {
  const values = [found.scene.initial.omega[axis], ...found.truth.map((row) => row[axis])];
  const least = values.reduce((x, y) => Math.min(x, y));
  const most = values.reduce((x, y) => Math.max(x, y));
  const size = sizeOf(found);
  return (low, high) => {
    const from = Math.min(least, Math.max(low ?? least, least - size));
    const to = Math.max(most, Math.min(high ?? most, most + size));
    const margin = Math.max(0.08 * (to - from), 0.001 * size);
    return [from - margin, to + margin];
  };
}

// Of a run that leaves the solution farther than the solution's size, only the velocities before that
// determine the scale.
function velocityRange(found) {
  const size = sizeOf(found);
  const near = found.run.rows.filter((row, n) => found.errors[n]?.every((error) => error < size));
  const largest = near
    .flatMap((row) => row.slice(4))
    .reduce((most, each) => Math.max(most, Math.abs(each)), 0);
  return (low, high) => plainRange(Math.max(low, -2 * largest), Math.min(high, 2 * largest));
}

function differenceRange(found) {
  const farthest = 2 * sizeOf(found);
  return (low, high) => plainRange(Math.max(low, -farthest), Math.min(high, farthest));
}

function plainRange(low, high) {
  const [from, to] = [Math.min(low, high), Math.max(low, high)];
  const margin = 0.08 * (to - from) || Math.max(1e-3 * Math.abs(to), 1e-12);
  return [from - margin, to + margin];
}

// Return a range from one power of ten to another.
function powersRange(low, high) {
  if (!(low > 0)) return [1e-17, 1];
  const from = Math.max(Math.floor(Math.log10(low)), -300);
  return [10 ** from, 10 ** Math.max(Math.ceil(Math.log10(high)), from + 1)];
}

function errorRange(found) {
  const farthest = FARTHEST_ERROR * sizeOf(found);
  return (low, high) => powersRange(low, Math.min(high, Math.max(farthest, 10 * low)));
}
