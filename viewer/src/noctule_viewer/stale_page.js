// Says so when the page shows the past: its relay is gone or frozen. A relay that was started again makes the page load again.
(() => {
  const LOOK_EVERY_MS = 2000;
  const SILENT_AFTER_LOOKS = 3; // counted in looks, not in time: a page that draws in software is itself held up for seconds
  const GIVE_UP_AFTER_LOOKS = 10;
  const bar = document.createElement("div");
  bar.id = "noctule-stale";
  bar.hidden = true;
  bar.style.cssText =
    "position:fixed;top:0;left:0;right:0;z-index:9999;padding:10px;text-align:center;" +
    "font:600 16px sans-serif;color:#fff;background:#b3261e";
  document.body.append(bar);
  let run = null;
  let answered_ms = Date.now();
  let relay_is_silent = false;
  let unanswered = 0; // looks in a row
  let asking = null;

  async function look() {
    if (asking) {
      unanswered += 1;
      if (unanswered % GIVE_UP_AFTER_LOOKS === 0) asking.abort();
      show();
      return;
    }
    asking = new AbortController();
    try {
      const reply = await fetch("noctule/alive", { cache: "no-store", signal: asking.signal });
      const state = await reply.json();
      if (run !== null && state.run !== run) {
        location.reload();
        return;
      }
      run = state.run;
      relay_is_silent = state.silent_s > 0;
      answered_ms = Date.now() - 1000 * state.silent_s;
      unanswered = 0;
    } catch {
      unanswered += 1;
    } finally {
      asking = null;
    }
    show();
  }

  function show() {
    const silent_s = Math.round((Date.now() - answered_ms) / 1000);
    bar.textContent = `The relay has not answered for ${silent_s} s: this page shows the past.`;
    bar.hidden = !relay_is_silent && unanswered < SILENT_AFTER_LOOKS;
  }

  setInterval(look, LOOK_EVERY_MS);
})();
