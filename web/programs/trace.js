// The trace of a run: values that a program assigns to its variables, by the names on its cards.
//
// A trace only reads values that the program has computed, so that it changes no bit of a run. A
// program without a trace records nothing.

export const UNKNOWNS = ["U1", "U2", "U3", "V1", "V2", "V3"];

export class Trace {
  // `step` is the number of the step, from 1, whose values are recorded.
  constructor(step) {
    this.step = step;
    // Names and values in the order of the assignments.
    this.values = [];
    // For each step the quantities of the stop test: variable, change of the slope (rad/s2 or
    // m/s2), and change of the unknown (rad/s or m/s).
    this.tests = [];
  }

  // Return a function that records a name and its value in this step, or null in any other step.
  recorder(step) {
    return step === this.step ? (name, value) => this.values.push([name, value]) : null;
  }
}

// Record values under their names.
export function noteAll(note, names, values) {
  names.forEach((name, n) => note(name, values[n]));
}
