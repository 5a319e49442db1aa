// The sound of one turn, over and over; nothing is asked for while the volume is 0.

import { Loudspeaker } from "../bench/sound.js";

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
    const bytes = Uint8Array.from(atob(data), (character) => character.charCodeAt(0));
    const samples = new Float32Array(bytes.buffer);
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
