/* The arm in MeshCat's viewer.

   scene(pane, data, options) draws the data of `armdyn.show.page.scene` into an element.
   options.overlay: arms in one place, all but the first translucent; else one behind the other, or side by side.
   options.room(): part of the pane's width and height for the arm, and its offset to the right. */
"use strict";
// Polyline with the point index as parameter, as in time, not its length; coincident points use the next direction.
const armdynPolyline = () => class extends MeshCat.THREE.Curve {
  constructor(xyz) { super(); this.xyz = xyz; this.count = xyz.length / 3; }
  vertex(i) { return new MeshCat.THREE.Vector3().fromArray(this.xyz, 3 * Math.min(Math.max(i, 0), this.count - 1)); }
  getPointAt(u) { return this.vertex(Math.round(u * (this.count - 1))); }
  getTangentAt(u) {
    const i = Math.round(u * (this.count - 1));
    for (let wide = 1; wide < this.count; wide *= 2) {
      const across = this.vertex(i + wide).sub(this.vertex(i - wide));
      if (across.length() > 1e-5) return across.normalize();
    }
    return new MeshCat.THREE.Vector3(1, 0, 0);
  }
};
const armdynScene = (pane, data, options) => {
  const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0));
  const joints = data.joints, Polyline = armdynPolyline();
  const viewer = new MeshCat.Viewer(pane);
  const resize = viewer.set_3d_pane_size;
  viewer.set_3d_pane_size = () => resize.call(viewer, Math.max(pane.clientWidth, 1), Math.max(pane.clientHeight, 1));
  viewer.gui.domElement.remove();  // MeshCat's own controls
  const object = path => viewer.scene_tree.find(path).object;
  const run = commands => commands.forEach(command => viewer.handle_command_bytearray(bytes(command)));
  const root = k => ["armdyn", `arm${k}`];
  run(data.commands);
  data.arms.slice(1).forEach((_, k) => object(root(0)).children.forEach(group => group.children.forEach(shape => {
    if (options.overlay && shape.name.startsWith("obstacle")) return;  // already drawn
    const mesh = shape.children[0], clone = mesh.clone(), path = [...root(k + 1), group.name, shape.name];
    clone.material = mesh.material.clone();
    viewer.set_object(path, clone);
    viewer.set_transform(path, shape.matrix.compose(shape.position, shape.quaternion, shape.scale).toArray());
  })));
  data.arms.forEach((arm, k) => {
    arm.poses = new Float32Array(bytes(arm.poses).buffer);
    const line = new Polyline(new Float32Array(bytes(arm.trail).buffer));
    for (const [name, thick, opacity] of [["path", .5, .5], ["trail", 1, 1]]) {
      const geometry = new MeshCat.THREE.TubeGeometry(line, line.count - 1, thick * (data.planar ? .004 : .003) * data.reach, 8);
      const material = new MeshCat.THREE.MeshPhongMaterial({ color: new MeshCat.THREE.Color(...arm.color), opacity, transparent: opacity < 1, shininess: 45, specular: 0x303030 });
      viewer.set_object([...root(k), name], new MeshCat.THREE.Mesh(geometry, material));
      if (name === "trail") arm.trail = geometry;
    }
    arm.groups = Array.from({ length: joints }, (_, j) => object([...root(k), `joint${j + 1}`]));
    const ghost = options.overlay && k > 0;
    if (ghost || (data.arms.length > 1 && !options.overlay)) object(root(k)).traverse(node => {
      if (!node.isMesh || !node.parent.name.startsWith("shape")) return;
      const hsl = node.material.color.getHSL({ h: 0, s: 0, l: 0 });
      const dark = hsl.l < .3 && hsl.s < .3;  // joints and bases stay dark
      const own = new MeshCat.THREE.Color(...arm.color).getHSL({ h: 0, s: 0, l: 0 });
      if (ghost || !dark) node.material.color.setHSL(own.h, own.s, .6 * own.l + .4 * hsl.l);
      if (ghost) Object.assign(node.material, { transparent: true, opacity: .3, depthWrite: false });
    });
  });
  // Parts that the first arm grasps and releases: each is drawn in one place at a time.
  const parts = (data.parts ?? []).map(part => {
    run(part.commands);
    const nodes = part.shapes.map(path => object([...root(0), ...path]));
    return { nodes, show: time => nodes.forEach(node => { node.visible = time >= part.begin && (part.end === null || time < part.end); }) };
  });
  viewer.set_property(["Axes"], "visible", false);

  // Places of the arms, the grid, and a camera that covers the arms' whole motions.
  const { Vector3, Matrix4, Quaternion } = MeshCat.THREE, THREE = MeshCat.THREE;
  const tip = new Map(data.points.map(([name, joint, at]) => [name, { joint, at: new Vector3(...at) }]));
  const position = new Vector3(), turn = new Quaternion(), next = new Quaternion();
  const pose = (arm, frame, j, weight) => {
    const a = 7 * (frame * joints + j), b = weight > 0 ? a + 7 * joints : a, p = arm.poses;
    position.set(...[0, 1, 2].map(i => p[a + i] + weight * (p[b + i] - p[a + i])));
    turn.set(p[a + 3], p[a + 4], p[a + 5], p[a + 6]);
    if (weight > 0) turn.slerp(next.set(p[b + 3], p[b + 4], p[b + 5], p[b + 6]), weight);
  };
  const places = [], outer = [];  // outer: corners of the last link, which may reach beyond the tip
  for (const arm of data.arms) {
    const end = tip.get(data.tip), stride = Math.max(1, Math.floor(arm.frames / 150)), group = arm.groups[end.joint - 1];
    const mine = [new Vector3()], box = new THREE.Box3(), ends = [];
    group?.updateMatrixWorld(true);
    const back = group?.matrixWorld.clone().invert();
    group?.traverse(node => {
      if (!node.isMesh) return;
      node.geometry.computeBoundingBox();
      box.union(node.geometry.boundingBox.clone().applyMatrix4(back.clone().multiply(node.matrixWorld)));
    });
    const sides = [box.min, box.max], corners = box.isEmpty() ? [] : [0, 1, 2, 3, 4, 5, 6, 7]
      .map(i => new Vector3(sides[i & 1].x, sides[i >> 1 & 1].y, sides[i >> 2].z));
    for (let frame = 0; frame < arm.frames; frame += stride) {
      for (let j = 0; j < joints; j++) {
        pose(arm, frame, j, 0);
        mine.push(position.clone());
        if (end.joint !== j + 1) continue;
        for (const [points, to] of [[[end.at], mine], [corners, ends]]) to.push(...points.map(at => at.clone().applyQuaternion(turn).add(position)));
      }
    }
    places.push(mine);
    outer.push(ends);
  }
  // Line between the nearest points of two bodies, always visible, with their distance.
  const marks = (data.marks ?? []).map((mark, k) => {
    const group = new THREE.Group(), [a, b] = mark.points.map(p => new Vector3(...p));
    const material = new THREE.MeshBasicMaterial({ color: 0xd11a2a, depthTest: false, transparent: true });
    const add = (geometry, at) => { const mesh = new THREE.Mesh(geometry, material); mesh.position.copy(at); mesh.renderOrder = 9; group.add(mesh); return mesh; };
    for (const end of [a, b]) add(new THREE.SphereGeometry(.006 * data.reach, 16, 12), end);
    const rod = add(new THREE.CylinderGeometry(.003 * data.reach, .003 * data.reach, Math.max(a.distanceTo(b), 1e-6), 8), a.clone().lerp(b, .5));
    if (a.distanceTo(b) > 1e-6) rod.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), b.clone().sub(a).normalize());
    const canvas = Object.assign(document.createElement("canvas"), { width: 384, height: 64 }), pen = canvas.getContext("2d");
    Object.assign(pen, { font: "600 40px system-ui, sans-serif", textAlign: "center", lineWidth: 8, strokeStyle: "#fff", fillStyle: "#b01020" });
    pen.strokeText(mark.label, 192, 46);
    pen.fillText(mark.label, 192, 46);
    const label = new THREE.Sprite(new THREE.SpriteMaterial({ map: new THREE.CanvasTexture(canvas), depthTest: false, transparent: true }));
    label.scale.set(.24 * data.reach, .04 * data.reach, 1);
    label.position.copy(a.clone().lerp(b, .5)).add(new Vector3(0, 0, .035 * data.reach));
    label.renderOrder = 10;
    group.add(label);
    viewer.set_object([...root(0), `mark${k}`], group);
    const near = .03 * data.arms[0].duration, node = object([...root(0), `mark${k}`]);
    return time => { node.visible = mark.time === null || Math.abs(time - mark.time) <= near; };
  });
  const lanes = options.overlay ? 1 : data.arms.length;
  const span = axis => Math.max(...places.flat().map(p => p[axis])) - Math.min(...places.flat().map(p => p[axis]));
  const lane = data.planar ? .42 * data.reach : Math.max(span("y") + .35 * data.reach, .6 * data.reach);
  data.arms.forEach((arm, k) => {
    const y = lanes === 1 ? 0 : lane * (k - (lanes - 1) / 2) * (data.planar ? 1 : -1);
    viewer.set_transform(root(k), new Matrix4().makeTranslation(0, y, 0).toArray());
    [...places[k], ...outer[k]].forEach(p => { p.y += y; });
  });
  // A wall behind planar arms, else a floor: a grid and the arms' shadow.
  const spacing = 10 ** Math.floor(Math.log10(.4 * data.reach)), wall = lane * lanes / 2 + .10 * data.reach;
  const low = Math.min(...places.flat().map(p => p.z)), floor = low < -.05 * data.reach ? low - .1 * data.reach : 0;
  const turned = new Matrix4().makeRotationX(data.planar ? Math.PI / 2 : 0);
  const behind = depth => (data.planar ? new Matrix4().makeTranslation(0, wall + depth, 0)
    : new Matrix4().makeTranslation(0, 0, floor - depth)).multiply(turned);
  function theme(dark) {
    const [top, bottom, major, minor] = dark
      ? [[.13, .16, .19], [.07, .09, .11], 0x46525e, 0x2b343d] : [[1, 1, 1], [.84, .88, .92], 0x98a3ae, 0xc9d1d9];
    viewer.set_property(["Background"], "top_color", top);
    viewer.set_property(["Background"], "bottom_color", bottom);
    const lines = new THREE.GridHelper(80 * spacing, 80, major, minor);
    viewer.set_object(["Grid"], lines.rotateX(Math.PI / 2));
    viewer.set_transform(["Grid"], behind(0).toArray());
    viewer.set_dirty();
  }
  theme(false);
  const screen = new THREE.Mesh(new THREE.PlaneGeometry(80 * spacing, 80 * spacing), new THREE.ShadowMaterial({ opacity: .16 }));
  screen.receiveShadow = true;
  viewer.set_object(["Shadow"], screen);
  viewer.set_transform(["Shadow"], behind(.004 * data.reach).toArray());
  const sun = new THREE.DirectionalLight(0xffffff, .42), size = 1.5 * data.reach + lane * (lanes - 1);
  sun.position.set(...(data.planar ? [-.35, -1, .6] : [.35, -.45, 1]).map(x => 3 * size * x));
  sun.castShadow = true;
  sun.shadow.mapSize.set(2048, 2048);
  sun.shadow.bias = -.0008;
  sun.shadow.normalBias = .004 * data.reach;
  sun.shadow.radius = 4;
  Object.assign(sun.shadow.camera, { left: -size, right: size, top: size, bottom: -size, near: .1 * size, far: 9 * size });
  viewer.set_object(["Lights", "Sun"], sun);
  for (const [light, strength] of [["AmbientLight", .50], ["PointLightNegativeX", .12], ["PointLightPositiveX", .12], ["FillLight", .22]]) {
    viewer.set_property(["Lights", light, "<object>"], "intensity", strength);
  }
  data.arms.forEach((_, k) => object(root(k)).traverse(node => {
    node.receiveShadow = false;
    node.castShadow = !(options.overlay && k) && !!node.parent && /^(shape|obstacle|part)/.test(node.parent.name);
  }));

  const drawn = v => new Vector3(v.x, v.z, -v.y);  // three.js has y up
  // View direction in which the fewest obstacles hide the tip's path.
  const hidden = look => {
    const solids = [], ray = new THREE.Raycaster();
    viewer.scene.updateMatrixWorld(true);
    object(root(0)).traverse(node => { if (node.isMesh && node.parent && /^obstacle/.test(node.parent.name)) solids.push(node); });
    return places.flat().filter((_, k) => k % 8 === 1)
      .filter(p => { ray.set(drawn(p), drawn(look)); return ray.intersectObjects(solids).length; }).length;
  };
  const looks = (data.planar ? [lanes > 1 ? [-.34, -1, .3] : [-.16, -1, .16]]
    : [[1.25, -1, .55], [1.25, 1, .55], [-1.25, -1, .55], [-1.25, 1, .55]]).map(v => new Vector3(...v).normalize());
  const hides = looks.map(hidden), look = looks[hides.indexOf(Math.min(...hides))];
  function fit() {
    viewer.set_3d_pane_size();
    const all = places.flat(), right = new Vector3(-look.y, look.x, 0).normalize(), up = look.clone().cross(right);
    const middle = new Vector3(), off = new Vector3(), pad = .10 * data.reach;
    for (const axis of [right, up, look]) {
      const along = all.map(p => p.dot(axis));
      middle.addScaledVector(axis, (Math.max(...along) + Math.min(...along)) / 2);
    }
    const high = Math.tan(viewer.camera.fov * Math.PI / 360), wide = high * pane.clientWidth / pane.clientHeight;
    const cover = options.room();
    const from = (points, pad) => Math.max(0, ...points.map(p => off.copy(p).sub(middle).dot(look) + Math.max(
      (Math.abs(off.dot(up)) + pad) / (cover.high * high), (Math.abs(off.dot(right)) + pad) / (cover.wide * wide))));
    const away = Math.max(from(all, pad), from(outer.flat(), 0));
    middle.addScaledVector(up, -cover.up * away * high);
    middle.addScaledVector(right, -cover.right * away * wide);
    viewer.controls.target.copy(drawn(middle));
    viewer.camera.position.copy(drawn(middle.addScaledVector(look, away)));
    viewer.controls.update();
    viewer.set_dirty();
  }
  viewer.camera.fov = 32;
  let touched = false;
  viewer.controls.addEventListener("start", () => { touched = true; });
  new ResizeObserver(() => (touched ? viewer.set_3d_pane_size() : fit())).observe(pane);
  fit();

  return {
    theme, spacing,
    fit() { touched = false; fit(); },
    // All arms at a time [s]; an arm stays at its goal after its motion.
    show(time) {
      data.arms.forEach(arm => {
        const t = Math.min(time, arm.duration) / arm.duration * (arm.frames - 1);
        const frame = Math.min(Math.floor(t), arm.frames - 2), weight = t - frame;
        arm.groups.forEach((group, j) => {
          pose(arm, frame, j, weight);
          group.position.copy(position);
          group.quaternion.copy(turn);
        });
        arm.trail.setDrawRange(0, Math.floor(arm.trail.index.count / 48 * t / (arm.frames - 1)) * 48);
      });
      marks.forEach(shown => shown(time));
      parts.forEach(part => part.show(time));
      viewer.set_dirty();
    },
    visible(k, yes) { viewer.set_property(root(k), "visible", yes); viewer.set_dirty(); },
    // Places of the parts that are drawn.
    parts: () => parts.map(part => part.nodes.some(node => node.visible)),
    // Position of the camera [m].
    camera: () => viewer.scene.worldToLocal(viewer.camera.position.clone()).toArray(),
    // Position of a frame in the drawn scene [m]; null if there is none of that name.
    linkPosition(name, k = 0) {
      const point = tip.get(name);
      if (!point) return null;
      const group = point.joint ? data.arms[k].groups[point.joint - 1] : object(root(k));
      viewer.scene.updateMatrixWorld(true);
      const at = point.at.clone().applyMatrix4(group.matrixWorld);
      return viewer.scene.worldToLocal(at).toArray();
    },
  };
};
