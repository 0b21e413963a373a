/* Report page: a common time for the arm, the curves, the slider and the values; "arm alone" fills the window. */
"use strict";
(async () => {
  const el = id => document.getElementById(id);
  const make = (tag, parent, text, kind) => {
    const node = parent.appendChild(document.createElement(tag));
    if (text !== undefined) node.textContent = text;  // names are untrusted: text, never markup
    if (kind) node.className = kind;
    return node;
  };
  const data = JSON.parse(el("armdyn-data").textContent), { motions, labels } = data;
  const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0));
  const unpacked = text => new Response(new Blob([bytes(text)]).stream().pipeThrough(new DecompressionStream("gzip"))).json();
  const number = armdynNumber, seconds = time => number(time, duration < 100 ? 4 : 2);  // as elsewhere in the page
  const dark = matchMedia("screen and (prefers-color-scheme: dark)");

  let scene = null;
  const curves = armdynCurves(el("plots"), motions, labels, to => player.hold(to), zoomed);
  const duration = curves.duration, player = armdynPlayer(duration, data.speed, show, () => curves.span);

  // The arm.
  const called = k => `${motions.moves[k].name}, ${data.cut[k] ? "first " : ""}${seconds(motions.moves[k].duration)} s`;
  const line = (key, k) => {  // same style as its curves
    const [svg, path] = ["svg", "path"].map(tag => document.createElementNS("http:" + "//www.w3.org/2000/svg", tag));
    svg.setAttribute("viewBox", "0 0 26 4");
    path.setAttribute("d", "M0 2h26");
    path.setAttribute("stroke-dasharray", (curves.dash(k) || []).join(" "));
    key.appendChild(svg).appendChild(path);
  };
  const missing = words => { el("no-scene").textContent = words; el("pane").classList.add("empty"); };
  if (data.scene) {
    try {
      const drawn = await unpacked(data.scene);
      const room = () => {  // several names are above the arm
        const above = drawn.arms.length > 1 ? Math.min(el("motions").offsetHeight / el("pane").clientHeight, .5) : 0;
        return { high: .84 * (1 - above), wide: .9, up: -above, right: 0 };
      };
      scene = armdynScene(el("pane"), drawn, { overlay: !data.alone, room });
      el("grid").textContent = `grid ${+scene.spacing.toPrecision(1)} m`;
      drawn.arms.forEach((arm, k) => {
        const key = make(k ? "button" : "span", el("motions"), undefined, "move");
        make("i", key).style.background = `rgb(${arm.color.map(c => Math.round(255 * c)).join(",")})`;
        if (drawn.arms.length > 1) line(key, k);
        make("span", key, called(k));
        if (!k) return;
        key.title = "show or hide";
        key.onclick = () => {
          const off = key.classList.toggle("off");
          scene.visible(k, !off);
          curves.move(k, !off);
        };
      });
      scene.fit();
    } catch (error) {
      missing(`The arm cannot be shown here: ${error}`);
    }
  } else {
    missing("The robot was not available when this report was written: only its curves are drawn.");
    motions.moves.forEach((_, k) => {
      const key = make("span", el("motions"), undefined, "move");
      if (motions.moves.length > 1) line(key, k);
      make("span", key, called(k));
    });
  }
  el("fit").onclick = () => scene && scene.fit();
  const body = document.body.classList;
  const view = alone => {
    body.toggle("alone", alone);
    el("view").textContent = alone ? "show curves" : "arm alone";
    if (scene) scene.fit();
  };
  view(data.alone);
  el("view").onclick = () => view(!body.contains("alone"));
  // Buttons in the pane: the arm's controls would capture the pointer and the click.
  document.querySelectorAll(".tools, .keys").forEach(node => node.addEventListener("pointerdown", event => event.stopPropagation()));
  // A wheel over the arm scrolls the page, as elsewhere; with Ctrl, or by two fingers, it zooms.
  el("pane").addEventListener("wheel", event => { if (!event.ctrlKey && !body.contains("alone")) event.stopPropagation(); }, { capture: true });

  // Present values of the first motion; with the arm alone, of all motions.
  const head = make("div", el("now"), undefined, "row head");
  ["joint", "position", "velocity", "torque", "of its limit", "on"].forEach(word => make("span", head, word));
  const blocks = motions.moves.map((move, k) => {
    const block = make("div", el("now"), undefined, k ? "block further" : "block"), run = make("div", block, undefined, "run");
    const [level, headline] = data.verdicts[k];
    make("span", run, move.name);
    const time = make("b", run);
    if (headline) make("small", run, headline, level);
    return { block, time };
  });
  const rows = motions.moves.flatMap((_, k) => labels.map((label, j) => {
    const row = make("div", blocks[k].block, undefined, "row"), name = make("label", row, undefined, "name");
    const box = make("input", name);
    Object.assign(box, { type: "checkbox", checked: true, title: "show its curves" });
    box.onchange = () => curves.joint(j, box.checked);
    make("i", name, `${j + 1}`);
    const text = make("span", name, label);
    text.title = data.joints[j];
    const cells = ["q", "v", "tau"].map(() => make("span", row, "", "value"));
    const bar = make("span", row, undefined, "bar"), fill = make("s", bar), on = make("span", row, "", "on");
    return { k, j, name, cells, bar, fill, on };
  }));
  const said = { "T+": "torque, upper", "T-": "torque, lower", "V+": "speed, upper", "V-": "speed, lower", "Q+": "position, upper",
    "Q-": "position, lower", P: "no motor", "": "–" };
  const full = labels.map((_, j) => {
    const [a, b] = motions.limits.tau[j];
    return a !== null && b !== null ? [a, b] : null;
  });
  rows.forEach(({ bar, j }) => {
    const limit = full[j];
    bar.classList.toggle("unlimited", limit === null);
    bar.title = limit === null ? "no torque limit" : `full at ${limit[1]}, or at ${limit[0]} ${curves.unit("tau", j)}`;
  });

  // The player.
  const ticks = el("ticks");
  const place = (node, at) => { node.style.left = `calc(9px + (100% - 18px) * ${at / duration})`; };  // half a thumb at both ends
  motions.moves[0].switches.forEach(({ t, joints }) => {
    const tick = make("i", ticks);
    place(tick, t);
    tick.dataset.joint = joints[0];
    tick.title = `${number(t, 6)} s: ${joints.map(j => labels[j]).join(", ")}`;
  });
  if (motions.moves.length > 1) motions.moves.forEach(move => place(make("u", ticks), move.duration));
  // Steps of a cycle: bands under the slider, as wide as their times, and rows of the table; a click on either seeks.
  const lines = [...document.querySelectorAll("#steps tbody th")].map(cell => ({ row: cell.parentElement, begin: +cell.dataset.begin }));
  const named = el("step");
  const bands = data.steps.map(step => {
    const band = make("button", el("bands"), step.name, `${step.carries > 0 ? "loaded" : ""} ${step.rest ? "rest" : ""}`);
    band.style.flexGrow = step.end - step.begin;
    band.title = `${step.name}: ${seconds(step.end - step.begin)} s`;
    band.onclick = () => player.hold(step.begin);
    return band;
  });
  el("lane").hidden = !bands.length;
  el("player").classList.toggle("cycle", bands.length > 0);
  const last = (all, time) => all.reduce((found, one, k) => (one.begin <= time + 1e-6 ? k : found), 0);
  lines.forEach(({ row, begin }) => { row.onclick = () => player.hold(begin); });
  function steps(time) {
    if (!bands.length) return;
    const now = last(data.steps, time), step = data.steps[now], line = last(lines, time);
    bands.forEach((band, k) => band.classList.toggle("current", k === now));
    lines.forEach(({ row }, k) => row.classList.toggle("current", k === line));
    named.textContent = step.name;
    make("small", named, `${seconds(step.end - step.begin)} s${step.rest ? " at rest" : ""}${step.carries > 0 ? `, carrying ${number(step.carries, 3)} kg` : ""}`);
  }
  const most = kind => Math.max(1e-3, ...motions.moves[0][kind].map(xs => xs.reduce((so, x) => Math.max(so, Math.abs(x ?? 0)), 0)));
  const precise = kind => Math.max(0, Math.min(3, 4 - Math.floor(Math.log10(most(kind)))));
  const places = { q: 3, v: precise("v"), tau: precise("tau") };

  function show(time) {
    if (scene) scene.show(time);
    curves.at(time);
    steps(time);
    rows.forEach(({ k, j, cells, fill, on }) => {
      ["q", "v", "tau"].forEach((kind, i) => {
        const value = curves.values(kind, j, time, k);  // null: the torques are unknown
        cells[i].textContent = value === null ? "–" : `${number(value, places[kind])} ${curves.unit(kind, j)}`;
      });
      const torque = curves.values("tau", j, time, k);
      const part = full[j] ? (torque < 0 ? -torque / full[j][0] : torque / full[j][1]) || 0 : 0;
      fill.style.transform = `scaleX(${Math.max(-1, Math.min(1, part))})`;
      on.textContent = said[curves.on(j, Math.min(time, motions.moves[k].duration * (1 - 1e-9)), k)];
    });
    motions.moves.forEach((move, k) => { blocks[k].time.textContent = `${seconds(move.duration)} s${time >= move.duration ? " ✓" : ""}`; });
    el("scrubber").setAttribute("aria-valuetext", `${seconds(time)} s`);
    el("clock").textContent = `${seconds(time)} / ${seconds(duration)} s`;
  }
  function zoomed(from, to) {  // mark the visible span on the slider
    const part = el("part");
    place(part, from);
    part.style.width = `calc((100% - 18px) * ${(to - from) / duration})`;
    part.hidden = from <= 0 && to >= duration;
  }
  function theme() {
    curves.theme(dark.matches);
    if (scene) scene.theme(dark.matches);
    rows.forEach(({ name, fill, j }) => {
      name.style.setProperty("--joint", curves.color(j));
      fill.style.background = curves.color(j);
    });
    ticks.querySelectorAll("i").forEach(node => { node.style.background = curves.color(+node.dataset.joint); });
  }
  dark.addEventListener("change", theme);
  theme();
  if (data.seen) curves.look(0, data.seen);
  player.start();

  // For scripts: positions from the drawn scene and cursors from the charts, not from the data.
  window.armdyn = {
    play: player.play, pause: player.pause, seek: player.seek, duration,
    get time() { return player.time; },
    get playing() { return player.playing; },
    get cursors() { return curves.cursors; },
    get seen() { return curves.seen; },
    linkPosition: (name, k = 0) => scene && scene.linkPosition(name, k),
    get parts() { return scene && scene.parts(); },
    get camera() { return scene && scene.camera(); },
  };
})();
