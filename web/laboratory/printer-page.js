// The page that a line printer did, by the FORMATs of the deck: the same text as
// `pyharness run --format printer`.
//
// The first character of each record, the carriage control, is taken off.

// `formats` has header, heads and rows of the program; `run` is what it returned.
export function printerPage(formats, scene, run) {
  // A law of time stands on no card: the torques of the cards are the constant ones, or those that
  // Table 1 gives initially.
  const cards = scene.initial_torque ?? scene.torque.constant;
  const head = scene.body.moments.flatMap((moment, axis) => [moment, cards[axis]]);
  const row = parsed(formats.rows);
  const records = [...write(parsed(formats.header), head), ...write(parsed(formats.heads), [])];
  run.rows.forEach(([, ...values], index) => {
    const numbers = run.ier === null ? [index + 1] : [index + 1, run.ier[index]];
    records.push(...write(row, [...values.slice(0, 3), ...numbers, ...values.slice(3)]));
  });
  return records.map((record) => `${record.slice(1).trimEnd()}\n`).join("");
}

// The descriptors of a FORMAT: nX, nH, Fw.d, Iw and the slash.
function parsed(format) {
  const descriptors = [];
  let rest = format.slice(1, -1);
  while (rest !== "") {
    const text = /^(\d+)H/.exec(rest);
    const other = /^(?:(\d+)X|F(\d+)\.(\d+)|I(\d+)|\/)(?=,|$)/.exec(rest);
    let length;
    if (text !== null) {
      length = text[0].length + Number(text[1]);
      descriptors.push({ text: rest.slice(text[0].length, length) });
    } else if (other !== null) {
      const [all, blanks, width, places, digits] = other;
      length = all.length;
      if (all === "/") descriptors.push({ slash: true });
      else if (blanks) descriptors.push({ text: " ".repeat(Number(blanks)) });
      else descriptors.push({ width: Number(width ?? digits), places: Number(places ?? 0) });
    } else {
      throw new Error(`no descriptor of a FORMAT: ${rest}`);
    }
    rest = rest.slice(length).replace(/^,/, "");
  }
  return descriptors;
}

// The records of one WRITE. A FORMAT with values left begins again in a new record; one without
// goes on to the next place for a value.
function write(descriptors, values) {
  const records = [""];
  const left = [...values];
  for (;;) {
    for (const { text, slash, width, places } of descriptors) {
      if (slash) records.push("");
      else if (text !== undefined) records[records.length - 1] += text;
      else if (left.length === 0) return records;
      else records[records.length - 1] += edited(left.shift(), width, places);
    }
    if (left.length === 0) return records;
    records.push("");
  }
}

// A number in its field; halves go away from zero, which has no sign, and what does not fit, or is
// not finite, is asterisks.
function edited(value, width, places) {
  const size = Math.abs(value);
  const digits = size.toFixed(places);
  const text = value < 0 && Number(digits) !== 0 ? `-${digits}` : digits;
  // A billion has more digits than any field; what toFixed writes beyond 1e21 is no digits.
  return size < 1e9 && text.length <= width ? text.padStart(width) : "*".repeat(width);
}
