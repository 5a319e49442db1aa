// The rig's sound: blocks as they come, one after the other; nothing is sent while the volume is 0.

/** Sound (s) that may wait to be played: more is dropped, so that it stays with the rig. */
const MOST_AHEAD = 0.4;
/** A gap (s) before what comes after an interruption, so that the next block is in time. */
const LEAD = 0.08;

/** The page's loudspeaker, opened when the volume is turned up. */
export class Loudspeaker {
  constructor() { Object.assign(this, { context: null, on: false }); }

  /** Set the volume; whether it begins to be heard, or ends. */
  volume(value) {
    if (!this.context && value > 0) {
      this.context = new AudioContext();
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
    Object.assign(this, { listen, rate: 16000, next: 0 });
  }

  volume(value) { if (super.volume(value)) this.listen(this.on); }

  play(samples) {
    if (!this.on || !samples.length) return;
    const now = this.context.currentTime;
    if (this.next < now) this.next = now + LEAD;
    if (this.next > now + MOST_AHEAD) return;
    const buffer = this.context.createBuffer(1, samples.length, this.rate);
    buffer.copyToChannel(samples, 0);
    const source = this.context.createBufferSource();
    source.buffer = buffer;
    source.connect(this.gain);
    source.start(this.next);
    this.next += buffer.duration;
  }
}
