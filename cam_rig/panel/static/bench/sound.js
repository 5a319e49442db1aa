// The rig's sound, on the bench as it comes, in the lab turn by turn; nothing is sent while the volume is 0.
import { decode } from "../common/dom.js";

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

/** The sound of one turn, over and over. */
export class TurnSound extends Loudspeaker {
  /** changed() is told when it begins to be heard. @param {() => void} changed */
  constructor(changed) {
    super();
    this.changed = changed;
    /** @type {AudioBufferSourceNode | null} */
    this.source = null;
  }

  /** @param {number} value */
  volume(value) {
    const changed = super.volume(value);
    if (changed && this.on) this.changed();
    else if (changed) this.#end();
    return changed;
  }

  /** Turn to another turn: base64 of 32-bit floats, and their rate in Hz. @param {string | undefined} data @param {number} rate */
  play(data, rate) {
    if (!this.on || !data || !this.context || !this.gain) return;
    const samples = new Float32Array(decode(data));
    const buffer = this.context.createBuffer(1, samples.length, rate);
    buffer.copyToChannel(samples, 0);
    this.#end();
    this.source = this.context.createBufferSource();
    Object.assign(this.source, { buffer, loop: true });
    this.source.connect(this.gain);
    this.source.start();
  }

  #end() {
    this.source?.stop();
    this.source = null;
  }
}
