// Says so when the page shows the past: its relay is gone or frozen, the page is behind, or somebody looks back in time.
// A red stripe and the page's title say when something is wrong at the sites now, which a page that is busy draws late.
// A relay that was started again makes the page load again, and so does a page that is far behind or has grown too large:
// it comes back with the present, and without all that it had not got round to, which no limit of memory counts.
(() => {
  const LOOK_EVERY_MS = 2000;
  const SILENT_AFTER_LOOKS = 3; // counted in looks, not in time: a page that draws in software is itself held up for seconds
  const GIVE_UP_AFTER_LOOKS = 10;
  const OLD_AFTER_S = 15; // a mapper draws every 10 s, where nobody watches the site
  const COMES_WITHIN_S = 40; // to load the page takes 25 s without a graphics card
  const LOADS_AGAIN_AFTER_S = 300;
  const MOST_HEAP_BYTES = 3e9; // browsers end a page at 4 GB; beyond 2.5 GB Rerun counts all it holds, and drops the oldest
  const NS_PER_S = 1e9;
  const LEAST_TIME_NS = 1e17; // times below it are counts of a time line that has no hours
  const PAST = "#b3261e";
  const LOOKING_BACK = "#2f5d8a";
  const bar = document.createElement("div");
  bar.id = "noctule-stale";
  bar.hidden = true;
  bar.style.cssText =
    "position:fixed;top:0;left:0;right:0;z-index:9999;padding:10px;text-align:center;font:600 16px sans-serif;color:#fff";
  const stripe = document.createElement("div");
  stripe.id = "noctule-alarm";
  stripe.hidden = true;
  stripe.style.cssText = `position:fixed;top:0;left:0;right:0;z-index:9998;height:6px;background:${PAST}`;
  document.body.append(bar, stripe);
  let run = null;
  let answered_ms = Date.now();
  let relay_is_silent = false;
  let unanswered = 0; // looks in a row
  let asking = null;
  const opened_ms = Date.now();
  let ahead_ms = 0; // the server's clock against this one
  let shown_s = null; // UTC: what is shown was drawn then
  let has_hours = true;
  let looks_back = false;
  let alarms = [];
  let drawn_s = null; // UTC: when the viewer's own process has last drawn, where it draws

  // What Rerun's viewer says of itself, as JSON.
  window.noctuleEvent = (json) => {
    const event = JSON.parse(json);
    if (event.type !== "time_update" && event.type !== "timeline_change") return;
    has_hours = event.time > LEAST_TIME_NS;
    shown_s = event.time / NS_PER_S;
  };

  // Rerun tells nobody that its time was stopped: whoever has touched an old page may have done it.
  for (const touch of ["pointerdown", "keydown"]) window.addEventListener(touch, () => (looks_back = true), true);

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
      alarms = state.troubles;
      drawn_s = state.drawn_s;
      ahead_ms = 1000 * state.now_s - Date.now();
      unanswered = 0;
      if (is_far_behind() || is_too_large()) location.reload();
    } catch {
      unanswered += 1;
    } finally {
      asking = null;
    }
    show();
  }

  // The words of the bar and its colour; no words where nothing is wrong.
  function age() {
    const now_ms = Date.now();
    if (relay_is_silent || unanswered >= SILENT_AFTER_LOOKS)
      return [`The relay has not answered for ${duration((now_ms - answered_ms) / 1000)}: this page shows the past.`, PAST];
    if (document.hidden) return ["", PAST]; // a browser draws no tab that nobody sees
    if (shown_s === null) {
      const waited_s = (now_ms - opened_ms) / 1000;
      if (waited_s < COMES_WITHIN_S) return ["", PAST];
      const why = is_drawn() ? "this computer can't keep up" : "nothing is drawn on it";
      return [`Nothing has come from the relay for ${duration(waited_s)}: ${why}, or its port can't be reached from here.`, PAST];
    }
    if (!has_hours) return ["", PAST];
    const old_s = now_s() - shown_s;
    if (old_s < OLD_AFTER_S) {
      looks_back = false;
      return ["", PAST];
    }
    if (looks_back)
      return [
        `You look back ${duration(old_s)}, or the page is late: the second button at the lower left follows the present.`,
        LOOKING_BACK,
      ];
    const why = is_drawn() ? "this computer can't keep up" : "nothing is drawn any more, or this computer can't keep up";
    return [`What you see is ${duration(old_s)} old: ${why}.`, PAST];
  }

  function now_s() {
    return (Date.now() + ahead_ms) / 1000;
  }

  function is_drawn() {
    return drawn_s !== null && now_s() - drawn_s < OLD_AFTER_S;
  }

  function is_far_behind() {
    if (!has_hours || looks_back || !is_drawn()) return false;
    const behind_s = shown_s === null ? Infinity : now_s() - shown_s;
    return Math.min((Date.now() - opened_ms) / 1000, behind_s) > LOADS_AGAIN_AFTER_S;
  }

  // Even while somebody looks back: the browser would soon end the page. Not in its first minutes: a page that is too
  // large as soon as it opens would load again for ever.
  function is_too_large() {
    const open_s = (Date.now() - opened_ms) / 1000;
    return open_s > LOADS_AGAIN_AFTER_S && window.noctuleHeap?.buffer.byteLength > MOST_HEAP_BYTES;
  }

  function duration(s) {
    if (s < 120) return `${Math.round(s)} s`;
    return s < 7200 ? `${Math.round(s / 60)} min` : `${Math.round(s / 3600)} h`;
  }

  function show() {
    const [words, colour] = age();
    bar.hidden = words === "";
    bar.textContent = bar.hidden || !alarms.length ? words : `${words} Now: ${alarms.join("; ")}`;
    stripe.hidden = !alarms.length;
    document.title = alarms.length ? `\u26a0 ${alarms.join("; ")}` : bar.hidden ? "Noctule" : `\u26a0 ${words}`;
    bar.style.background = colour;
    const canvas = document.querySelector("canvas");
    if (!canvas) return;
    const height = bar.hidden ? 0 : bar.offsetHeight; // the page goes on below the bar: alarms are at its top
    canvas.style.top = `${height}px`;
    canvas.style.height = `calc(100% - ${height}px)`;
  }

  setInterval(look, LOOK_EVERY_MS);
})();
