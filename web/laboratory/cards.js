// The cards that run in one step, with the values that they assign.
//
// A run with a trace gives the values by name. The deck gives the cards, and `passes.toml` their
// order of execution and their subscripts.
import { Trace } from "../programs/trace.js";
import { runOf, sceneOf } from "./experiment.js";

const ASSIGNED = /^(?:\d+ +)?([A-Z][A-Z0-9]*(?:\([A-Z0-9,]+\))?) *=/;

// Run a state up to a step, from 1, and return the run and its trace of this step.
export function traced(data, state, step) {
  const trace = new Trace(step);
  return { run: runOf(data, { ...state, steps: step }, trace), trace };
}

// Return the cards of a program, by number, with the changes that the state's switches make. A card
// has its `text` and says whether a correction has `replaced` or `inserted` it.
export function deckOf(data, state) {
  const { deck } = data;
  const own = data.flags.filter((flag) => flag.programs.includes(state.program));
  const active = own.map((flag) => flag.id).filter((name) => state.active.includes(name));
  const cards = new Map();
  for (const [number, text] of deck[state.program].cards) cards.set(number, { text });
  for (const each of deck.alterations) {
    if (each.program !== state.program) continue;
    if (each.corrects && active.includes(each.corrects)) continue;
    if (each.listing === "corrected" && active.length > 0) continue;
    if (each.keeps && !active.includes(each.keeps)) continue;
    for (const number of each.delete ?? []) cards.delete(number);
    for (const [number, text] of each.replace ?? []) cards.set(number, { text, replaced: true });
    for (const [number, text] of each.insert ?? []) cards.set(number, { text, inserted: true });
  }
  return new Map([...cards].sort(([one], [other]) => one - other));
}

// Return the passes of a traced step: for each its title and its lines. A line has the `number` and
// the `text` of a card, and `values`, the names and values that the card assigns. A torque that
// varies with time has lines without a card, because the thesis prints none for it. The card whose
// test `stops` the run is the last that runs; those after it are `skipped`.
export function passesOf(data, state, { run, trace }, step) {
  const take = taken(trace.values);
  const stops = run.stop?.step === step ? run.stop : null;
  const tests = [...(trace.tests[step - 1] ?? [])];
  const cards = [...deckOf(data, state)];
  const { torque, passes } = data.deck[state.program];
  const scene = sceneOf(data, state);
  const varies = scene.initial_torque || scene.torque.sines.length + scene.torque.cosines.length > 0;
  const found = [];
  let stopped = false;
  for (const { title, from, to, set, reading } of passes) {
    const subscripts = reading && state.active.includes(reading.name) ? reading.set : set;
    const lines = [];
    for (const [number, card] of cards) {
      if (number < from || number > to) continue;
      if (stopped) {
        lines.push({ ...card, number, values: [], skipped: true });
        continue;
      }
      const { values, test } = valuesOf(card.text, subscripts, take, tests);
      if (varies && card.text.includes(`=${torque[0]}+`)) {
        lines.push({ text: "the torque of Case 7 has no card", values: torque.flatMap(take) });
      }
      lines.push({ ...card, number, values });
      stopped = test !== null && stops !== null && test[0] === stops.variable;
      lines[lines.length - 1].stops = stopped;
    }
    found.push({ title, subscripts: subscripts ?? {}, lines });
  }
  return found;
}

// Return a function that takes the next value of a name, as a list of pairs.
function taken(values) {
  const queues = new Map();
  for (const [name, value] of values) {
    if (!queues.has(name)) queues.set(name, []);
    queues.get(name).push(value);
  }
  return (name) => {
    const queue = queues.get(name) ?? [];
    return queue.length > 0 ? [[name, queue.shift()]] : [];
  };
}

// Return the values that a card assigns, and the test that it makes or null.
function valuesOf(text, subscripts, take, tests) {
  const bare = text.trim();
  if (bare.startsWith("CALL")) {
    const solved = [1, 2, 3, 4].flatMap((k) =>
      [1, 2, 3, 4, 5, 6].flatMap((unknown) => take(`solved B(${k},${unknown})`)),
    );
    const plain = solved.map(([name, value]) => [name.replace("solved ", ""), value]);
    return { values: [...take("IER"), ...plain], test: null };
  }
  if (/^IF\(.*\.GT\..*LIP\)/.test(bare)) {
    const test = tests.shift() ?? null;
    if (test === null) return { values: [], test };
    return { values: [[`quotient of ${test[0]}`, test[1] / test[2]]], test };
  }
  const assigned = ASSIGNED.exec(bare);
  if (assigned === null) return { values: [], test: null };
  const name = assigned[1].replace(/(?<=[(,])[A-Z](?=[),])/g, (letter) => subscripts?.[letter] ?? letter);
  return { values: take(name), test: null };
}
