// Changes to the server: each has a number, one is on its way at a time, and the newest wins.

const AGAIN_MS = 500;

export class Wire {
  /**
   * state() gives what is to be sent; heard(message) and connected(bool) are told.
   * @param {(number: number) => object} state
   * @param {(message: BoardMessage, pending: boolean) => void} heard
   * @param {(on: boolean) => void} connected
   */
  constructor(state, heard, connected) {
    this.state = state;
    this.heard = heard;
    this.connected = connected;
    this.number = 0;
    /** @type {number | null} */
    this.waiting = null;
    this.dirty = false;
    this.socket = this.#open();
  }

  #open() {
    const socket = new WebSocket(`ws://${location.host}/changes`);
    socket.onopen = () => {
      this.waiting = null;
      this.connected(true);
      this.flush();
    };
    socket.onclose = () => {
      if (this.waiting !== null) this.dirty = true; // whether it arrived is not known
      this.connected(false);
      setTimeout(() => { this.socket = this.#open(); }, AGAIN_MS);
    };
    socket.onmessage = ({ data }) => {
      const message = /** @type {BoardMessage} */ (JSON.parse(data));
      if (message.number != null && message.number === this.waiting) this.waiting = null;
      // Another page's change is not taken over an own one that is still to be sent.
      if (message.type !== "moved" || !this.pending) this.heard(message, this.pending);
      this.flush();
    };
    return socket;
  }

  get pending() { return this.dirty || this.waiting !== null; }

  /** Something changed. */
  change() {
    this.dirty = true;
    this.flush();
  }

  /** Send the newest, unless one is on its way. */
  flush() {
    if (!this.dirty || this.waiting !== null || this.socket.readyState !== WebSocket.OPEN) return;
    this.dirty = false;
    this.number += 1;
    this.waiting = this.number;
    this.socket.send(JSON.stringify({ number: this.number, ...this.state(this.number) }));
  }
}
