// Sender of the newest value: one value at a time, and of those that arrive meanwhile only the last.

/** @template Value */
export class LatestSender {
  isBusy = false;
  /** @type {{value: Value} | null} */
  #waiting = null;

  /** @param {(value: Value) => Promise<unknown>} send */
  constructor(send) { this.send = send; }

  /** @param {Value} value */
  async put(value) {
    this.#waiting = { value };
    if (this.isBusy) return;
    this.isBusy = true;
    try {
      while (this.#waiting) {
        const { value: next } = this.#waiting;
        this.#waiting = null;
        await this.send(next);
      }
    } finally {
      this.isBusy = false; // otherwise an error would block all later values
    }
  }
}
