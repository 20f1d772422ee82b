// What tests of the laboratory ask of its modules.
import * as E from "../../web/laboratory/experiment.js";
import * as I from "../../web/laboratory/idle.js";
import * as K from "../../web/laboratory/cards.js";
import * as L from "../../web/laboratory/limit.js";
import * as P from "../../web/laboratory/printer-page.js";
import * as Q from "../../web/programs/equations.js";
import * as R from "../../web/laboratory/reference.js";
import * as S from "../../web/laboratory/state.js";
import * as W from "../../web/laboratory/why.js";

export const references = (data, given) => given.map(({ scene, times }) => R.reference(scene, times));

export const problems = (data, given) => given.map((each) => S.stateFrom(data, each).problems);

export function printerPages(data, given) {
  return given.map(([number, program, listing, steps]) => {
    const words = `case=${number}&program=${program}&listing=${listing}&steps=${steps}`;
    const { scene, run } = E.experiment(data, S.stateFrom(data, words).state);
    return P.printerPage(data.printer[program], scene, run);
  });
}

export function printedRows(data, given) {
  const rows = given.rows.map((row) => row.map(Number));
  const run = { rows, ier: given.ier };
  return P.printerPage(data.printer["two-term"], given.scene, run);
}

export function statesOfWords(data, given) {
  return given.map((words) => {
    const { state, problems } = S.stateFrom(data, `#${words}`);
    const again = S.stateFrom(data, S.fragmentOf(data, state));
    const run = E.experiment(data, state).run;
    return { state, problems, again: again.state, command: S.commandOf(data, state), run };
  });
}

export function addresses(data, given) {
  return given.map((words) => {
    const { state } = S.stateFrom(data, words);
    return [S.fragmentOf(data, state), S.commandOf(data, state)];
  });
}

export function addressesOfPrograms(data, given) {
  const { state } = S.stateFrom(data, given);
  return ["four-term", "runge-kutta"].map((program) =>
    S.fragmentOf(data, { ...state, program }));
}

export function problemsOfWords(data, given) {
  return given.map((words) => {
    const { state, problems } = S.stateFrom(data, words);
    return [S.fragmentOf(data, state), problems];
  });
}

export function problemsOfPins(data, given) {
  return given.map((pin) => {
    const found = S.stateFrom(data, `case=2&pin=${pin}`);
    return [found.problems, S.fragmentOf(data, found.pinned)];
  });
}

export function endings(data, given) {
  const run = (words) => E.experiment(data, S.stateFrom(data, words).state);
  const found = given.map(run);
  const { state, scene } = found[0], stop = { step: 1, variable: "UV", quotient: Infinity };
  const steep = { state, scene, run: { ended: "stopped", rows: [], stop } };
  const { truth, errors } = run("case=2&program=two-term&omega0=1e-3,0,2e6");
  return [found.map((each) => [each.run.stop, E.ending(each), E.largestError(each)]),
    E.ending(steep), truth.length, errors.map((row) => row !== null)];
}

export function cardsOfStep(data, given) {
  const { state } = S.stateFrom(data, given.words);
  const { run, trace } = K.traced(data, state, given.step);
  const passes = K.passesOf(data, state, { run, trace }, given.step);
  const scene = E.sceneOf(data, state);
  const active = new Set(state.active);
  const before = run.rows.length > 1 ? run.rows[given.step - 2] : null;
  return { passes, values: trace.values, row: run.rows[given.step - 1], before,
    rates: [Q.eulerCoefficients(scene), Q.normalizedTorque(scene, 0),
      Q.accelerations(scene, active)] };
}

export function traces(data, given) {
  return given.map((words) => {
    const { state } = S.stateFrom(data, words);
    const plain = E.experiment(data, state).run;
    const steps = plain.rows.length;
    const { run } = K.traced(data, state, steps);
    return [plain.rows, run.rows, plain.stop, run.stop];
  });
}

export function pinnedStates(data, given) {
  return given.map(([words, other]) => {
    const [state, pinned] = [words, other].map((each) => S.stateFrom(data, each).state);
    const found = S.stateFrom(data, `#${S.fragmentOf(data, state, pinned)}`);
    return [found, state, pinned, S.fragmentOf(data, state)];
  });
}

export function limits(data, given) {
  return given.map(([number, program]) => {
    const { state } = S.stateFrom(data, `case=${number}&program=${program}`);
    const found = E.experiment(data, state);
    return [L.limitOf(data, found), found.truth];
  });
}

export function distancesToLimit(data, given) {
  const distance = (state, parts) => {
    const finer = { ...state, stepSize: state.stepSize / parts, steps: state.steps * parts };
    const found = E.experiment(data, { ...finer, stops: false });
    const { kind, omega } = L.limitOf(data, found);
    const goal = omega ?? found.truth;
    const apart = found.run.rows.map((row, n) =>
      Math.max(...[0, 1, 2].map((axis) => Math.abs(row[axis + 1] - goal[n][axis]))));
    return [kind, Math.max(...apart)];
  };
  return given.map((words) => {
    const { state, problems } = S.stateFrom(data, words);
    return [problems, distance(state, 1), distance(state, 8)];
  });
}

export function experimentShown(data, given) {
  const { state, pinned, problems } = S.stateFrom(data, given);
  const shown = (state) => {
    const found = E.experiment(data, state);
    const { kind, omega } = L.limitOf(data, found);
    const apart = omega === null ? null : found.run.rows.map((row, n) =>
      Math.max(...[0, 1, 2].map((axis) => Math.abs(row[axis + 1] - omega[n][axis]))));
    return { ended: found.run.ended, steps: found.run.rows.length, limit: kind,
      variable: found.run.stop?.variable, error: E.brief(E.largestError(found)),
      quotient: found.run.stop && String(Math.round(found.run.stop.quotient)),
      from_limit: apart && E.brief(Math.max(...apart)) };
  };
  return [problems, S.fragmentOf(data, state, pinned), shown(state),
    pinned && shown(pinned)];
}

export function reasons(data, given) {
  return given.map((words) =>
  W.whyEnded(E.experiment(data, S.stateFrom(data, words).state)));
}

export function quotients(data, given) {
  return given.map((words) => {
    const found = E.experiment(data, S.stateFrom(data, words).state);
    return [found.run.stop, W.quotientsOf(found.tests), found.run.rows.length, found.state];
  });
}

export function idleSwitches(data, given) {
  return given.map((words) => {
    const { state } = S.stateFrom(data, words);
    return [state, [...I.idleSwitches(data, state)]];
  });
}
