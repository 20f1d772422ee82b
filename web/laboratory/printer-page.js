// The page of the line printer, by the FORMATs of the deck: the same text as
// `pyharness run --format printer`.
//
// The first character of each record, the carriage control, is removed.

// `formats` has the FORMATs header, heads and rows of the program; `run` is the program's result.
export function printerPage(formats, scene, run) {
  // No card contains a torque that depends on time. The torques of the cards are the constant ones,
  // or the initial ones of Table 1.
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

// Return the descriptors of a FORMAT: nX, nH, Fw.d, Iw and the slash.
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

// Return the records of one WRITE. If values are left at its end, a FORMAT begins again in a new
// record. If no values are left, output ends at the next descriptor of a value.
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

// Return a number as its field shows it. Halves are rounded away from zero, zero has no sign, and a
// number that does not fit or is not finite becomes asterisks.
function edited(value, width, places) {
  const size = Math.abs(value);
  const digits = size.toFixed(places);
  const text = value < 0 && Number(digits) !== 0 ? `-${digits}` : digits;
  // A billion has more digits than any field, and from 1e21 on toFixed does not write digits.
  return size < 1e9 && text.length <= width ? text.padStart(width) : "*".repeat(width);
}
