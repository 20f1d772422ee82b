// The switches that change nothing in a run: each is switched, and the runs are compared bit by bit.
import { runOf } from "./experiment.js";

// Return, for every switch of the page, null if it changes a number of the run, or else the reason
// why it does nothing.
export function idleSwitches(data, state) {
  const own = runOf(data, state);
  return new Map(data.flags.map((flag) => [flag.id, reason(data, state, flag, own)]));
}

function reason(data, state, flag, own) {
  if (!flag.programs.includes(state.program)) return `not in the ${state.program} program`;
  const active = state.active.includes(flag.id)
    ? state.active.filter((name) => name !== flag.id)
    : [...state.active, flag.id];
  return same(runOf(data, { ...state, active }), own) ? "it changes no number of this run" : null;
}

// Return whether two runs have the same numbers, bit by bit, and ended in the same way.
function same(one, other) {
  return (
    one.ended === other.ended &&
    one.rows.length === other.rows.length &&
    one.rows.every((row, n) => row.every((value, column) => Object.is(value, other.rows[n][column]))) &&
    ["step", "variable", "quotient"].every((name) => Object.is(one.stop?.[name], other.stop?.[name])) &&
    String(one.ier) === String(other.ier)
  );
}
