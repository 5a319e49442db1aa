/* Search in a page opened as a file: browsers start no Worker there, so a hidden frame does its work. */
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      this.waiting = [];
      this.frame = document.createElement("iframe");
      this.frame.hidden = true;
      addEventListener("message", (event) => {
        if (event.source !== this.frame.contentWindow) return;
        const message = new MessageEvent("message", { data: event.data });
        this.dispatchEvent(message);
        if (this.onmessage) this.onmessage(message);
      });
      document.addEventListener("DOMContentLoaded", () => this.start(url));
      if (document.readyState !== "loading") this.start(url);
    }
    start(url) {
      if (this.frame.isConnected) return;
      document.body.appendChild(this.frame);
      const inner = this.frame.contentWindow;
      const script = (address) => new Promise((resolve, reject) => {
        const element = inner.document.createElement("script");
        Object.assign(element, { src: address, async: false, onload: resolve, onerror: reject });
        inner.document.body.appendChild(element);
      });
      inner.postMessage = (data) => postMessageFrom(inner, data);
      inner.importScripts = (...urls) => Promise.all(urls.map((one) => script(new URL(one, url))));
      const postMessageFrom = (source, data) =>
        dispatchEvent(new MessageEvent("message", { data, source }));
      script(url).then(() => { this.ready = true; this.waiting.splice(0).forEach((d) => this.postMessage(d)); });
    }
    postMessage(data) {
      if (!this.ready) { this.waiting.push(data); return; }
      const inner = this.frame.contentWindow;
      inner.dispatchEvent(new inner.MessageEvent("message", { data }));
    }
    terminate() { this.frame.remove(); }
  };
}
