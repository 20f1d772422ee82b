// Return a number with some significant digits, for reading, as in `3305` or `2.5 × 10⁻⁷`; the same
// as `brief` of pyharness/edition/story.py.
export function brief(value, digits = 3) {
  const [mantissa, power] = value.toExponential(digits - 1).split("e");
  if (value === 0 || (power >= -4 && power < 6)) return String(Number(value.toPrecision(digits)));
  const raised = [...String(Number(power))].map((each) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(each)]);
  return `${Number(mantissa)}\u00a0×\u00a010${raised.join("")}`;
}
