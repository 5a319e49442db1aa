// The socket to the bench: what is asked has a number and an answer; the state comes by itself.

const AGAIN_MS = 500;
/** Bytes of the name that a block begins with. */
export const NAME = 8;
const named = (data) => String.fromCharCode(...new Uint8Array(data, 0, NAME)).trim();

export class Link {
  /** live(message), motion(buffer), sound(floats) and connected(bool) are told. */
  constructor(live, motion, sound, connected) {
    Object.assign(this, { live, motion, sound, connected, number: 0, asked: new Map() });
    this.#open();
  }

  #open() {
    this.socket = new WebSocket(`ws://${location.host}/bench/live`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => this.connected(true);
    this.socket.onclose = () => {
      for (const answer of this.asked.values()) answer({ success: false, words: "" });
      this.asked.clear();
      this.connected(false);
      setTimeout(() => this.#open(), AGAIN_MS);
    };
    this.socket.onmessage = ({ data }) => {
      if (data instanceof ArrayBuffer) return named(data) === "sound" ? this.sound(new Float32Array(data, NAME)) : this.motion(data);
      const message = JSON.parse(data);
      if (message.type !== "answer") return this.live(message);
      this.asked.get(message.answer)?.(message);
      this.asked.delete(message.answer);
    };
  }

  /** What the bench answers to a command: success, and words. */
  ask(command) {
    if (this.socket.readyState !== WebSocket.OPEN) return Promise.resolve({ success: false, words: "" });
    this.number += 1;
    const number = this.number;
    this.socket.send(JSON.stringify({ number, ...command }));
    return new Promise((answer) => this.asked.set(number, answer));
  }
}

/** Sends the newest value, one at a time; what comes meanwhile waits, and only the last of it. */
export class Newest {
  constructor(send) { Object.assign(this, { send, busy: false, waiting: null }); }

  get pending() { return this.busy; }

  async put(value) {
    this.waiting = { value };
    if (this.busy) return;
    this.busy = true;
    while (this.waiting) {
      const { value: next } = this.waiting;
      this.waiting = null;
      await this.send(next);
    }
    this.busy = false;
  }
}
