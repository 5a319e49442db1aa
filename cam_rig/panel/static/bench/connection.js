// Websocket of the bench. Each command has a number and gets an answer. The server sends state, motion and sound.

/** Time (ms) after which a lost connection is opened again. */
const RETRY_MS = 500;
/** Bytes of the name at the start of a block. */
export const NAME_BYTES = 8;
/** @param {ArrayBuffer} block */
const nameOf = (block) => String.fromCharCode(...new Uint8Array(block, 0, NAME_BYTES)).trim();

/** @type {Answer} */
const NO_CONNECTION = { success: false, message: "" };

export class Connection {
  /**
   * @param {{onLive: (message: Live) => void, onMotion: (block: ArrayBuffer) => void,
   *   onSound: (samples: Float32Array) => void, onStatus: (isOpen: boolean) => void}} callbacks
   */
  constructor(callbacks) {
    this.callbacks = callbacks;
    this.number = 0;
    /** Receivers of the answers by number. @type {Map<number, (answer: Answer) => void>} */
    this.pending = new Map();
    this.socket = this.#open();
  }

  #open() {
    const { onLive, onMotion, onSound, onStatus } = this.callbacks;
    const socket = new WebSocket(`ws://${location.host}/bench/live`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => onStatus(true);
    socket.onclose = () => {
      for (const resolve of this.pending.values()) resolve(NO_CONNECTION);
      this.pending.clear();
      onStatus(false);
      setTimeout(() => { this.socket = this.#open(); }, RETRY_MS);
    };
    socket.onmessage = ({ data }) => {
      if (data instanceof ArrayBuffer) {
        if (nameOf(data) === "sound") onSound(new Float32Array(data, NAME_BYTES));
        else onMotion(data);
        return;
      }
      const message = JSON.parse(data);
      if (message.type === "live") return onLive(message);
      this.pending.get(message.answer)?.(message);
      this.pending.delete(message.answer);
    };
    return socket;
  }

  /** Send a command and return its answer. @param {object} command @returns {Promise<Answer>} */
  request(command) {
    if (this.socket.readyState !== WebSocket.OPEN) return Promise.resolve(NO_CONNECTION);
    this.number += 1;
    this.socket.send(JSON.stringify({ number: this.number, ...command }));
    return new Promise((resolve) => this.pending.set(this.number, resolve));
  }
}
