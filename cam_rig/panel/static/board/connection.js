// Websocket of the board. One change is sent at a time, and only the newest change waits.

/** Time (ms) after which a lost connection is opened again. */
const RETRY_MS = 500;

export class Connection {
  /**
   * @param {(number: number) => object} read returns the change of a number to be sent
   * @param {(message: BoardMessage, isPending: boolean) => void} onMessage
   * @param {(isOpen: boolean) => void} onStatus
   */
  constructor(read, onMessage, onStatus) {
    this.read = read;
    this.onMessage = onMessage;
    this.onStatus = onStatus;
    this.number = 0;
    /** Number of the change that has no answer yet. @type {number | null} */
    this.unanswered = null;
    this.hasChange = false;
    this.socket = this.#open();
  }

  #open() {
    const socket = new WebSocket(`ws://${location.host}/changes`);
    socket.onopen = () => {
      this.unanswered = null;
      this.onStatus(true);
      this.flush();
    };
    socket.onclose = () => {
      if (this.unanswered !== null) this.hasChange = true; // it may not have arrived
      this.onStatus(false);
      setTimeout(() => { this.socket = this.#open(); }, RETRY_MS);
    };
    socket.onmessage = ({ data }) => {
      const message = /** @type {BoardMessage} */ (JSON.parse(data));
      if (message.number != null && message.number === this.unanswered) this.unanswered = null;
      // The change of another page must not replace a change of this page that is not sent yet.
      if (message.type !== "changed" || !this.isPending) this.onMessage(message, this.isPending);
      this.flush();
    };
    return socket;
  }

  get isPending() { return this.hasChange || this.unanswered !== null; }

  /** Send a change as soon as possible. */
  change() {
    this.hasChange = true;
    this.flush();
  }

  /** Send the newest change unless another has no answer yet. */
  flush() {
    if (!this.hasChange || this.unanswered !== null || this.socket.readyState !== WebSocket.OPEN) return;
    this.hasChange = false;
    this.number += 1;
    this.unanswered = this.number;
    this.socket.send(JSON.stringify({ number: this.number, ...this.read(this.number) }));
  }
}
