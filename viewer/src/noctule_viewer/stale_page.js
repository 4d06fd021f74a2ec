// Says so when the page shows the past: its relay is gone or frozen. A relay that was started again makes the page load again.
(() => {
  const bar = document.createElement("div");
  bar.id = "noctule-stale";
  bar.hidden = true;
  bar.style.cssText =
    "position:fixed;top:0;left:0;right:0;z-index:9999;padding:10px;text-align:center;" +
    "font:600 16px sans-serif;color:#fff;background:#b3261e";
  document.body.append(bar);
  let run = null;
  let answered_ms = Date.now();

  async function look() {
    try {
      const reply = await fetch("noctule/alive", { cache: "no-store", signal: AbortSignal.timeout(3000) });
      const state = await reply.json();
      if (run !== null && state.run !== run) {
        location.reload();
        return;
      }
      run = state.run;
      answered_ms = Date.now() - 1000 * state.silent_s;
    } catch {
      // No answer: the time since the last one says it all.
    }
    const silent_s = Math.round((Date.now() - answered_ms) / 1000);
    bar.textContent = `The relay has not answered for ${silent_s} s: this page shows the past.`;
    bar.hidden = silent_s < 6;
  }

  setInterval(look, 2000);
})();
