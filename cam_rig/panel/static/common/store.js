// State of a page: one object, and one function that renders it.

/** State of a page. @template {object} State */
export class Store {
  #isScheduled = false;

  /** @param {State} state @param {(state: State) => void} render called at most once per frame */
  constructor(state, render) {
    this.state = state;
    this.render = render;
  }

  /** Change values of the state, and render it with the next frame. @param {Partial<State>} [changes] */
  update(changes = {}) {
    Object.assign(this.state, changes);
    if (this.#isScheduled) return;
    this.#isScheduled = true;
    requestAnimationFrame(() => {
      this.#isScheduled = false;
      this.render(this.state);
    });
  }
}

/**
 * Return a function that calls `compute` only if an argument differs from that of the last call.
 * @template {unknown[]} Arguments @template Result
 * @param {(...values: Arguments) => Result} compute @returns {(...values: Arguments) => Result}
 */
export function cached(compute) {
  /** @type {{values: Arguments, result: Result} | null} */
  let last = null;
  return (...values) => {
    if (!last || values.some((value, i) => value !== last?.values[i])) last = { values, result: compute(...values) };
    return last.result;
  };
}
