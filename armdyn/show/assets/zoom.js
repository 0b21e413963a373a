/* Zoom in time, the same in all charts.

   armdynZoom(total, seek, changed) stores the visible span; changed(from, to) draws it. `attach` adds listeners to a
   chart: a drag seeks, with Shift it selects a span; two fingers or Ctrl + wheel zoom; a horizontal wheel pans; a
   double click shows all. */
"use strict";
const armdynZoom = (total, seek, changed) => {
  let from = 0, to = total;
  const set = (a, b) => {
    const wide = Math.min(Math.max(b - a, 1e-3 * total), total);
    from = Math.min(Math.max(a, 0), total - wide);
    to = from + wide;
    changed(from, to);
  };
  const scale = (factor, about) => set(about - (about - from) * factor, about + (to - about) * factor);
  const all = () => set(0, total);

  function attach(u) {
    const over = u.over, fingers = new Map();
    let chosen = null, gripped = null;
    const left = event => event.clientX - over.getBoundingClientRect().left;
    const at = event => Math.min(Math.max(u.posToVal(left(event), "x"), from), to);
    const select = (a, b) => u.setSelect({ left: Math.min(a, b), top: 0, width: Math.abs(b - a), height: over.clientHeight }, false);
    const end = event => {
      fingers.delete(event.pointerId);
      gripped = null;
      if (chosen !== null) {
        select(0, 0);
        const [a, b] = [chosen, at(event)].sort((x, y) => x - y);
        if (event.type === "pointerup" && u.valToPos(b, "x") - u.valToPos(a, "x") > 4) set(a, b);  // otherwise a click
        chosen = null;
      }
    };
    over.addEventListener("pointerdown", event => {
      over.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, left(event));
      if (fingers.size === 2) gripped = [...fingers.values()].map(x => u.posToVal(x, "x"));
      else if (event.shiftKey) { event.preventDefault(); chosen = at(event); } else seek(at(event));
    });
    over.addEventListener("pointermove", event => {
      if (!fingers.has(event.pointerId)) return;
      fingers.set(event.pointerId, left(event));
      if (gripped) {  // keep the times under both fingers
        const [a, b] = [...fingers.values()], second = (gripped[1] - gripped[0]) / (b - a);
        if (Math.abs(b - a) > 10 && second > 0) set(gripped[0] - a * second, gripped[0] + (over.clientWidth - a) * second);
      } else if (chosen !== null) select(u.valToPos(chosen, "x"), u.valToPos(at(event), "x"));
      else if (fingers.size === 1) seek(at(event));
    });
    over.addEventListener("pointerup", end);
    over.addEventListener("pointercancel", end);
    over.addEventListener("dblclick", all);
    over.addEventListener("wheel", event => {
      if (event.ctrlKey || event.metaKey) {
        event.preventDefault();
        scale(Math.exp(Math.max(-1, Math.min(1, event.deltaY / 200))), at(event));
      } else if (to - from < total && Math.abs(event.deltaX) > Math.abs(event.deltaY)) {
        event.preventDefault();
        const step = event.deltaX / over.clientWidth * (to - from);
        set(from + step, to + step);
      }
    }, { passive: false });
  }

  return {
    attach, scale, all, set,
    // Move the span to contain the sought time.
    follow(time) {
      if (time < from) set(time, time + to - from);
      else if (time > to) set(time - to + from, time);
    },
    get span() { return [from, to]; },
    get zoomed() { return to - from < total * (1 - 1e-9); },
  };
};
