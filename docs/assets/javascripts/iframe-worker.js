// Search on pages that are opened from disk, where a browser starts no worker: the worker's script
// runs in a hidden frame instead, with the two functions of a worker that it uses.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(address) {
      super();
      const url = String(address), frame = Object.assign(document.createElement("iframe"), { hidden: true });
      document.body.append(frame);
      this.inside = frame.contentWindow;
      window.addEventListener("message", (event) => {
        if (event.source !== this.inside) return;
        const told = new MessageEvent("message", { data: event.data });
        this.onmessage?.(told);
        this.dispatchEvent(told);
      });
      this.inside.document.open();
      this.inside.document.write(`<!doctype html><script>
        self.postMessage = (data) => parent.postMessage(data, "*");
        self.importScripts = (...addresses) => addresses.reduce((before, one) => before.then(() => new Promise((resolve) => {
          const script = Object.assign(document.createElement("script"), { src: new URL(one, ${JSON.stringify(url)}), onload: resolve });
          document.body.append(script);
        })), Promise.resolve());
      <\/script><body><script src="${url}"><\/script>`);
      this.inside.document.close();
    }

    postMessage(data) { this.inside.dispatchEvent(new MessageEvent("message", { data })); }

    terminate() { this.inside.frameElement.remove(); }
  };
}
