// What is drawn on a canvas: as sharp as the screen, and in the page's own colours.

/** @param {HTMLCanvasElement} canvas */
export const brush = (canvas) => /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));

/** Pixels of the screen to a px of the page; more than two are not told apart. */
export const sharpness = () => Math.min(2, devicePixelRatio);

/** Empty, and to be drawn on in px. @param {HTMLCanvasElement} canvas @param {number} width @param {number} height */
export function size(canvas, width, height) {
  const scale = sharpness();
  canvas.width = Math.round(width * scale);
  canvas.height = Math.round(height * scale);
  [canvas.style.width, canvas.style.height] = [`${width}px`, `${height}px`];
  brush(canvas).scale(scale, scale);
}

/** @param {HTMLCanvasElement} canvas */
export function wipe(canvas) {
  const context = brush(canvas);
  context.save();
  context.resetTransform();
  context.clearRect(0, 0, canvas.width, canvas.height);
  context.restore();
}

/** The style sheet's variables as they are now, light or dark. @template {string} T @param {readonly T[]} names */
export function colours(names) {
  const style = getComputedStyle(document.documentElement);
  return /** @type {Record<T, string>} */ (Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`)])));
}

/** Tell of a page that becomes light or dark, or goes on paper. @param {() => void} told */
export function recoloured(told) {
  for (const query of ["(prefers-color-scheme: dark)", "print"]) matchMedia(query).addEventListener("change", told);
}
