// The rig's sound: blocks as they come; nothing is sent while the volume is 0.

const VOLUME = "volume";

/** The page's loudspeaker, opened when the volume is turned up. */
export class Loudspeaker {
  constructor() { Object.assign(this, { context: null, on: false }); }

  /** Set the volume; whether it begins to be heard, or ends. */
  volume(value) {
    if (!this.context && value > 0) {
      this.context = new AudioContext({ sampleRate: this.rate });
      this.gain = this.context.createGain();
      this.gain.connect(this.context.destination);
    }
    if (this.context) this.gain.gain.value = value * value; // what one hears goes with the logarithm
    if (value > 0) this.context.resume();
    const changed = this.on !== value > 0;
    this.on = value > 0;
    return changed;
  }
}

export class Sound extends Loudspeaker {
  /** listen(bool) asks for the blocks, or for none. */
  constructor(listen) {
    super();
    Object.assign(this, { listen, rate: 16000, speaker: null });
  }

  /** What was chosen last, from one visit to the next; 0 where nothing was. */
  get remembered() { return Number(localStorage.getItem(VOLUME)) || 0; }

  async volume(value) {
    localStorage.setItem(VOLUME, value);
    if (!super.volume(value)) return;
    this.listen(this.on);
    if (!this.on || this.speaker) return;
    await this.context.audioWorklet.addModule("/static/bench/speaker.js");
    this.speaker ??= new AudioWorkletNode(this.context, "speaker", { numberOfInputs: 0, outputChannelCount: [1] });
    this.speaker.connect(this.gain);
  }

  play(samples) {
    if (this.on && samples.length) this.speaker?.port.postMessage(samples);
  }
}
