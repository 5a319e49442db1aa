// What a handle pulls: its own ordinate, and those beside it by a raised cosine of the cam angle.

/**
 * Weights of the handles that are moved with one of them: [handle, weight], its own is 1.
 *
 * The cosine reaches `width` (rad) to either side, and no farther than the ordinates that keep the
 * end of the segment as it is, so that the law stays smooth there.
 * @param {Handle[]} handles @param {Handle} own @param {number} width @returns {[Handle, number][]}
 */
export function weights(handles, own, width) {
  /** @type {[Handle, number][]} */
  const found = [[own, 1]];
  const [left, right] = [Math.min(width, own.left), Math.min(width, own.right)];
  for (const other of handles) {
    if (other.segment !== own.segment || other.index === own.index) continue;
    const away = other.left - own.left;
    const part = away < 0 ? -away / left : away / right;
    if (part < 1) found.push([other, (1 + Math.cos(Math.PI * part)) / 2]);
  }
  return found;
}
