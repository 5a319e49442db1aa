// Refusals of a law or a follower, with the messages of the Python package, which the pages translate.

/** Error of a law or a follower. */
export class RefusedError extends Error {}

/** Return a number as Python's format g with significant digits, as in the messages of the server. @param {number} value @param {number} digits */
export function general(value, digits) {
  const [mantissa, power] = value.toExponential(digits - 1).split("e"), exponent = Number(power);
  const trim = (/** @type {string} */ text) => (text.includes(".") ? text.replace(/\.?0+$/, "") : text);
  if (exponent >= -4 && exponent < digits) return trim(value.toFixed(digits - 1 - exponent));
  return `${trim(mantissa)}e${exponent < 0 ? "-" : "+"}${String(Math.abs(exponent)).padStart(2, "0")}`;
}
