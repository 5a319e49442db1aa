// Sound of the rig: continuous on the bench, one repeated turn in the lab. No data are sent while the volume is 0.
import { decodeBase64 } from "../common/dom.js";

/** Key of localStorage under which the volume is kept. */
const VOLUME = "volume";

/** Output of the page, created when the volume is first raised. */
class Output {
  /** @type {AudioContext | null} */
  context = null;
  /** @type {GainNode | null} */
  gain = null;
  /** Sample rate in Hz, or undefined for that of the browser. @type {number | undefined} */
  rate = undefined;
  isOn = false;

  /** Set the volume. Return true if the sound is switched on or off. @param {number} volume */
  setVolume(volume) {
    if (!this.context && volume > 0) {
      this.context = new AudioContext({ sampleRate: this.rate });
      this.gain = this.context.createGain();
      this.gain.connect(this.context.destination);
    }
    if (this.gain) this.gain.gain.value = volume * volume; // loudness is perceived logarithmically
    if (volume > 0) this.context?.resume();
    const hasChanged = this.isOn !== volume > 0;
    this.isOn = volume > 0;
    return hasChanged;
  }
}

/** Continuous sound of the bench. */
export class LiveSound extends Output {
  rate = 16000;
  /** @type {AudioWorkletNode | null} */
  speaker = null;

  /** @param {(isOn: boolean) => void} onSwitch requests the blocks of sound, or ends them */
  constructor(onSwitch) {
    super();
    this.onSwitch = onSwitch;
  }

  /** Volume of the last visit, 0 without one. */
  get storedVolume() { return Number(localStorage.getItem(VOLUME)) || 0; }

  /** @param {number} volume */
  setVolume(volume) {
    localStorage.setItem(VOLUME, String(volume));
    const hasChanged = super.setVolume(volume);
    if (hasChanged) this.#switch();
    return hasChanged;
  }

  async #switch() {
    this.onSwitch(this.isOn);
    if (!this.isOn || this.speaker || !this.context || !this.gain) return;
    await this.context.audioWorklet.addModule("/static/bench/speaker.js");
    this.speaker ??= new AudioWorkletNode(this.context, "speaker", { numberOfInputs: 0, outputChannelCount: [1] });
    this.speaker.connect(this.gain);
  }

  /** @param {Float32Array} samples */
  play(samples) {
    if (this.isOn && samples.length) this.speaker?.port.postMessage(samples);
  }
}

/** Repeated sound of one turn in the lab. */
export class TurnSound extends Output {
  /** @type {AudioBufferSourceNode | null} */
  source = null;

  /** @param {() => void} onStart requests the sound of the present turn */
  constructor(onStart) {
    super();
    this.onStart = onStart;
  }

  /** @param {number} volume */
  setVolume(volume) {
    const hasChanged = super.setVolume(volume);
    if (hasChanged && this.isOn) this.onStart();
    else if (hasChanged) this.#stop();
    return hasChanged;
  }

  /** Repeat a turn, given as 32-bit floats in base64. @param {string | undefined} base64 @param {number} rate Hz */
  play(base64, rate) {
    if (!this.isOn || !base64 || !this.context || !this.gain) return;
    const samples = new Float32Array(decodeBase64(base64));
    const buffer = this.context.createBuffer(1, samples.length, rate);
    buffer.copyToChannel(samples, 0);
    this.#stop();
    this.source = this.context.createBufferSource();
    Object.assign(this.source, { buffer, loop: true });
    this.source.connect(this.gain);
    this.source.start();
  }

  #stop() {
    this.source?.stop();
    this.source = null;
  }
}
