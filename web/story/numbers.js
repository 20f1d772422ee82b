// Return a number as text for a sentence, with some significant digits; the same as `prose` of
// pyharness/history/claims/stories.py.
export function prose(x, digits = 3) {
  if (x === 0 || (Math.abs(x) >= 1e-3 && Math.abs(x) < 1e6)) {
    const rounded = Number(x.toPrecision(digits));
    return Number.isInteger(rounded) ? String(rounded).replace(/\B(?=(\d{3})+$)/g, ",") : String(rounded);
  }
  const [mantissa, power] = x.toExponential(digits - 1).split("e");
  const raised = [...String(Number(power))].map((each) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(each)]);
  return `${Number(mantissa)}\u00a0×\u00a010${raised.join("")}`;
}
