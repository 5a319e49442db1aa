// Units of the core: angles in rad, lengths in m, speeds in rad/s.

/** Turn of the cam, rad. */
export const TURN = 2 * Math.PI;
/** Degrees per radian. */
export const DEGREE = 180 / Math.PI;
/** Speed (rad/s) of one turn per minute. */
export const RPM = TURN / 60;
/** Millimetres per metre. */
export const MM = 1e3;
