/* Common time of all animated parts of a page: playback, slider, speed and keys.

   armdynPlayer(duration, speed, shown, span) controls #toggle, #scrubber and #speed; shown(time) draws the page at time
   [s]; span() is the repeated part [s], by default all. */
"use strict";
const armdynPlayer = (duration, speed, shown, span = () => [0, duration]) => {
  const el = id => document.getElementById(id);
  let time = 0, playing = true, last = null, rest = 0;
  const show = () => {
    shown(time);
    el("scrubber").value = time / duration;
    document.querySelector("#toggle path").setAttribute("d", playing ? "M2 1h3.5v12H2zM8.5 1H12v12H8.5z" : "M3 1l10 6-10 6z");
  };
  const seek = to => { time = Math.min(Math.max(+to, 0), duration); rest = 0; show(); };
  const hold = to => { playing = false; seek(to); };
  const pause = () => { playing = false; show(); };
  const play = () => { if (time >= span()[1]) time = span()[0]; playing = true; last = null; rest = 0; show(); };
  const toggle = () => (playing ? pause() : play());
  function tick(now) {
    requestAnimationFrame(tick);
    const passed = last === null ? 0 : (now - last) / 1000, [from, to] = span();
    last = now;
    if (!playing) return;
    if (time < to) time = Math.min(time + speed * passed, to);
    else if ((rest += passed) > 1.2) { time = from; rest = 0; }  // dwell at the end, then repeat
    show();
  }
  for (const s of [...new Set([.001, .002, .005, .01, .02, .05, .1, .2, .5, 1, 2, speed])].sort((a, b) => a - b)) {
    const option = el("speed").appendChild(document.createElement("option"));
    option.textContent = `×${+s.toPrecision(3)}${el("speed").dataset.after ?? ""}`;
    option.value = s;
    option.selected = s === speed;
  }
  el("speed").title = "seconds of motion per second";
  el("speed").onchange = event => { speed = +event.target.value; };
  el("toggle").onclick = toggle;
  el("scrubber").oninput = event => hold(event.target.value * duration);
  addEventListener("keydown", event => {
    if (event.target.matches("select, input, button, summary, pre")) return;
    if (event.code === "Space") { event.preventDefault(); toggle(); }
    if (event.code === "ArrowRight" || event.code === "ArrowLeft") {
      hold(time + (event.code === "ArrowRight" ? 1 : -1) * (span()[1] - span()[0]) / 100);
    }
  });
  return {
    play, pause, seek, hold, show, duration,
    start() { show(); requestAnimationFrame(tick); },
    get time() { return time; },
    get playing() { return playing; },
  };
};
