// Runs in the console before its own scripts: notes what it receives, draws, and how long its frames take.

(() => {
  if (window !== top) return;
  const noted = { frames: [], draws: [], delays: [], comes: [], presses: [] };
  window.noted = noted;
  const painted = (then) => requestAnimationFrame(() => setTimeout(then));
  const now = () => (performance.timeOrigin + performance.now()) / 1e3;

  new PerformanceObserver((list) => {
    for (const { startTime, duration } of list.getEntries()) noted.frames.push([startTime, duration]);
  }).observe({ type: "long-animation-frame" });

  // The page's telemetry sends this event to itself.
  const { dispatchEvent } = EventTarget.prototype;
  EventTarget.prototype.dispatchEvent = function (event) {
    if (event.type === "frame" && this.series) {
      window.source = this;
      noted.comes.push([now(), now() - this.origin - event.detail.time, event.detail.slowness]);
    }
    return dispatchEvent.call(this, event);
  };

  // From a tick to the frame that shows it: every tick counts, by the newest one in each drawing.
  let drawn,
    begun = Infinity;
  window.begin = () => {
    const [at, late] = noted.comes.at(-1);
    begun = at - late; // by the vehicle's clock
  };
  const { clearRect } = CanvasRenderingContext2D.prototype;
  CanvasRenderingContext2D.prototype.clearRect = function (...words) {
    const series = window.source?.series[0];
    if (series?.last !== undefined && this.canvas.closest("#chart-0")) {
      const { origin } = window.source,
        { times } = series,
        ticks = [];
      for (let k = series.end - 1; k >= series.start && times[k] > (drawn ?? series.last); k--)
        ticks.push(origin + times[k]);
      drawn = series.last;
      noted.draws.push([now(), origin + drawn]);
      painted(() => {
        const at = now();
        const news = ticks.filter((tick) => tick >= begun); // not what filled the chart at first
        noted.delays.push(...news.map((tick) => at - tick));
      });
    }
    return clearRect.apply(this, words);
  };

  // From a press of the emergency button until the page shows the vehicle's answer.
  let pressed;
  addEventListener("click", ({ target }) => (pressed = target.id === "emergency-land" ? now() : pressed), true);
  new MutationObserver(() => {
    const state = document.getElementById("emergency-state");
    if (pressed === undefined || !state?.matches(".done, .failed")) return;
    const since = pressed;
    pressed = undefined;
    painted(() => noted.presses.push(now() - since));
  }).observe(document, { subtree: true, attributes: true, attributeFilter: ["class"] });
})();
