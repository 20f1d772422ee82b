// The three programs by name.
import * as fourTerm from "./four-term.js";
import * as rungeKutta from "./runge-kutta.js";
import * as twoTerm from "./two-term.js";

export const PROGRAMS = { "two-term": twoTerm, "four-term": fourTerm, "runge-kutta": rungeKutta };
