// The rig's sound: blocks as they come; nothing is sent while the volume is 0.

const VOLUME = "volume";

/** The page's loudspeaker, opened when the volume is turned up. */
export class Loudspeaker {
  constructor() {
    /** @type {AudioContext | null} */
    this.context = null;
    /** @type {GainNode | null} */
    this.gain = null;
    /** Of the samples, Hz; the browser's own where it does not matter. @type {number | undefined} */
    this.rate = undefined;
    this.on = false;
  }

  /** Set the volume; whether it begins to be heard, or ends. @param {number} value */
  volume(value) {
    if (!this.context && value > 0) {
      this.context = new AudioContext({ sampleRate: this.rate });
      this.gain = this.context.createGain();
      this.gain.connect(this.context.destination);
    }
    if (this.gain) this.gain.gain.value = value * value; // what one hears goes with the logarithm
    if (value > 0) this.context?.resume();
    const changed = this.on !== value > 0;
    this.on = value > 0;
    return changed;
  }
}

export class Sound extends Loudspeaker {
  /** listen(bool) asks for the blocks, or for none. @param {(on: boolean) => void} listen */
  constructor(listen) {
    super();
    this.listen = listen;
    this.rate = 16000;
    /** @type {AudioWorkletNode | null} */
    this.speaker = null;
  }

  /** What was chosen last, from one visit to the next; 0 where nothing was. */
  get remembered() { return Number(localStorage.getItem(VOLUME)) || 0; }

  /** @param {number} value */
  volume(value) {
    localStorage.setItem(VOLUME, String(value));
    const changed = super.volume(value);
    if (changed) this.#listen();
    return changed;
  }

  async #listen() {
    this.listen(this.on);
    if (!this.on || this.speaker || !this.context || !this.gain) return;
    await this.context.audioWorklet.addModule("/static/bench/speaker.js");
    this.speaker ??= new AudioWorkletNode(this.context, "speaker", { numberOfInputs: 0, outputChannelCount: [1] });
    this.speaker.connect(this.gain);
  }

  /** @param {Float32Array} samples */
  play(samples) {
    if (this.on && samples.length) this.speaker?.port.postMessage(samples);
  }
}
