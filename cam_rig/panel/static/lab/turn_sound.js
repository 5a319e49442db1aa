// The sound of one turn, over and over; nothing is asked for while the volume is 0.

export class TurnSound {
  /** changed() is told when it begins to be heard. */
  constructor(changed) { Object.assign(this, { changed, context: null, on: false }); }

  volume(value) {
    if (!this.context && value > 0) {
      this.context = new AudioContext();
      this.gain = this.context.createGain();
      this.gain.connect(this.context.destination);
    }
    const began = !this.on && value > 0;
    this.on = value > 0;
    if (this.context) this.gain.gain.value = value * value; // what one hears goes with the logarithm
    if (!this.on) this.#end();
    if (began) {
      this.context.resume();
      this.changed();
    }
  }

  /** Turn to another turn: base64 of 32-bit floats, and their rate in Hz. */
  play(data, rate) {
    if (!this.on || !data) return;
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
