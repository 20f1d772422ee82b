// The button that copies the citation.

import { startCopying } from "../laboratory/copying.js";

startCopying();
