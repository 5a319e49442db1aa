// Undo and redo: states before and after each gesture.

export class History {
  constructor(now, put, told) {
    Object.assign(this, { now, put, told, past: [], future: [], before: null });
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

  #move(from, to) {
    if (!from.length) return;
    to.push(this.now());
    this.put(from.pop());
    this.told();
  }
}
