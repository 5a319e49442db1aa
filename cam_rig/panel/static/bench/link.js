// The socket to the bench: what is asked has a number and an answer; the state comes by itself.

const AGAIN_MS = 500;
/** Bytes of the name that a block begins with. */
export const NAME = 8;
const named = (/** @type {ArrayBuffer} */ data) => String.fromCharCode(...new Uint8Array(data, 0, NAME)).trim();

export class Link {
  /**
   * live(message), motion(buffer), sound(floats) and connected(bool) are told.
   * @param {(message: Live) => void} live
   * @param {(block: ArrayBuffer) => void} motion
   * @param {(samples: Float32Array) => void} sound
   * @param {(on: boolean) => void} connected
   */
  constructor(live, motion, sound, connected) {
    this.live = live;
    this.motion = motion;
    this.sound = sound;
    this.connected = connected;
    this.number = 0;
    /** @type {Map<number, (answer: Answer) => void>} */
    this.asked = new Map();
    this.socket = this.#open();
  }

  #open() {
    const socket = new WebSocket(`ws://${location.host}/bench/live`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => this.connected(true);
    socket.onclose = () => {
      for (const answer of this.asked.values()) answer({ success: false, words: "" });
      this.asked.clear();
      this.connected(false);
      setTimeout(() => { this.socket = this.#open(); }, AGAIN_MS);
    };
    socket.onmessage = ({ data }) => {
      if (data instanceof ArrayBuffer) return named(data) === "sound" ? this.sound(new Float32Array(data, NAME)) : this.motion(data);
      const message = JSON.parse(data);
      if (message.type !== "answer") return this.live(message);
      this.asked.get(message.answer)?.(message);
      this.asked.delete(message.answer);
    };
    return socket;
  }

  /** What the bench answers to a command: success, and words. @param {object} command @returns {Promise<Answer>} */
  ask(command) {
    if (this.socket.readyState !== WebSocket.OPEN) return Promise.resolve({ success: false, words: "" });
    this.number += 1;
    const number = this.number;
    this.socket.send(JSON.stringify({ number, ...command }));
    return new Promise((answer) => this.asked.set(number, answer));
  }
}

/** Sends the newest value, one at a time; what comes meanwhile waits, and only the last of it. @template T */
export class Newest {
  /** @param {(value: T) => Promise<unknown>} send */
  constructor(send) {
    this.send = send;
    this.busy = false;
    /** @type {{value: T} | null} */
    this.waiting = null;
  }

  get pending() { return this.busy; }

  /** @param {T} value */
  async put(value) {
    this.waiting = { value };
    if (this.busy) return;
    this.busy = true;
    try {
      while (this.waiting) {
        const { value: next } = this.waiting;
        this.waiting = null;
        await this.send(next);
      }
    } finally {
      this.busy = false; // else nothing would be sent any more
    }
  }
}
