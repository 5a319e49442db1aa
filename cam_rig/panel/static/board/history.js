// Undo and redo: states before and after each gesture.

/** @template T what there is at a time */
export class History {
  /**
   * now() gives it, put(before) puts it back, told() is told of a change.
   * @param {() => T} now @param {(before: T) => void} put @param {() => void} told
   */
  constructor(now, put, told) {
    this.now = now;
    this.put = put;
    this.told = told;
    /** @type {T[]} */
    this.past = [];
    /** @type {T[]} */
    this.future = [];
    /** @type {T | null} */
    this.before = null;
  }

  begin() { this.before ??= this.now(); }

  end() {
    const before = this.before;
    this.before = null;
    if (before === null || JSON.stringify(before) === JSON.stringify(this.now())) return;
    this.past.push(before);
    this.future = [];
    this.told();
  }

  undo() { this.#move(this.past, this.future); }

  redo() { this.#move(this.future, this.past); }

  /** @param {T[]} from @param {T[]} to */
  #move(from, to) {
    const before = from.pop();
    if (before === undefined) return;
    to.push(this.now());
    this.put(before);
    this.told();
  }
}
