// The programs as a port: each input line is a scene with its listing, each output line a run
// (docs/how-to/ports.md).
import { createInterface } from "node:readline";
import { PROGRAMS } from "./programs/programs.js";

// JSON has no -0, no infinity and no NaN, so they are written as text.
function exact(key, value) {
  if (typeof value !== "number") return value;
  if (Object.is(value, -0)) return "-0.0";
  return Number.isFinite(value) ? value : String(value);
}

const SCHEMA = 1;

for await (const line of createInterface({ input: process.stdin })) {
  const { schema, program, scene, listing, lipschitz, may_stop: mayStop } = JSON.parse(line);
  if (schema !== SCHEMA) {
    process.stderr.write(`port.js: schema ${schema}; this port reads schema ${SCHEMA} of a port request\n`);
    process.exit(2);
  }
  const active = new Set([...listing.defects, ...listing.readings, ...listing.conjectures]);
  const run = PROGRAMS[program].run(scene, active, lipschitz, mayStop);
  process.stdout.write(`${JSON.stringify(run, exact)}\n`);
}
