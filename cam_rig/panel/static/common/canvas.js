// Canvases as sharp as the screen, in the colours of the page.

/** @param {HTMLCanvasElement} canvas */
export const contextOf = (canvas) => /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));

/** Return the screen pixels per px of the page, at most two. More cannot be distinguished. */
export const pixelRatio = () => Math.min(2, devicePixelRatio);

/** Clear a canvas and set its size in px. @param {HTMLCanvasElement} canvas @param {number} width @param {number} height */
export function resizeCanvas(canvas, width, height) {
  const ratio = pixelRatio();
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  [canvas.style.width, canvas.style.height] = [`${width}px`, `${height}px`];
  contextOf(canvas).scale(ratio, ratio);
}

/** @param {HTMLCanvasElement} canvas */
export function clearCanvas(canvas) {
  const context = contextOf(canvas);
  context.save();
  context.resetTransform();
  context.clearRect(0, 0, canvas.width, canvas.height);
  context.restore();
}

/** Return variables of the style sheet, which differ in light and dark. @template {string} T @param {readonly T[]} names */
export function readColours(names) {
  const style = getComputedStyle(document.documentElement);
  const entries = names.map((name) => [name, style.getPropertyValue(`--${name}`)]);
  return /** @type {Record<T, string>} */ (Object.fromEntries(entries));
}

/** Call a function when the page becomes light or dark, or is printed. @param {() => void} onChange */
export function onColourChange(onChange) {
  for (const query of ["(prefers-color-scheme: dark)", "print"]) matchMedia(query).addEventListener("change", onChange);
}
