// Polynomials in Bernstein form on u ∈ [0, 1], as cam_rig/laws/polynomials.py. The n + 1 ordinates
// bᵢ are the polynomial Σ bᵢ C(n, i) uⁱ(1 − u)ⁿ⁻ⁱ. Weighted ordinates are bᵢ C(n, i).

/** Distance from 1 to the next float. */
export const EPS = 2 ** -52;

/** Rows of Pascal's triangle by their degree. @type {Map<number, Float64Array>} */
const triangle = new Map();

/** Return row n of Pascal's triangle. @param {number} n */
export function binomials(n) {
  let row = triangle.get(n);
  if (!row) {
    row = new Float64Array(n + 1).fill(1);
    for (let i = 1; i <= n; i += 1) row[i] = Math.round((row[i - 1] * (n + 1 - i)) / i);
    triangle.set(n, row);
  }
  return row;
}

/** Return the largest magnitude. @param {Float64Array} values */
export const largest = (values) => values.reduce((max, value) => Math.max(max, Math.abs(value)), 0);

/** Return the weighted ordinates. @param {Float64Array} ordinates */
const weighted = (ordinates) => {
  const weights = binomials(ordinates.length - 1);
  return ordinates.map((value, i) => weights[i] * value);
};

/** Return the value at u. @param {Float64Array} ordinates @param {number} u */
export function valueAt(ordinates, u) {
  const degree = ordinates.length - 1, weights = binomials(degree), rest = 1 - u;
  let total = 0, power = 1;
  if (u < 0.5) {
    const ratio = u / rest;
    for (let i = degree; i >= 0; i -= 1) {
      total = total * ratio + weights[i] * ordinates[i];
      power *= rest;
    }
    return total * (power / rest);
  }
  const ratio = rest / u;
  for (let i = 0; i <= degree; i += 1) {
    total = total * ratio + weights[i] * ordinates[i];
    power *= u;
  }
  return total * (power / u);
}

/** Return the derivative by u, one degree lower. @param {Float64Array} ordinates */
export function derivative(ordinates) {
  const degree = ordinates.length - 1;
  if (degree === 0) return new Float64Array(1);
  return Float64Array.from({ length: degree }, (_, i) => degree * (ordinates[i + 1] - ordinates[i]));
}

/** Return the same polynomial with another number of ordinates, not fewer. @param {Float64Array} ordinates @param {number} size */
export function elevate(ordinates, size) {
  if (ordinates.length === size) return ordinates;
  const out = new Float64Array(size), factors = binomials(size - ordinates.length);
  weighted(ordinates).forEach((value, i) => factors.forEach((factor, j) => { out[i + j] += value * factor; }));
  const weights = binomials(size - 1);
  return out.map((value, i) => value / weights[i]);
}

/** Return the integral over an interval, `start` at u = 0. @param {Float64Array} ordinates @param {number} length @param {number} start */
export function integrate(ordinates, length, start) {
  const out = new Float64Array(ordinates.length + 1), step = length / ordinates.length;
  let total = 0;
  out[0] = start;
  ordinates.forEach((value, i) => {
    total += value;
    out[i + 1] = step * total + start;
  });
  return out;
}

/** Return the polynomial on [first, last] ⊂ [0, 1], first < 1, by de Casteljau. @param {Float64Array} ordinates @param {number} first @param {number} last */
export function restrict(ordinates, first, last) {
  const out = ordinates.slice(), size = out.length;
  let inner = last;
  if (first > 0) {
    const rest = 1 - first;
    inner = (last - first) / rest;
    for (let count = size - 1; count > 0; count -= 1) {
      for (let i = 0; i < count; i += 1) out[i] = rest * out[i] + first * out[i + 1];
    }
  }
  if (inner < 1) {
    for (let order = 1; order < size; order += 1) {
      for (let i = size - 1; i >= order; i -= 1) out[i] = (1 - inner) * out[i - 1] + inner * out[i];
    }
  }
  return out;
}

/** Return the left and the right half. @param {Float64Array} ordinates @returns {[Float64Array, Float64Array]} */
export function halve(ordinates) {
  const right = ordinates.slice(), left = new Float64Array(right.length);
  for (let order = 0; order < right.length; order += 1) {
    left[order] = right[0];
    for (let i = 0; i < right.length - 1 - order; i += 1) right[i] = 0.5 * (right[i] + right[i + 1]);
  }
  return [left, right];
}
