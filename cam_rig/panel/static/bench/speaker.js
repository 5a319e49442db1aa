// Audio worklet: plays the received samples, and silence if there are none.

/** Duration (s) of the samples that may wait. Older blocks are dropped, so that the sound stays with the rig. */
const MAX_WAITING_S = 0.2;
/** Duration (s) of the samples with which the sound starts again after a gap. */
const START_S = 0.05;

class Speaker extends AudioWorkletProcessor {
  /** @type {Float32Array[]} */
  blocks = [];
  /** Number of played samples of the first block. */
  played = 0;
  /** Number of samples of all blocks. */
  count = 0;
  isPlaying = false;

  constructor() {
    super();
    this.port.onmessage = ({ data }) => {
      this.blocks.push(data);
      this.count += data.length;
      while (this.count - this.played > MAX_WAITING_S * sampleRate && this.blocks.length > 1) this.#removeBlock();
    };
  }

  /** @param {Float32Array[][]} _ @param {Float32Array[][]} outputs */
  process(_, [[output]]) {
    this.isPlaying = this.count - this.played > (this.isPlaying ? 0 : START_S * sampleRate);
    for (let i = 0; this.isPlaying && i < output.length && this.blocks.length; i += 1) {
      output[i] = this.blocks[0][this.played];
      this.played += 1;
      if (this.played === this.blocks[0].length) this.#removeBlock();
    }
    return true;
  }

  #removeBlock() {
    this.count -= this.blocks[0].length;
    this.blocks.shift();
    this.played = 0;
  }
}

registerProcessor("speaker", Speaker);
