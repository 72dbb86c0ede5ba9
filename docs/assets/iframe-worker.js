// Search where a page is opened from a folder: browsers allow no workers there, so the program of
// the search runs in a hidden frame of the page instead, and hears and says messages as a worker.
"use strict";
if (location.protocol === "file:") {
  window.IFrameWorker = class extends EventTarget { // by this name the search looks for its folder
    constructor(url) {
      super();
      const frame = document.createElement("iframe");
      frame.hidden = true;
      frame.title = "search";
      document.body.appendChild(frame);
      const inside = frame.contentWindow;
      const home = new URL(url, location.href);
      const say = (to, data) => to.dispatchEvent(new MessageEvent("message", { data }));
      const load = (address) => new Promise((done, failed) => {
        const script = inside.document.createElement("script");
        script.src = new URL(address, home);
        script.onload = done;
        script.onerror = failed;
        inside.document.body.appendChild(script);
      });
      inside.postMessage = (data) => say(this, data);
      inside.importScripts = (...addresses) =>
        addresses.reduce((before, address) => before.then(() => load(address)), Promise.resolve());
      this.inside = load(home.href).then(() => (data) => say(inside, data));
    }
    postMessage(data) {
      this.inside.then((hear) => hear(data));
    }
    terminate() {}
  };
  window.Worker = window.IFrameWorker;
}
