// Runs beside the page: sound that has come, sample by sample, and silence where none has.

/** Samples that may wait: more is dropped, so that the sound stays with the rig. */
const MOST_S = 0.2;

class Speaker extends AudioWorkletProcessor {
  constructor() {
    super();
    /** @type {Float32Array[]} */
    this.blocks = [];
    this.at = 0;
    this.waiting = 0;
    this.playing = false;
    this.port.onmessage = ({ data }) => {
      this.blocks.push(data);
      this.waiting += data.length;
      while (this.waiting - this.at > MOST_S * sampleRate && this.blocks.length > 1) this.#next();
    };
  }

  /** @param {Float32Array[][]} _ @param {Float32Array[][]} outputs */
  process(_, [[out]]) {
    // A gap is followed by a short wait, so that the next block is in time.
    this.playing = this.waiting - this.at > (this.playing ? 0 : 0.05 * sampleRate);
    for (let i = 0; this.playing && i < out.length && this.blocks.length; i += 1) {
      out[i] = this.blocks[0][this.at];
      this.at += 1;
      if (this.at < this.blocks[0].length) continue;
      this.#next();
    }
    return true;
  }

  #next() {
    this.waiting -= this.blocks[0].length;
    this.blocks.shift();
    this.at = 0;
  }
}

registerProcessor("speaker", Speaker);
