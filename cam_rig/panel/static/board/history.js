// Undo and redo: the values before and after each gesture.

/** @template Value */
export class History {
  /** @type {Value[]} */
  past = [];
  /** @type {Value[]} */
  future = [];
  /** Value at the start of the present gesture, null without a gesture. @type {Value | null} */
  before = null;

  /** @param {() => Value} read returns the present value @param {(value: Value) => void} restore */
  constructor(read, restore) {
    this.read = read;
    this.restore = restore;
  }

  /** Start a gesture, which is undone as one step. */
  begin() { this.before ??= this.read(); }

  /** End the gesture. */
  end() {
    const { before } = this;
    this.before = null;
    if (before === null || JSON.stringify(before) === JSON.stringify(this.read())) return;
    this.past.push(before);
    this.future = [];
  }

  undo() { this.#move(this.past, this.future); }

  redo() { this.#move(this.future, this.past); }

  /** @param {Value[]} source @param {Value[]} target */
  #move(source, target) {
    const value = source.pop();
    if (value === undefined) return;
    target.push(this.read());
    this.restore(value);
  }
}
