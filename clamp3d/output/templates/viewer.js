"use strict";
// The page around meshcat's viewer: findings, parts, camera and switches. What they show comes as `story`, a command of
// its own; what the panel says is HTML in it. `messages` build the scene of a saved page; a served one streams them.
function clamp3dViewer(messages, done) {
  const $ = (id) => document.getElementById(id);
  const pane = $("meshcat-pane"), served = location.protocol !== "file:" && !messages.length;
  let viewer;
  try {
    viewer = new MeshCat.Viewer(pane);
  } catch (error) {
    // Without WebGL the panel is the page; what it says is in the HTML already.
    $("no3d").hidden = false;
    if (served && !done) setTimeout(() => location.reload(), 2000);
    return;
  }
  document.body.classList.remove("no3d");
  window.viewer = viewer;
  const animator = viewer.animator;
  const size = viewer.set_3d_pane_size.bind(viewer);
  viewer.set_3d_pane_size = (w, h) => size(w || pane.clientWidth || 1, h || pane.clientHeight || 1);
  new ResizeObserver(() => viewer.set_3d_pane_size()).observe(pane);
  viewer.renderer.domElement.setAttribute("role", "img");
  const dark = matchMedia("(prefers-color-scheme: dark)");
  function background() {
    const [top, bottom] = dark.matches ? [[0.13, 0.16, 0.19], [0.08, 0.1, 0.12]] : [[0.93, 0.95, 0.97], [1, 1, 1]];
    viewer.set_property(["Background"], "top_color", top);
    viewer.set_property(["Background"], "bottom_color", bottom);
  }
  dark.addEventListener("change", background);

  let story = null;
  let touched = false;  // whether the user has moved the camera or picked a finding
  let picked = null;  // the key and the names of what is picked: a finding or a row
  let identified = "";  // the part that was clicked
  const looks = {};  // what the user chose for a part: "ghost" or "hide"
  const root = () => viewer.scene_tree.find(["clamp3d"]).object;
  // Unlike scene_tree.find, this makes no node that is not there.
  const split = (path) => path.split("/").filter((x) => x);
  const node = (path) => split("clamp3d/" + path).reduce((n, name) => n && n.children[name], viewer.scene_tree);
  const show = (path, on) => {
    const n = node(path);
    if (n) { n.set_property("visible", on); viewer.set_dirty(); }
  };
  // Labels come when their pictures are decoded; until then there is no node of theirs.
  const showSprite = (path, on) => { viewer.scene_tree.find(split("clamp3d/" + path)).set_property("visible", Boolean(on)); viewer.set_dirty(); };
  const names = () => Object.keys(story.paths);
  const calm = () => matchMedia("(prefers-reduced-motion: reduce)").matches;
  const soft = () => (calm() ? 0 : 700);
  // Distances of pairs at a time of the time line, measured by the program on request. Null on a saved page.
  const ask = async (query) => {
    if (!served || !story.done) return null;
    try {
      const answer = await fetch("answer?" + new URLSearchParams(query));
      return answer.ok ? (await answer.json()).rows : null;
    } catch (error) { return null; }  // the program has ended
  };

  // Switches
  const switches = {};
  function addSwitch(name, on, set) {
    const own = switches[name] || (switches[name] = { on, touched: false });
    const label = document.createElement("label"), box = label.appendChild(document.createElement("input"));
    box.type = "checkbox";
    box.id = "switch-" + name.replace(/\W+/g, "-");
    box.checked = own.on;
    own.apply = () => set(own.on);
    box.addEventListener("change", () => { own.on = box.checked; own.touched = true; own.apply(); });
    label.append(" " + name);
    $("switches").append(label);
    own.apply();
  }
  function addSwitches() {
    addSwitch("labels", names().length <= 14, () => names().forEach(showLabel));
    for (const kind of ["contacts", "gaps", "forces"]) if (kind !== "forces" || story.forces.length) addSwitch(kind, true, (on) => show(kind, on));
    for (const title of story.overlays) addSwitch(title, false, (on) => names().forEach((name) => show(story.paths[name] + "/" + title, on)));
    addSwitch("scene tree", false, (on) => $("stage").classList.toggle("tree", on));
  }
  const inPicked = (name) => Boolean(picked && picked.names && picked.names.includes(name));
  const showLabel = (name) => showSprite(story.paths[name] + "/label", !looks[name] && (picked && picked.names ? inPicked(name) : switches.labels.on));

  // Parts: as they are, see-through (so that what they overlap is seen in them), ghosts, or hidden.
  const OPACITY = { through: 0.45, ghost: 0.13, hide: 0 };
  function look(name) {
    const how = looks[name] || (!picked || !picked.names ? "" : !inPicked(name) ? "ghost" : picked.through ? "through" : "");
    node(story.paths[name]).object.traverse((o) => {
      if (!o.material || o.isSprite) return;
      if (!o.plain) o.plain = { opacity: o.material.opacity, transparent: o.material.transparent, depthWrite: o.material.depthWrite, visible: true };
      Object.assign(o.material, how ? { opacity: OPACITY[how] * o.plain.opacity, transparent: true, depthWrite: false, visible: how !== "hide" } : o.plain);
      o.material.needsUpdate = true;
    });
    showLabel(name);
  }
  // What is picked stands out: other parts are ghosts, and only its own marks are drawn.
  function highlight() {
    names().filter((name) => node(story.paths[name])).forEach(look);
    const own = picked && picked.names;
    for (const group of ["contacts", "gaps", "forces"]) {
      for (const marks of Object.values((node(group) || { children: {} }).children)) {
        for (const [pair, mark] of Object.entries(marks.children)) {
          mark.object.visible = !own || pair === own.join("-") || pair === [...own].reverse().join("-");
          const value = mark.children.value;
          if (!value) continue;
          if (value.plain === undefined) value.plain = value.object.visible;
          value.object.visible = Boolean(own) || value.plain;
        }
      }
    }
    $("home").hidden = !own && !Object.keys(looks).length;
    viewer.set_dirty();
  }

  // The list of findings holds those with a part whose name has the text of the search field; of a clicked part, its own.
  function filter() {
    const text = $("search") ? $("search").value.trim().toLowerCase() : "";
    const fits = (name) => (identified ? name === identified : name.toLowerCase().includes(text));
    const rows = [...document.querySelectorAll("#findings > li")];
    const within = (li) => [...li.querySelectorAll(".finding")].flatMap(({ dataset }) => [story.findings[dataset.k].a, story.findings[dataset.k].b]);
    for (const li of rows) li.hidden = !within(li).some(fits);
    for (const part of document.querySelectorAll(".part")) part.parentElement.hidden = !identified && !fits(part.dataset.part);
    const left = rows.filter((li) => !li.hidden).length, what = identified || (text && `"${text}"`);
    if (rows.length) $("filtered").textContent = what ? ` - ${left || "none"} with ${what}, of ${rows.length}` : "";
  }

  // A click on a part, in the picture or in the list, names it and offers to isolate, ghost or hide it.
  function identify(name) {
    identified = name;
    for (const e of document.querySelectorAll(".part")) mark(e, e.dataset.part === name);
    $("identity").hidden = !name;
    $("identity").firstElementChild.textContent = name;
    filter();
  }
  function mark(element, on) {
    element.classList.toggle("now", on);
    if (on) element.setAttribute("aria-current", "true"); else element.removeAttribute("aria-current");
  }
  function change(how) {
    touched = true;
    if (how === "isolate") picked = { key: "", names: [identified] };
    else looks[identified] = how;
    highlight();
  }
  $("identity").addEventListener("click", (e) => { if (e.target.dataset.do) change(e.target.dataset.do); });

  const render = viewer.render.bind(viewer);
  viewer.render = () => { spreadLabels(viewer, root()); render(); };
  const section = sectionTool($, viewer, root, () => names().map((name) => [name, node(story.paths[name])]).filter(([name, n]) => n && !(story.uncut || []).includes(name)).map(([, n]) => n.object));
  const measure = measureTool($, viewer, root, () => story.facets, async (a, b) => {
    const rows = await ask({ time: animator.time, a, b }) || (story.stops[times.stop()] || { rows: [] }).rows;
    const row = rows.find((r) => (r.a === a && r.b === b) || (r.a === b && r.b === a));
    return row ? "; the parts: " + row.gap : "";
  });
  // The nearest part under a point of the picture. What is cut open is met on the cut, where its inside is seen.
  function hitAt(x, y) {
    const box = viewer.renderer.domElement.getBoundingClientRect(), T = MeshCat.THREE, ray = new T.Raycaster();
    ray.setFromCamera(new T.Vector2(2 * (x - box.left) / box.width - 1, 1 - 2 * (y - box.top) / box.height), viewer.camera);
    let nearest = { name: "", point: null, distance: Infinity };
    for (const name of names()) {
      const n = node(story.paths[name] + "/solid");
      if (!n || looks[name] === "hide") continue;
      const solid = n.children["<object>"].object, planes = solid.material.clippingPlanes || [];
      const hit = ray.intersectObject(solid, false).find((h) => planes.every((p) => p.distanceToPoint(h.point) >= 0));
      if (!hit) continue;
      const inside = hit.face.normal.clone().transformDirection(solid.matrixWorld).dot(ray.ray.direction) > 0;
      const point = (inside && planes.length && ray.ray.intersectPlane(planes[0], new T.Vector3())) || hit.point;
      const distance = point.distanceTo(ray.ray.origin);
      if (distance < nearest.distance) nearest = { name, point, distance };
    }
    return nearest;
  }
  let pressed = null;
  pane.addEventListener("pointerdown", (e) => { pressed = [e.clientX, e.clientY]; touched = true; flight++; });
  pane.addEventListener("wheel", () => { touched = true; flight++; }, { passive: true });
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
    if (!story) return;
    const boxes = times.around(), corner = (pick, key) => [0, 1, 2].map((k) => pick(...boxes.map((b) => b[key][k])));
    framed = String(boxes.map((b) => b.arrive));
    fly(corner(Math.min, "low"), corner(Math.max, "high"), turn ? story.frame.eye : null, time);
  }
  function follow() {
    if (!touched && framed !== String(times.around().map((b) => b.arrive))) home(soft());
  }

  // The address names what is seen: #finding=ID&camera=x,y,z,x,y,z (where it stands, what it is aimed at).
  const address = () => new URLSearchParams(location.hash.slice(1));
  function remember() {
    const hash = new URLSearchParams(picked && picked.id ? { finding: picked.id } : {});
    if (touched) hash.set("camera", [...viewer.camera.position.toArray(), ...viewer.controls.target.toArray()].map((x) => x.toFixed(4)));
    try { history.replaceState(null, "", String(hash) ? "#" + hash : location.pathname + location.search); } catch (error) { /* not everywhere for a file */ }
  }
  viewer.controls.addEventListener("end", remember);
  function openAddress() {
    const id = address().get("finding"), camera = (address().get("camera") || "").split(",").map(Number);
    const finding = id && [...document.querySelectorAll(".finding")].find((e) => e.dataset.id === id);
    if (finding && !finding.classList.contains("now")) open(finding);
    if (camera.length !== 6 || !camera.every(Number.isFinite)) return Boolean(id);
    flight++;
    touched = true;
    viewer.camera.position.set(...camera.slice(0, 3));
    viewer.controls.target.set(...camera.slice(3));
    viewer.set_dirty();
    return true;
  }
  addEventListener("hashchange", openAddress);

  // Pick a finding, a row of a moment or nothing, and fly there.
  function pick(element, what, low, high) {
    for (const e of document.querySelectorAll(".finding.now, .rows tr.now")) mark(e, false);
    picked = what;
    touched = Boolean(element);
    if (element) mark(element, true);
    else for (const name of Object.keys(looks)) delete looks[name];
    highlight();
    if (low) fly(low, high, null, soft());
    else home(soft());
    setTimeout(remember, soft() + 50);
  }
  const BAD = ["clash", "contained", "duplicate"];
  function open(element) {
    const f = story.findings[Number(element.dataset.k)];
    times.curve(f);
    if (!$("timeline").hidden) times.go(f.stop);
    pick(element, { key: element.dataset.k, id: f.group, names: f.a ? [f.a, f.b] : null, through: BAD.includes(f.verdict) }, f.low, f.high);
    if (innerWidth <= 760) $("stage").scrollIntoView({ block: "start" });
  }
  function openRow(tr) {
    const r = times.rows().find((r) => r.a === tr.dataset.a && r.b === tr.dataset.b);
    const points = [r.point_a, r.point_b].filter((p) => p);
    const margin = 0.05 * Math.max(...story.frame.high.map((x, i) => x - story.frame.low[i]));
    const corner = (pick, sign) => [0, 1, 2].map((i) => pick(...points.map((p) => p[i])) + sign * margin);
    const [low, high] = points.length ? [corner(Math.min, -1), corner(Math.max, 1)] : [story.frame.low, story.frame.high];
    times.curve(null);
    pick(tr, { key: "", names: [r.a, r.b], through: BAD.includes(r.verdict) }, low, high);
  }
  function clear() { identify(""); $("search") && ($("search").value = ""); filter(); measure.clear(); times.curve(null); pick(null, null); }
  $("story").addEventListener("click", (e) => {
    const part = e.target.closest(".part"), finding = e.target.closest(".finding"), row = e.target.closest(".rows tr[data-a]");
    if (part && part.classList.contains("now")) clear();
    else if (finding) open(finding);
    else if (row) openRow(row);
    else if (part) { identify(part.dataset.part); change("isolate"); }
  });
  $("story").addEventListener("input", (e) => { if (e.target.id === "search") filter(); });
  $("home").addEventListener("click", clear);

  const times = timeLine($, () => story, animator, ask, follow);
  // The next or the previous finding that the list shows.
  function step(by) {
    const all = [...document.querySelectorAll("#findings .finding")].filter((e) => e.offsetParent);
    const next = all[(all.findIndex((e) => e.classList.contains("now")) + by + all.length + (by < 0 && !picked ? 1 : 0)) % all.length];
    if (next) { open(next); next.scrollIntoView({ block: "nearest" }); }
  }
  const KEYS = {
    Escape: clear, h: clear, n: () => step(1), p: () => step(-1), m: () => $("measure").click(),
    i: () => identified && change("isolate"), g: () => identified && change("ghost"), x: () => identified && change("hide"),
    "/": () => $("search") && $("search").focus(), ArrowRight: times.next, ArrowLeft: times.back, " ": times.toggle,
  };
  document.addEventListener("keydown", (e) => {
    const typing = e.target.tagName === "INPUT" && e.target.type !== "checkbox" || e.target.tagName === "SELECT";
    if (e.ctrlKey || e.metaKey || e.altKey || typing && e.key !== "Escape") return;
    if (e.key === " " && ["BUTTON", "INPUT", "SUMMARY"].includes(e.target.tagName)) return;
    if (KEYS[e.key]) { KEYS[e.key](); e.preventDefault(); }
  });

  // Another state of the story: what was picked, typed and opened stays.
  function showStory(data) {
    const first = !story, search = $("search") ? { text: $("search").value, focus: document.activeElement === $("search") } : {};
    const opened = [...document.querySelectorAll("details.members[open]")].map((e) => e.dataset.id);
    story = data;
    $("story").innerHTML = story.panel;
    document.title = story.title + " - clamp3d";
    viewer.renderer.domElement.setAttribute("aria-label", "3D view of " + story.title + ". All that it shows is listed beside it.");
    addSwitches();
    if (search.text && $("search")) $("search").value = search.text;
    if (search.focus && $("search")) $("search").focus();
    for (const e of document.querySelectorAll("details.members")) e.open = opened.includes(e.dataset.id);
    section.reset(story.frame.low, story.frame.high, first && story.uncut ? "Y" : null);
    times.reset();
    showSprite("caption", false);  // the panel says it; the caption is for meshcat's own page
    const now = picked && picked.id && [...document.querySelectorAll(".finding")].find((e) => e.dataset.id === picked.id);
    if (now) mark(now, true);
    filter();
    setTimeout(() => {
      viewer.set_3d_pane_size();
      if (picked) return highlight();
      if (touched) return;
      home(0, true);
      const worst = document.querySelector(".finding");
      // The worst clash is what a reviewer comes for; where the motions are about to play, they stop at theirs.
      const still = story.done && (story.stops.length === 1 || calm());
      if (!openAddress() && still && worst && BAD.includes(story.findings[0].verdict)) open(worst);
    }, 30);
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
    else if (command.type === "set_story") showStory(command.value);
    else handle(command);
    if (command.type === "set_animation" && calm()) animator.pause();  // it waits for the button (WCAG 2.2.2)
    if (command.type === "set_property" && command.property === "visible") {
      // A switch that the user has set outlasts what the program sends.
      for (const s of Object.values(switches)) if (s.touched) s.apply();
    }
  };
  const add = (news) => { for (const m of news) viewer.handle_command_bytearray(Uint8Array.from(atob(m), (c) => c.charCodeAt(0))); };
  // A served page asks for what is new until the result is there.
  async function listen() {
    for (let since = 0; !story || !story.done;) {
      const news = await (await fetch("commands?since=" + since)).json();
      add(news.messages);
      since = news.count;
    }
  }
  add(messages);
  if (served) listen().catch(() => {});  // the program has ended
}
