// Runs beside the page: sound that has come, sample by sample, and silence where none has.

/** Samples that may wait: more is dropped, so that the sound stays with the rig. */
const MOST_S = 0.2;

class Speaker extends AudioWorkletProcessor {
  constructor() {
    super();
    Object.assign(this, { blocks: [], at: 0, waiting: 0, playing: false });
    this.port.onmessage = ({ data }) => {
      this.blocks.push(data);
      this.waiting += data.length;
      while (this.waiting - this.at > MOST_S * sampleRate && this.blocks.length > 1) {
        this.waiting -= this.blocks.shift().length;
        this.at = 0;
      }
    };
  }

  process(_, [[out]]) {
    // A gap is followed by a short wait, so that the next block is in time.
    this.playing = this.waiting - this.at > (this.playing ? 0 : 0.05 * sampleRate);
    for (let i = 0; this.playing && i < out.length && this.blocks.length; i += 1) {
      out[i] = this.blocks[0][this.at];
      this.at += 1;
      if (this.at < this.blocks[0].length) continue;
      this.waiting -= this.blocks.shift().length;
      this.at = 0;
    }
    return true;
  }
}

registerProcessor("speaker", Speaker);
