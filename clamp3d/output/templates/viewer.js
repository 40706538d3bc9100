"use strict";
// Time line, camera and switches around meshcat's viewer. What they show comes as `story` of the node /clamp3d; what
// the panel says is HTML in it.
function clamp3dViewer(messages, done) {
  const $ = (id) => document.getElementById(id);
  const pane = $("meshcat-pane");
  if (!done && location.protocol !== "file:") setTimeout(() => location.reload(), 1000);
  let viewer;
  try {
    viewer = new MeshCat.Viewer(pane);
  } catch (error) {
    // Without WebGL the panel is the page; what it says is in the HTML already.
    $("no3d").hidden = false;
    return;
  }
  document.body.classList.remove("no3d");
  window.viewer = viewer;
  const animator = viewer.animator;
  const size = viewer.set_3d_pane_size.bind(viewer);
  viewer.set_3d_pane_size = (w, h) => size(w || pane.clientWidth || 1, h || pane.clientHeight || 1);
  new ResizeObserver(() => viewer.set_3d_pane_size()).observe(pane);
  const dark = matchMedia("(prefers-color-scheme: dark)");
  function background() {
    const [top, bottom] = dark.matches ? [[0.13, 0.16, 0.19], [0.08, 0.1, 0.12]] : [[0.93, 0.95, 0.97], [1, 1, 1]];
    viewer.set_property(["Background"], "top_color", top);
    viewer.set_property(["Background"], "bottom_color", bottom);
  }
  dark.addEventListener("change", background);

  let story = null;
  let stop = -1;
  let before = 0;
  let touched = false;  // whether the user has moved the camera or picked a finding

  // Unlike scene_tree.find, this makes no node that is not there.
  const split = (path) => path.split("/").filter((x) => x);
  const node = (path) => split(path).reduce((n, name) => n && n.children[name], viewer.scene_tree);
  const show = (path, on) => {
    const n = node(path);
    if (n) { n.set_property("visible", on); viewer.set_dirty(); }
  };

  // Switches
  const switches = {};
  function addSwitch(name, on, set) {
    if (!switches[name]) switches[name] = { on, touched: false };
    const own = switches[name];
    const box = document.createElement("input");
    box.type = "checkbox";
    box.id = "switch-" + name.replace(/\W+/g, "-");
    box.checked = own.on;
    own.apply = () => set(own.on);
    box.addEventListener("change", () => { own.on = box.checked; own.touched = true; own.apply(); });
    const label = document.createElement("label");
    label.append(box, " " + name);
    $("switches").append(label);
    own.apply();
  }
  function addSwitches() {
    if (story.cut) addSwitch("cutaway", story.cut_open, (on) => { show("/clamp3d/cutaway", on); show("/clamp3d/whole", !on); });
    addSwitch("labels", Object.keys(story.nodes).length <= 14, (on) => show("/clamp3d/labels", on));
    addSwitch("contacts", true, (on) => show("/clamp3d/contacts", on));
    addSwitch("gaps", true, (on) => show("/clamp3d/gaps", on));
    if (story.forces.length) addSwitch("forces", true, (on) => show("/clamp3d/forces", on));
    for (const o of story.overlays) addSwitch(o.name, false, (on) => show(o.path, on));
    addSwitch("scene tree", false, (on) => $("stage").classList.toggle("tree", on));
  }

  // Parts: shown as they are, faint (seen through) or hidden.
  const own = {};  // what the user chose for a part: "ghost" or "hide"
  function look(name, how) {
    for (const path of story.nodes[name].filter((p) => !p.startsWith("/clamp3d/labels"))) {
      const n = node(path);
      if (n) n.object.traverse((o) => {
        if (!o.material) return;
        if (!o.plain) o.plain = { opacity: o.material.opacity, transparent: o.material.transparent, depthWrite: o.material.depthWrite, visible: true };
        Object.assign(o.material, how ? { opacity: 0.13 * o.plain.opacity, transparent: true, depthWrite: false, visible: how !== "hide" } : o.plain);
        o.material.needsUpdate = true;
      });
    }
    show("/clamp3d/labels/" + name, !how);
  }

  // Parts that a finding names stand out: the others are seen through.
  function highlight(names) {
    if (!names) for (const name of Object.keys(own)) delete own[name];
    for (const name of Object.keys(story.nodes)) look(name, own[name] || (names && !names.includes(name) ? "ghost" : ""));
    for (const group of ["contacts", "gaps", "forces"]) {
      const n = node("/clamp3d/" + group);
      for (const marks of n ? Object.values(n.children) : []) {
        for (const [pair, mark] of Object.entries(marks.children)) {
          mark.object.visible = !names || pair === names.join("-") || pair === [...names].reverse().join("-");
          const value = mark.children.value;
          if (!value) continue;
          if (value.plain === undefined) value.plain = value.object.visible;
          value.object.visible = Boolean(names) || value.plain;
        }
      }
    }
    show("/clamp3d/labels", Boolean(names) || switches.labels.on);
    $("home").hidden = !names && !Object.keys(own).length;
    viewer.set_dirty();
  }

  // The list of findings holds those of one part, or all.
  function filter(name) {
    const rows = [...document.querySelectorAll("#findings > li")];
    const names = (li) => [...li.querySelectorAll(".finding")].flatMap(({ dataset }) => [story.findings[dataset.k].a, story.findings[dataset.k].b]);
    for (const li of rows) li.hidden = Boolean(name) && !names(li).includes(name);
    const left = rows.filter((li) => !li.hidden).length;
    if (rows.length) $("filtered").textContent = name ? ` - ${left || "none"} with ${name}, of ${rows.length}` : "";
  }

  // A click on a part, in the picture or in the list, names it and offers to isolate, ghost or hide it.
  let identified = "";
  function identify(name) {
    identified = name;
    for (const e of document.querySelectorAll(".part")) e.classList.toggle("now", e.dataset.part === name);
    $("identity").hidden = !name;
    $("identity").firstElementChild.textContent = name;
    filter(name);
  }
  $("identity").addEventListener("click", (e) => {
    const how = e.target.dataset.do;
    if (!how) return;
    touched = true;
    if (how === "isolate") highlight([identified]);
    else { own[identified] = how; look(identified, how); $("home").hidden = false; viewer.set_dirty(); }
  });
  const root = () => viewer.scene_tree.find(["clamp3d"]).object;
  const render = viewer.render.bind(viewer);
  viewer.render = () => { spreadLabels(viewer, root()); render(); };
  const section = sectionTool($, viewer, root);
  const measure = measureTool($, viewer, root, () => story.facets, (a, b) => {
    const row = story.stops[Math.max(0, stop)].rows.find((r) => (r.a === a && r.b === b) || (r.a === b && r.b === a));
    return row ? "; the parts: " + row.gap : "";
  });
  function hitAt(x, y) {
    const box = viewer.renderer.domElement.getBoundingClientRect(), T = MeshCat.THREE, ray = new T.Raycaster();
    ray.setFromCamera(new T.Vector2(2 * (x - box.left) / box.width - 1, 1 - 2 * (y - box.top) / box.height), viewer.camera);
    let nearest = null;
    for (const [name, paths] of Object.entries(story.nodes)) for (const path of paths.filter((p) => /^\/clamp3d\/(whole|cutaway)\//.test(p))) {
      const n = node(path);
      if (!n || own[name] === "hide" || !node(path.split("/").slice(0, 3).join("/")).object.visible) continue;
      const meshes = [];
      n.object.traverse((o) => { if (o.isMesh) meshes.push(o); });
      const hit = ray.intersectObjects(meshes, false).find((h) => viewer.renderer.clippingPlanes.every((p) => p.distanceToPoint(h.point) >= 0));
      if (hit && (!nearest || hit.distance < nearest.distance)) nearest = { name, distance: hit.distance, point: hit.point };
    }
    return nearest || { name: "", point: null };
  }
  let pressed = null;
  pane.addEventListener("pointerdown", (e) => { pressed = [e.clientX, e.clientY]; });
  pane.addEventListener("pointerup", (e) => {
    if (story && pressed && Math.hypot(e.clientX - pressed[0], e.clientY - pressed[1]) < 4) {
      const hit = hitAt(e.clientX, e.clientY);
      if (measure.active()) measure.click(hit.name, hit.point);
      else identify(hit.name);
    }
    pressed = null;
  });

  // Camera: fly so that a box (corners in mm of the scene) fills the picture, without turning unless an eye is given.
  let flight = 0;
  function fly(low, high, eye, time) {
    const V = MeshCat.THREE.Vector3;
    const camera = viewer.camera;
    viewer.scene.updateMatrixWorld(true);
    const local = (x, y, z) => camera.parent.worldToLocal(new V(x, y, z).applyMatrix4(root().matrixWorld));
    const corners = [];
    for (const x of [low[0], high[0]]) for (const y of [low[1], high[1]]) for (const z of [low[2], high[2]]) corners.push(local(x, y, z));
    const target = local((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2);
    const back = eye ? new V(...eye).normalize() : camera.position.clone().sub(viewer.controls.target).normalize();
    const right = new V(0, 1, 0).cross(back).normalize();
    const up = back.clone().cross(right);
    const tall = Math.tan(camera.fov * Math.PI / 360) * 0.94;
    const wide = tall * Math.max(0.2, camera.aspect);
    let far = 0.05;
    for (const c of corners) {
      const d = c.clone().sub(target);
      far = Math.max(far, Math.abs(d.dot(right)) / wide + d.dot(back), Math.abs(d.dot(up)) / tall + d.dot(back));
    }
    const to = target.clone().addScaledVector(back, far);
    const from = camera.position.clone(), aim = viewer.controls.target.clone(), start = performance.now(), own = ++flight;
    (function step() {
      if (own !== flight) return;
      const f = time ? Math.min(1, (performance.now() - start) / time) : 1;
      const s = f * f * (3 - 2 * f);
      camera.position.lerpVectors(from, to, s);
      viewer.controls.target.lerpVectors(aim, target, s);
      viewer.set_dirty();
      if (f < 1) requestAnimationFrame(step);
    })();
  }
  // Everything at a stop, or of the way to the next one.
  let framed = "";
  function home(time, turn) {
    if (!story || !story.frame) return;
    const i = Math.max(0, stop), playing = story.done && animator.playing;
    const boxes = playing && story.stops[i + 1] ? [story.stops[i], story.stops[i + 1]] : [story.stops[i]];
    const corner = (pick, key) => [0, 1, 2].map((k) => pick(...boxes.map((b) => b[key][k])));
    framed = i + " " + boxes.length;
    fly(corner(Math.min, "low"), corner(Math.max, "high"), turn ? story.frame.eye : null, time);
  }
  function follow() {
    const moves = story.done && animator.playing && story.stops[stop + 1] ? 2 : 1;
    if (!touched && stop >= 0 && framed !== stop + " " + moves) home(soft());
  }
  const calm = () => matchMedia("(prefers-reduced-motion: reduce)").matches;
  const soft = () => (calm() ? 0 : 700);

  function pick(element, names, low, high) {
    for (const e of document.querySelectorAll(".finding.now, .rows tr.now")) e.classList.remove("now");
    touched = true;
    if (element) element.classList.add("now");
    highlight(names);
    if (low) fly(low, high, null, soft());
    else { touched = false; home(soft()); }
  }
  $("story").addEventListener("click", (e) => {
    const part = e.target.closest(".part");
    if (part) {
      const shown = part.classList.contains("now");
      identify(shown ? "" : part.dataset.part);
      touched = true;
      return highlight(shown ? null : [part.dataset.part]);
    }
    const finding = e.target.closest(".finding"), row = e.target.closest(".rows tr[data-a]");
    const again = (finding || row) && (finding || row).classList.contains("now");
    drawCurve(again || !finding ? null : story.findings[Number(finding.dataset.k)]);
    if (again) pick(null);
    else if (finding) {
      const f = story.findings[Number(finding.dataset.k)];
      if (!$("timeline").hidden) go(f.stop);
      pick(finding, f.a ? [f.a, f.b] : null, f.low, f.high);
      try { history.replaceState(null, "", "#finding=" + f.group); } catch (error) { /* not everywhere for a file */ }
      if (innerWidth <= 760) $("stage").scrollIntoView({ block: "start" });
    } else if (row) {
      const r = story.stops[Number(row.closest(".stop").dataset.stop)].rows.find((r) => r.a === row.dataset.a && r.b === row.dataset.b);
      const points = [r.point_a, r.point_b].filter((p) => p);
      const margin = 0.05 * Math.max(...story.frame.high.map((x, i) => x - story.frame.low[i]));
      const corner = (pick, sign) => [0, 1, 2].map((i) => pick(...points.map((p) => p[i])) + sign * margin);
      if (points.length) pick(row, [r.a, r.b], corner(Math.min, -1), corner(Math.max, 1));
      else pick(row, [r.a, r.b], story.frame.low, story.frame.high);
    }
  });
  addEventListener("hashchange", openFinding);
  $("home").addEventListener("click", () => { identify(""); drawCurve(null); pick(null); });
  pane.addEventListener("pointerdown", () => { touched = true; flight++; });
  pane.addEventListener("wheel", () => { touched = true; flight++; }, { passive: true });

  // Time line
  const end = () => story.stops[story.stops.length - 1].leave;
  function mark(s, i) {
    const a = document.createElement("button");
    a.textContent = s.mark && s.mark === (story.stops[i - 1] || {}).mark ? "" : s.mark;
    a.title = s.label;
    a.classList.toggle("halts", s.halts);
    a.classList.toggle("end", s.arrive > 0.92 * end());
    a.style.left = 100 * s.arrive / end() + "%";
    a.addEventListener("click", () => go(i));
    return a;
  }
  function seek(t) {
    animator.pause();
    animator.seek(t);
    animator.display_progress(t);
    before = t;
    refresh();
  }
  function go(i) {
    // A moment later: three.js keeps key times as 32-bit floats, so the exact time may count as before.
    seek(story.stops[Math.max(0, Math.min(story.stops.length - 1, i))].arrive + 0.005);
  }
  function current(t) {
    let i = 0;
    while (i + 1 < story.stops.length && story.stops[i + 1].arrive <= t + 1e-6) i++;
    return i;
  }
  // The distance of a picked finding while its motion plays: a band between its bounds, a line at 0 mm.
  let curve = null;
  function drawCurve(finding) {
    curve = (finding && story.curves.find((c) => c.motion === finding.motion && c.a === finding.a && c.b === finding.b)) || null;
    $("curve").hidden = !curve;
    if (!curve) return;
    // The certain side sets the scale: where a depth is hardly bounded the band leaves the picture at its lower edge.
    const upper = curve.bounds.map((b) => b[1]), low = Math.min(0, ...upper), high = Math.max(0, ...upper);
    const point = (mm, i) => [1000 * curve.seconds[i] / end(), mm === null ? 1000 : 94 - 90 * (mm - low) / (high - low || 1)];
    const band = [...curve.bounds.map((b, i) => point(b[1], i)), ...curve.bounds.map((b, i) => point(b[0], i)).reverse()];
    const zero = point(0, 0)[1];
    $("curve").firstElementChild.innerHTML = `<line x1="0" x2="1000" y1="${zero}" y2="${zero}"/><polygon points="${band.join(" ")}"/>`;
    sayCurve();
  }
  function sayCurve() {
    const i = curve.seconds.reduce((best, s, k) => (Math.abs(s - animator.time) < Math.abs(curve.seconds[best] - animator.time) ? k : best), 0);
    const [lower, upper] = curve.bounds[i];
    const text = `distance of ${curve.a} and ${curve.b} at t = ${curve.t[i].toFixed(3)}: `
      + (lower === null ? "" : (Math.floor(lower * 1e4) / 1e4).toFixed(4) + " to ") + (lower === null ? "at most " : "") + (Math.ceil(upper * 1e4) / 1e4).toFixed(4) + " mm";
    write($("curve").lastElementChild, "", text);
    write($("curve").firstElementChild, "aria-label", text);
  }
  function toggle() {
    if (animator.playing) animator.pause();
    else {
      if (animator.time >= end() - 1e-3) { animator.reset(); before = 0; }
      animator.play();
    }
    refresh();
  }
  function showStop(i) {
    stop = i;
    for (const e of document.querySelectorAll(".stop")) e.hidden = Number(e.dataset.stop) !== i;
    [...$("marks").children].forEach((a, k) => a.classList.toggle("now", k === i));
  }
  // An attribute, or the text, where it is another: what is written is laid out and painted again, in each frame.
  function write(element, name, value) {
    if (!name && element.textContent !== value) element.textContent = value;
    else if (name && element.getAttribute(name) !== value) element.setAttribute(name, value);
  }
  function refresh() {
    if (!story || !story.done || $("timeline").hidden) return;
    const t = animator.time;
    if (animator.playing) {
      const halt = story.stops.find((s) => s.halts && before < s.arrive && s.arrive <= t);
      if (halt) return seek(halt.arrive + 0.005);
      before = t;
    }
    const i = current(t), s = story.stops[i], next = story.stops[i + 1];
    write($("time"), "max", String(end()));
    if (document.activeElement !== $("time") || animator.playing) $("time").value = t;
    write($("play").firstElementChild.firstElementChild, "d", animator.playing ? "M3 2h4v12H3zM9 2h4v12H9z" : "M3 1l11 7-11 7z");
    const moving = next && t > s.leave + 1e-6;
    const at = moving ? next : s;
    write($("label"), "", (story.stops.indexOf(at) + 1) + "/" + story.stops.length + "  " + (moving ? "moving to: " : "") + at.label);
    write($("step"), "", at.label.startsWith(at.step) ? "" : "step " + at.step);
    if (i !== stop) showStop(i);
    if (curve) sayCurve();
    follow();
  }
  (function frame() { refresh(); requestAnimationFrame(frame); })();

  $("time").addEventListener("input", () => seek(Number($("time").value)));
  $("play").addEventListener("click", toggle);
  $("back").addEventListener("click", () => { const i = current(animator.time); go(animator.time > story.stops[i].arrive + 0.05 ? i : i - 1); });
  $("forward").addEventListener("click", () => go(current(animator.time) + 1));
  document.addEventListener("keydown", (e) => {
    if (e.key === "h" || e.key === "Escape") { identify(""); measure.clear(); drawCurve(null); pick(null); }
    if (e.key === "m" && e.target.tagName !== "INPUT") $("measure").click();
    if ($("timeline").hidden || e.target.tagName === "INPUT" && e.target.type !== "checkbox") return;
    if (e.key === "ArrowRight") $("forward").click();
    else if (e.key === "ArrowLeft") $("back").click();
    else if (e.key === " " && !["BUTTON", "INPUT", "SUMMARY"].includes(e.target.tagName)) { toggle(); e.preventDefault(); }
  });

  function showStory(data) {
    story = data;
    $("story").innerHTML = story.panel;
    document.title = story.title + " - clamp3d";
    addSwitches();
    if (story.frame) section.reset(story.frame.low, story.frame.high);
    $("timeline").hidden = !(story.done && story.stops.length > 1);
    $("marks").replaceChildren(...(story.done && story.stops.length > 1 ? story.stops.map(mark) : []));
    stop = -1;
    if (story.stops.length) showStop(story.done ? 0 : story.stops.length - 1);
    // The panel says it; the caption is for meshcat's own page.
    viewer.scene_tree.find(["clamp3d", "caption"]).set_property("visible", false);
    if (!touched) setTimeout(() => { viewer.set_3d_pane_size(); if (!touched) home(0, true); openFinding(); }, 30);
  }
  // The address can name a finding: #finding=ID.
  function openFinding() {
    const id = new URLSearchParams(location.hash.slice(1)).get("finding");
    const finding = id && [...document.querySelectorAll(".finding")].find((e) => e.dataset.id === id);
    if (finding && !finding.classList.contains("now")) finding.click();
  }

  // Parts of one shape share its geometry: it comes once, by its uuid, and is made for the first object that has it.
  const geometries = {};
  function setObject(command) {
    const uuid = command.object.object.geometry, own = geometries[uuid];
    const none = { uuid, type: "BufferGeometry", data: { attributes: {} } };
    handle({ ...command, object: { ...command.object, geometries: own ? [own.made ? none : own.data] : [] } });
    if (!own) return;
    const object = viewer.scene_tree.find([...split(command.path), "<object>"]).object;
    if (own.made) object.geometry = own.made;
    else Object.assign(own, { made: object.geometry, data: null });
  }

  const handle = viewer.handle_command.bind(viewer);
  viewer.handle_command = (command) => {
    if (command.type === "set_property" && command.path === "/Background") return background();
    if (command.type === "set_geometry") geometries[command.path] = { data: command.geometry };
    else if (command.type === "set_object") setObject(command);
    else handle(command);
    if (command.type === "set_animation" && calm()) animator.pause();  // it waits for the button (WCAG 2.2.2)
    if (command.type === "set_property" && command.property === "story" && command.path === "/clamp3d") showStory(command.value);
    else if (command.type === "set_property" && command.property === "visible") {
      // A switch that the user has set outlasts what the program sends.
      for (const s of Object.values(switches)) if (s.touched) s.apply();
    }
  };

  for (const m of messages) viewer.handle_command_bytearray(Uint8Array.from(atob(m), (c) => c.charCodeAt(0)));
}
