/* Position, velocity and torque over time, and the active limit of each joint: four uPlot charts with a common cursor.

   armdynCurves(host, motions, names, seek, zooms) draws data of `armdyn.show.page.motions` into an element; seek(time)
   is called on a drag, zooms(from, to) on a zoom. Colours denote joints, line styles denote motions. */
"use strict";
const armdynPalette = dark => (dark
  ? { ink: "#dfe5ea", soft: "#93a0ad", grid: "#2a333c", band: "rgba(255,255,255,.035)", T: "#e5646c", V: "#5aa2e8", Q: "#b08ae0",
      joints: ["#5aa2e8", "#f2a154", "#57c483", "#ef6b73", "#b08ae0", "#3fc4d3", "#c39a77", "#ec8ac0"] }
  : { ink: "#30363d", soft: "#6b7785", grid: "#e3e8ed", band: "rgba(31,41,51,.035)", T: "#cc2936", V: "#2970b8", Q: "#7b52ab",
      joints: ["#2970b8", "#d9731a", "#2b8f50", "#cc2936", "#7b52ab", "#0f96a5", "#8a5a3b", "#c9509a"] });
const armdynNumber = (x, digits) => x.toFixed(digits).replace(/^-(?=[0.]*$)/, "").replace("-", "−");  // no −0.000

const armdynCurves = (host, motions, names, seek, zooms) => {
  const floats = (text, kind) => new kind(Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer);
  const t = Array.from(floats(motions.t, Float64Array)), n = t.length, joints = names.length;
  const kinds = ["q", "v", "tau"];
  for (const move of motions.moves) {
    for (const kind of kinds) {
      const all = floats(move[kind], Float32Array);
      move[kind] = names.map((_, j) => Array.from(all.subarray(j * n, (j + 1) * n), x => (Number.isNaN(x) ? null : x)));
    }
  }
  const make = (tag, parent, text, kind) => {
    const node = parent.appendChild(document.createElement(tag));
    if (text !== undefined) node.textContent = text;
    if (kind) node.className = kind;
    return node;
  };
  const units = { q: ["rad", "m"], v: ["rad/s", "m/s"], tau: ["N m", "N"] };
  const unit = (kind, j) => units[kind][+motions.sliding[j]];
  const unitOf = kind => [...new Set(names.map((_, j) => unit(kind, j)))].join(", ");
  const titles = { q: "Position", v: "Velocity", tau: "Torque" };
  const shown = names.map(() => true), there = motions.moves.map(() => true);
  let palette = armdynPalette(false);
  const color = j => palette.joints[j % palette.joints.length];

  // Relative to limits: makes a wrist readable next to a shoulder.
  const limited = kind => kind !== "q" && motions.limits[kind].every(([a, b]) => a !== null && b !== null)
    && motions.limits[kind].some(([a, b]) => b > a);
  const apart = kind => {
    const sizes = motions.limits[kind].map(([a, b]) => Math.max(-a, b)).filter(x => x > 0);
    return Math.max(...sizes) > 3 * Math.min(...sizes);
  };
  const relative = { q: false, v: limited("v") && apart("v"), tau: limited("tau") && apart("tau") };
  const scaled = (kind, j, x) => {
    if (x === null || !relative[kind]) return x;
    const [a, b] = motions.limits[kind][j];
    return x === 0 ? 0 : 100 * (x > 0 ? x / b : -x / a) || 0;
  };
  const columns = kind => [t, ...motions.moves.flatMap(move => move[kind].map((xs, j) => xs.map(x => scaled(kind, j, x))))];
  const lines = kind => names.flatMap((_, j) => (motions.limits[kind][j] || []).filter(x => x !== null)
    .map(x => ({ j, at: scaled(kind, j, x), left: motions.kept && motions.kept[kind] ? 1 - motions.kept[kind][j] : 1 })));

  const dash = k => (k ? [[6, 3], [2, 3], [9, 3, 2, 3], [4, 4]][(k - 1) % 4] : undefined);
  const charts = {}, axis = 52;
  let time = 0;
  const width = () => Math.max(host.clientWidth, 240), height = () => (innerWidth < 700 ? 168 : Math.min(Math.max(.16 * innerHeight, 130), 190));
  const font = "11px system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif";
  const axes = (last, more) => [
    { stroke: () => palette.soft, grid: { stroke: () => palette.grid, width: 1 }, ticks: { show: false }, font, size: 22,
      label: last ? "time [s]" : undefined, labelSize: 16, labelFont: font, values: (u, at) => at.map(x => +x.toPrecision(6)) },
    { stroke: () => palette.soft, grid: { stroke: () => palette.grid, width: 1 }, ticks: { show: false }, font, size: axis, ...more },
  ];
  const cursor = { y: false, drag: { x: false, y: false }, points: { size: 6, width: 1.5 }, focus: { prox: -1 },
    bind: Object.fromEntries(["mousedown", "mouseup", "mousemove", "mouseenter", "mouseleave", "dblclick", "click"].map(e => [e, () => null])) };

  // Background of the curves: arcs as bands, switching times as lines, limits dashed.
  function behind(u, limits) {
    const { ctx } = u, { left, top, width: w, height: h } = u.bbox, x = time => u.valToPos(time, "x", true);
    ctx.save();
    ctx.beginPath(); ctx.rect(left, top, w, h); ctx.clip();
    const first = motions.moves[0], edges = [0, ...first.switches.map(s => s.t), first.duration];
    ctx.fillStyle = palette.band;
    for (let k = 1; k + 1 < edges.length; k += 2) ctx.fillRect(x(edges[k]), top, x(edges[k + 1]) - x(edges[k]), h);
    const stroke = (style, dash, wide, points) => {
      ctx.strokeStyle = style; ctx.setLineDash(dash.map(d => d * devicePixelRatio)); ctx.lineWidth = wide * devicePixelRatio;
      ctx.beginPath(); ctx.moveTo(...points[0]); ctx.lineTo(...points[1]); ctx.stroke();
    };
    for (const s of first.switches) {
      const own = s.joints.filter(j => shown[j]);
      if (own.length) stroke(color(own[0]) + "88", [1, 3], 1, [[x(s.t), top], [x(s.t), top + h]]);
    }
    for (const move of motions.moves) stroke(palette.soft + "88", [], .7, [[x(move.duration), top], [x(move.duration), top + h]]);
    for (const { j, at, left: part } of limits) {
      if (!shown[j]) continue;
      const y = u.valToPos(at, "y", true);
      stroke((relative[u.kind] || same(limits) ? palette.soft : color(j)) + "cc", [5, 4], 1, [[left, y], [left + w, y]]);
      if (part < 1) stroke(color(j) + "99", [1, 3], 1, [[left, u.valToPos(part * at, "y", true)], [left + w, u.valToPos(part * at, "y", true)]]);
    }
    ctx.restore();
  }
  const same = limits => new Set(limits.map(limit => limit.at)).size <= 2;

  function range(kind) {
    let low = Infinity, high = -Infinity;
    motions.moves.forEach((move, k) => there[k] && move[kind].forEach((xs, j) => shown[j] && xs.forEach(x => {
      if (x !== null) { low = Math.min(low, scaled(kind, j, x)); high = Math.max(high, scaled(kind, j, x)); }
    })));
    if (!(low <= high)) return [-1, 1];
    const near = .35 * (high - low);
    for (const { j, at } of lines(kind)) {
      if (shown[j] && at >= low - near && at <= high + near) { low = Math.min(low, at); high = Math.max(high, at); }
    }
    const pad = .07 * (high - low) || Math.max(1e-3, .1 * Math.abs(high));
    return [low - pad, high + pad];
  }
  const bound = xs => (xs.length === 2 && xs[0] === -xs[1] ? `±${xs[1]}` : xs.join(" and "));
  function note(kind) {
    const [low, high] = charts[kind].y, far = [], none = [];
    names.forEach((name, j) => {
      if (!shown[j]) return;
      const bounds = motions.limits[kind][j];
      const out = bounds.filter(x => x !== null && (scaled(kind, j, x) < low || scaled(kind, j, x) > high));
      if (bounds.every(x => x === null)) none.push(name);
      else if (out.length) far.push(`${name} ${bound(out.map(x => +x.toPrecision(3)))}`.replaceAll("-", "−"));
    });
    const few = (list, what) => (list.length === 0 ? "" : list.length > 3 ? `${what} ${list.length} joints` : `${what} ${list.join(", ")}`);
    const said = [few(far, "limits beyond the plot:"), few(none, "no limit:")].filter(Boolean).join(" · ");
    charts[kind].note.textContent = said;
    charts[kind].note.title = [...far, ...none.map(name => `${name}: no limit`)].join(", ");
  }

  // Zoom to a part of the time, common to all plots.
  const zoom = armdynZoom(t[n - 1], seek, (from, to) => {
    all().forEach(u => u.setScale("x", { min: from, max: to }));
    queueMicrotask(() => all().forEach(mark));  // uPlot's scales change in a microtask, too
    whole.disabled = !zoom.zoomed;
    less.disabled = !zoom.zoomed;
    zooms(from, to);
  });
  const bar = make("div", host, undefined, "zoom");
  make("span", bar, matchMedia("(pointer: coarse), (max-width: 640px)").matches ? "two fingers: zoom in time" : "Shift + drag or Ctrl + wheel: zoom in time").title = "a double click, or “all”, shows all of the time";
  const button = (text, title, act) => {
    const node = make("button", bar, text);
    Object.assign(node, { title, onclick: act });
    node.setAttribute("aria-label", title);
    return node;
  };
  const less = button("−", "see more of the time", () => zoom.scale(2, time));
  button("+", "zoom in at this time", () => zoom.scale(.5, time));
  const whole = button("all", "see all of the time", () => zoom.all());
  less.disabled = whole.disabled = true;

  function chart(kind) {
    const figure = make("figure", host, undefined, "plot"), caption = make("figcaption", figure);
    make("b", caption, titles[kind]);
    const label = make("span", caption, unitOf(kind), "unit");
    if (limited(kind)) {
      const button = make("button", caption, "", "switch");
      const words = () => {
        label.textContent = relative[kind] ? "% of each joint's limit" : unitOf(kind);
        button.textContent = relative[kind] ? `show ${unitOf(kind)}` : "show % of limits";
      };
      words();
      button.onclick = () => { relative[kind] = !relative[kind]; words(); refresh(kind); };
    }
    const box = make("div", figure), y = [0, 1];
    const u = new uPlot({
      width: width(), height: height(), padding: [6, 10, 0, 0], legend: { show: false }, cursor,
      scales: { x: { time: false, range: () => zoom.span }, y: { range: () => y } },
      axes: axes(false, { values: (_, at) => at.map(x => `${+x.toPrecision(4)}`.replace("-", "−")) }),
      series: [{}, ...motions.moves.flatMap((_, k) => names.map((_, j) => ({
        stroke: () => color(j), width: k ? 1.3 : 1.8, dash: dash(k),
        points: { show: false }, spanGaps: false,
      })))],
      hooks: { drawAxes: [self => behind(self, lines(kind))] },
    }, [t], box);
    u.kind = kind;
    charts[kind] = { u, y, note: make("p", figure, "", "note") };
    zoom.attach(u);
    refresh(kind);
  }
  function refresh(kind) {
    const { u, y } = charts[kind];
    [y[0], y[1]] = range(kind);
    motions.moves.forEach((_, k) => names.forEach((_, j) => { u.series[1 + k * joints + j].show = shown[j] && there[k]; }));
    u.setData(columns(kind));
    note(kind);
    mark(u);
  }

  // Active limit of each joint: above the middle the upper one, below it the lower one.
  function lanes() {
    const figure = make("figure", host, undefined, "plot"), caption = make("figcaption", figure);
    make("b", caption, "Active limits");
    for (const [kind, word] of [["T", "torque"], ["V", "speed"], ["Q", "position"]]) {
      const key = make("span", caption, undefined, "unit");
      make("i", key, "", `key ${kind}`);
      key.append(word);
    }
    const box = make("div", figure), rows = motions.moves.length * joints, row = rows > 12 ? 14 : rows > 8 ? 17 : 22;
    const u = new uPlot({
      width: width(), height: rows * row + 46, padding: [6, 10, 0, 0], legend: { show: false }, cursor: { ...cursor, points: { show: false } },
      scales: { x: { time: false, range: () => zoom.span }, y: { range: () => [0, rows] } },
      axes: axes(true, { splits: () => [], grid: { show: false } }),
      series: [{}, { stroke: "transparent", points: { show: false } }],
      hooks: { drawAxes: [self => { behind(self, []); strips(self, rows); }] },
    }, [t, t.map(() => 0)], box);
    const { resolved: known, exact } = motions.moves[0];
    make("p", figure, (known ? `Upper half: the upper limit; lower half: the lower. ${exact ? "Solved arcs." : "Arcs read off the mesh."}`
      : "Upper half: the upper limit; lower half: the lower. Detected from the motion's samples, within 0.5 % of a limit.")
      + (motions.moves.length > 1 ? ` From above: ${motions.moves.map(move => move.name).join(", ")}.` : ""), "note");
    charts.lanes = { u, height: rows * row + 46 };
    zoom.attach(u);
  }
  function strips(u, rows) {
    const { ctx } = u, high = u.bbox.height / rows, dpr = devicePixelRatio;
    ctx.save();
    motions.moves.forEach((move, k) => move.lanes.forEach((lane, j) => {
      const top = u.bbox.top + (k * joints + j) * high, middle = top + high / 2;
      ctx.fillStyle = color(j);
      ctx.globalAlpha = shown[j] && there[k] ? 1 : .25;
      ctx.fillRect(u.bbox.left - 12 * dpr, middle - 4 * dpr, 8 * dpr, 8 * dpr);
      ctx.font = `${11 * dpr}px system-ui, sans-serif`;
      ctx.textAlign = "right"; ctx.textBaseline = "middle";
      ctx.fillStyle = palette.soft;
      ctx.fillText(`${j + 1}`, u.bbox.left - 17 * dpr, middle);
      for (const [from, to, on] of lane) {
        const seen = time => Math.min(Math.max(u.valToPos(time, "x", true), u.bbox.left), u.bbox.left + u.bbox.width);
        const a = seen(from), b = seen(to), half = high / 2 - 2 * dpr;
        if (!(b > a)) continue;
        ctx.fillStyle = palette[on[0]] || palette.soft;
        if (on[1] === "+") ctx.fillRect(a, middle - half, Math.max(b - a, dpr), half);
        else if (on[1] === "-") ctx.fillRect(a, middle, Math.max(b - a, dpr), half);
        ctx.fillStyle = palette.soft + "77";
        ctx.fillRect(a, middle - dpr / 2, b - a, dpr);
      }
    }));
    ctx.restore();
  }

  const mark = u => u.setCursor({ left: u.valToPos(time, "x"), top: 0 }, false);
  kinds.forEach(chart);
  lanes();
  const all = () => Object.values(charts).map(one => one.u);
  new ResizeObserver(() => {
    for (const [kind, { u, height: own }] of Object.entries(charts)) if (Math.abs(u.width - width()) > 1 || (!own && u.height !== height())) {
      u.setSize({ width: width(), height: own || height() });
      requestAnimationFrame(() => mark(u));  // uPlot moves its cursor, too, once the size has changed
    }
  }).observe(host);
  const index = at => {  // the last sample at or before a time
    let a = 0, b = n - 1;
    while (a < b) { const c = (a + b + 1) >> 1; if (t[c] <= at) a = c; else b = c - 1; }
    return a;
  };
  return {
    color, dash, duration: t[n - 1], unit,
    at(now) { time = now; zoom.follow(now); all().forEach(mark); },
    look(from, to) { zoom.set(from, to); },
    get span() { return zoom.span; },
    // Values of a motion at a time; constant after its end.
    values(kind, j, now, k = 0) {
      const xs = motions.moves[k][kind][j], last = motions.moves[k].duration, i = index(Math.min(now, last));
      const a = xs[i], b = i + 1 < n ? xs[i + 1] : null;
      return b === null || t[i + 1] === t[i] ? a : a + (b - a) * (Math.min(now, last) - t[i]) / (t[i + 1] - t[i]);
    },
    on(j, now, k = 0) { return (motions.moves[k].lanes[j].find(([a, b]) => a <= now && now < b) || ["", "", ""])[2]; },
    joint(j, yes) { shown[j] = yes; kinds.forEach(refresh); charts.lanes.u.redraw(); },
    move(k, yes) { there[k] = yes; kinds.forEach(refresh); charts.lanes.u.redraw(); },
    theme(dark) { palette = armdynPalette(dark); all().forEach(u => u.redraw(false)); },
    // Cursors and visible span [s], read from the charts, for tests.
    get seen() { return all().map(u => [u.scales.x.min, u.scales.x.max]); },
    get cursors() { return all().map(u => u.posToVal(u.cursor.left, "x")); },
  };
};
