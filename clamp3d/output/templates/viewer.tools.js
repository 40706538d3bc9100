"use strict";
// Over the picture: a plane that cuts parts open, the distance between two clicked points, labels kept apart.
// `scene` is the node that holds all in mm.

// Of the parts that `parts()` lists, what lies before the plane is not drawn. Returns its `reset(low, high, axis)`: the
// box that it moves in, and the axis to begin with.
function sectionTool($, viewer, scene, parts) {
  const T = MeshCat.THREE, plane = new T.Plane();
  const [axis, at, flip, place] = ["section-axis", "section-at", "section-flip", "section-place"].map($);
  let low, high, side = -1;
  viewer.renderer.localClippingEnabled = true;
  function cut() {
    const on = Boolean(axis.value), k = "XYZ".indexOf(axis.value);
    for (const e of [at, flip, place]) e.hidden = !on;
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
  let insides = [];
  function fill(on) {
    for (const inside of insides) if (inside.parent) inside.parent.remove(inside);
    insides = [];
    for (const part of parts()) {
      const solids = [];
      part.traverse((o) => {
        if (o.material && !o.isSprite) o.material.clippingPlanes = on ? [plane] : null;
        if (o.isMesh && o.parent.name === "solid") solids.push(o);
      });
      for (const o of on ? solids : []) {
        // A little nearer than it is, so that edges behind it do not shine through.
        const look = { side: T.BackSide, color: o.material.color, clippingPlanes: [plane], polygonOffset: true, polygonOffsetFactor: -1, polygonOffsetUnits: -8 };
        const inside = new T.Mesh(o.geometry, new T.MeshBasicMaterial({ ...look, transparent: o.material.transparent, opacity: o.material.opacity }));
        inside.raycast = () => {};
        o.add(inside);
        insides.push(inside);
      }
    }
  }
  // The half that is nearer to the camera is taken away.
  function choose() {
    at.value = 0.5;
    const k = "XYZ".indexOf(axis.value), middle = [0, 1, 2].map((i) => (low[i] + high[i]) / 2);
    const eye = scene().worldToLocal(viewer.camera.getWorldPosition(new T.Vector3())).toArray();
    side = eye[k] > middle[k] ? -1 : 1;
    cut();
  }
  axis.addEventListener("change", choose);
  at.addEventListener("input", cut);
  flip.addEventListener("click", () => { side = -side; cut(); });
  return {
    reset(l, h, first) {
      [low, high] = [l, h];
      $("section").hidden = false;
      if (first) { axis.value = first; side = first === "Y" ? 1 : -1; }
      if (axis.value) cut();
    },
  };
}

// Two clicks while the button is down: a line between them, and in words what is known of the two parts.
function measureTool($, viewer, scene, facets, distance) {
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
  async function click(name, world) {
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
    const [x, y, z] = along.toArray().map((v) => v.toFixed(2).replace("-0.00", "0.00"));
    const [first, second] = ends, words = `${first.name} to ${second.name}: ${along.length().toFixed(2)} mm between the points, `
      + `within ${(2 * facets()).toFixed(2)} mm (X ${x}, Y ${y}, Z ${z})`;
    say(words);
    const parts = first.name === second.name ? "" : await distance(first.name, second.name);
    if (ends[1] === second) say(words + parts);
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
  const isName = (o) => Number(o.parent.name === "label");
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
