"use strict";
// Over the picture: a plane that cuts everything open, the distance between two clicked points, labels kept apart.
// `scene` is the node that holds all in mm; `say` shows a line of text over the picture.

// What lies before the plane is not drawn. Returns its `reset(low, high)`: the box that it moves in.
function sectionTool($, viewer, scene) {
  const T = MeshCat.THREE, plane = new T.Plane();
  const [axis, at, flip, place] = ["section-axis", "section-at", "section-flip", "section-place"].map($);
  let low, high, side = -1;
  function cut() {
    const on = Boolean(axis.value), k = "XYZ".indexOf(axis.value);
    for (const e of [at, flip, place]) e.hidden = !on;
    viewer.renderer.clippingPlanes = on ? [plane] : [];
    if (on) {
      const mm = low[k] + Number(at.value) * (high[k] - low[k]), unit = [0, 1, 2].map((i) => (i === k ? 1 : 0));
      place.textContent = axis.value + " " + mm.toFixed(2) + " mm";
      at.setAttribute("aria-valuetext", place.textContent);
      scene().updateMatrixWorld(true);
      const normal = new T.Vector3(...unit.map((u) => side * u)).transformDirection(scene().matrixWorld);
      plane.setFromNormalAndCoplanarPoint(normal, new T.Vector3(...unit.map((u) => u * mm)).applyMatrix4(scene().matrixWorld));
    }
    fill(on);
    viewer.set_dirty();
  }
  // Backs of faces in one colour, without light, look like the material that is cut.
  const insides = [];
  function fill(on) {
    if (on === insides.length > 0) return;
    for (const inside of insides.splice(0)) inside.parent.remove(inside);
    const solid = [];
    if (on) scene().traverse((o) => { if (o.isMesh && o.material && o.material.color) solid.push(o); });
    for (const o of solid) {
      const inside = new T.Mesh(o.geometry, new T.MeshBasicMaterial({ side: T.BackSide, color: o.material.color.clone().multiplyScalar(0.6) }));
      o.add(inside);
      insides.push(inside);
    }
  }
  axis.addEventListener("change", () => { at.value = 0.5; cut(); });
  at.addEventListener("input", cut);
  flip.addEventListener("click", () => { side = -side; cut(); });
  return { reset(l, h) { [low, high] = [l, h]; $("section").hidden = false; if (axis.value) cut(); } };
}

// Two clicks while the button is down: a line between them, and in words what is known of the two parts.
function measureTool($, viewer, scene, facets, known) {
  const T = MeshCat.THREE, button = $("measure"), drawn = new T.Group();
  let ends = [];
  const active = () => button.getAttribute("aria-pressed") === "true";
  function clear() { ends = []; drawn.clear(); if (drawn.parent) drawn.parent.remove(drawn); $("measured").hidden = true; viewer.set_dirty(); }
  function say(text) { $("measured").textContent = text; $("measured").hidden = false; }
  button.addEventListener("click", () => {
    clear();
    button.setAttribute("aria-pressed", String(!active()));
    if (active()) say("Click two points.");
  });
  function click(name, world) {
    if (ends.length === 2) clear();
    if (!name) return say("Click a part.");
    ends.push({ name, at: scene().worldToLocal(world.clone()) });
    const line = new T.Line(new T.BufferGeometry().setFromPoints(ends.map((e) => e.at)), new T.LineBasicMaterial({ color: 0xd6006e, depthTest: false }));
    line.renderOrder = 10;
    drawn.clear();
    drawn.add(line);
    scene().add(drawn);
    viewer.set_dirty();
    if (ends.length === 1) return say(name + ": click the other point.");
    const [p, q] = ends.map((e) => e.at), along = q.clone().sub(p);
    const parts = ends[0].name === ends[1].name ? "" : known(ends[0].name, ends[1].name);
    const [x, y, z] = along.toArray().map((v) => v.toFixed(2).replace("-0.00", "0.00"));
    say(`${ends[0].name} to ${ends[1].name}: ${along.length().toFixed(2)} mm between the points, within ${(2 * facets()).toFixed(2)} mm `
      + `(X ${x}, Y ${y}, Z ${z})${parts}`);
  }
  return { active, click, clear() { button.setAttribute("aria-pressed", "false"); clear(); } };
}

// Labels never cover each other: each takes the first free place at its point, or is left out until one comes nearer.
// Lengths come before names. Called before each frame.
function spreadLabels(viewer, scene) {
  const T = MeshCat.THREE, labels = [], taken = [], at = new T.Vector3(), size = new T.Vector3();
  const { clientWidth: width, clientHeight: height } = viewer.renderer.domElement;
  const projection = viewer.camera.projectionMatrix.elements;
  scene.updateMatrixWorld(true);
  scene.traverseVisible((o) => { if (o.isSprite) labels.push(o); });
  const isName = (o) => Number(o.parent.parent && o.parent.parent.name === "labels");
  labels.sort((a, b) => isName(a) - isName(b));
  for (const label of labels) {
    at.setFromMatrixPosition(label.matrixWorld).project(viewer.camera);
    size.setFromMatrixScale(label.matrixWorld);
    const [w, h] = [size.x * projection[0] * width / 2, size.y * projection[5] * height / 2];
    const [x, y] = [width * (at.x + 1) / 2, height * (1 - at.y) / 2];
    const places = [[0.5, 0.5], [0.5, -0.55], [0.5, 1.55], [-0.05, 0.5], [1.05, 0.5]];
    const free = places.map(([u, v]) => ({ u, v, left: x - u * w, top: y - (1 - v) * h, w, h })).find((own) =>
      taken.every((o) => own.left >= o.left + o.w || o.left >= own.left + own.w || own.top >= o.top + o.h || o.top >= own.top + own.h));
    label.material.visible = Boolean(free);
    if (!free) continue;
    label.center.set(free.u, free.v);
    taken.push(free);
  }
}
