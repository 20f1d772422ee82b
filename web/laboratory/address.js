// The words of a page's address, and values that a reader types: read with messages of a line.

const NUMBER = /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i;

// An error whose message says in a line what is wrong with a value.
export class StateError extends Error {}

// Return the words of an address with their values; a word without `=` has the value null. A
// message for each word that is not allowed is added to `problems`.
export function wordsIn(fragment, problems, allowed) {
  const given = new Map();
  for (const part of fragment.replace(/^#/, "").split("&").filter((each) => each !== "")) {
    const [word, ...values] = decoded(part).split("=");
    if (allowed.includes(word)) given.set(word, values.length ? values.join("=") : null);
    else problems.push(`unknown word '${shown(word)}'; allowed: ${allowed.join(", ")}`);
  }
  return given;
}

// Return a function that reads a word with a reader. If the word is missing, or its value is wrong,
// the result is `otherwise`; what is wrong is added to `problems`.
export function readerOf(given, problems) {
  return (word, reader, otherwise) => {
    if (!given.has(word)) return otherwise;
    try {
      return reader(given.get(word), word);
    } catch (error) {
      if (!(error instanceof StateError)) throw error;
      problems.push(error.message);
      return otherwise;
    }
  };
}

// Call `taken` with the value of a field whenever it changes. If the reader refuses the value, its
// message is kept in the map `wrong`, `tell` is called, and the field stays as it is.
export function onField(field, wrong, tell, read, taken) {
  field.addEventListener("change", () => {
    try {
      const value = read(field.value, field.id);
      wrong.delete(field.id);
      taken(value);
    } catch (error) {
      if (!(error instanceof StateError)) throw error;
      wrong.set(field.id, error.message);
      tell();
      field.setAttribute("aria-invalid", "true");
    }
  });
}

// Decode an address. A text with a percent sign that begins no character is returned unchanged.
function decoded(text) {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}

// Return the beginning of a typed text, short enough for a line.
export function shown(text) {
  return [...(text ?? "")].slice(0, 40).join("");
}

export function oneOf(word, text, allowed) {
  if (allowed.includes(text)) return text;
  throw new StateError(`${word}: unknown '${shown(text)}'; allowed: ${allowed.join(", ")}`);
}

// Read a finite number, as the command line does.
export function numberFrom(text, word) {
  const trimmed = (text ?? "").trim();
  if (!NUMBER.test(trimmed)) throw new StateError(`${word}: '${shown(text)}' where a number belongs`);
  const value = Number(trimmed);
  if (Number.isFinite(value)) return value;
  throw new StateError(`${word}: '${shown(text)}' is not finite; allowed: finite numbers`);
}

export function threeFrom(text, word, example) {
  const parts = (text ?? "").split(",");
  if (parts.length === 3) return parts.map((part) => numberFrom(part, word));
  throw new StateError(`${word}: ${parts.length} numbers; allowed: three, as in ${example}`);
}
