"use strict";
// Panel and time line around meshcat's viewer. What they show comes as userData of the node /clamp3d.
function clamp3dViewer(messages) {
  const $ = (id) => document.getElementById(id);
  const viewer = new MeshCat.Viewer($("meshcat-pane"));
  window.viewer = viewer;
  const animator = viewer.animator;
  let data = null;
  let stop = -1;

  // Unlike scene_tree.find, this makes no node that is not there.
  const node = (path) => path.split("/").filter((x) => x).reduce((n, name) => n && n.children[name], viewer.scene_tree);
  const show = (path, on) => {
    const n = node(path);
    if (n) { n.set_property("visible", on); viewer.set_dirty(); }
  };

  const switches = {};
  function addSwitch(name, label, on, set) {
    if (switches[name]) return;
    const box = document.createElement("input");
    box.type = "checkbox";
    box.id = "switch-" + name.replace(/\W+/g, "-");
    box.checked = on;
    const text = document.createElement("label");
    text.append(box, " " + label);
    $("switches").append(text);
    const own = { touched: false, apply: () => set(box.checked) };
    switches[name] = own;
    box.addEventListener("change", () => { own.touched = true; own.apply(); });
  }
  addSwitch("cutaway", "cutaway", true, (on) => { show("/clamp3d/cutaway", on); show("/clamp3d/whole", !on); });
  addSwitch("labels", "labels", true, (on) => show("/clamp3d/labels", on));
  addSwitch("contacts", "contacts", true, (on) => show("/clamp3d/contacts", on));
  addSwitch("gaps", "gaps", true, (on) => show("/clamp3d/gaps", on));

  function list(id, items, row) {
    $(id).replaceChildren(...items.map(row));
  }
  function legend(item, text, label) {
    const li = document.createElement("li");
    const chip = document.createElement("span");
    chip.className = "chip";
    chip.style.background = item.colour;
    chip.textContent = label;
    const words = document.createElement("span");
    words.textContent = text;
    li.append(chip, words);
    return li;
  }
  const plain = (text) => { const li = document.createElement("li"); li.textContent = text; return li; };

  function tell(told) {
    data = told;
    $("title").textContent = data.title;
    $("wires").textContent = data.wires;
    $("status").textContent = data.status;
    document.title = data.title + " - clamp3d";
    list("facts", data.facts, plain);
    list("parts", data.parts, (p) => legend(p, p.title, p.name));
    list("verdicts", data.verdicts, (v) => legend(v, v.name + ": " + v.meaning, "\u00a0"));
    $("accuracy").textContent = [data.accuracy, ...data.limits].join("; ") + ".";
    for (const o of data.overlays) addSwitch("overlay " + o.name, o.name, false, (on) => show(o.path, on));
    $("timeline").hidden = !(data.done && data.stops.length);
    list("marks", data.done ? data.stops : [], mark);
    stop = -1;
    if (!data.done && data.stops.length) rows(data.stops[data.stops.length - 1]);
    // The panel says it already; the caption is for meshcat's own page.
    viewer.scene_tree.find(["clamp3d", "caption"]).set_property("visible", false);
  }

  function mark(s, i) {
    const a = document.createElement("a");
    a.textContent = s.step === (data.stops[i - 1] || {}).step ? "" : s.step;
    a.title = s.step + ": " + s.label;
    a.style.left = 100 * s.arrive / end() + "%";
    a.addEventListener("click", () => go(i));
    return a;
  }
  const end = () => data.stops[data.stops.length - 1].leave;

  function rows(s) {
    const colour = Object.fromEntries(data.verdicts.map((v) => [v.name, v.colour]));
    $("rows").tBodies[0].replaceChildren(...s.rows.map((r) => {
      const tr = document.createElement("tr");
      for (const [text, name] of [["\u00a0", "chip"], [r.pair, ""], [r.what, ""], [r.gap, "gap"]]) {
        const td = document.createElement("td");
        if (name === "chip") {
          const chip = document.createElement("span");
          chip.className = "chip";
          chip.style.background = colour[r.verdict];
          chip.title = r.verdict;
          chip.textContent = text;
          td.append(chip);
        } else {
          td.className = name;
          td.textContent = text;
        }
        tr.append(td);
      }
      return tr;
    }));
  }

  function seek(t) {
    animator.pause();
    animator.seek(t);
    animator.display_progress(t);
    refresh();
  }
  function go(i) {
    // A moment later: three.js keeps key times as 32-bit floats, so the exact time may count as before.
    seek(data.stops[Math.max(0, Math.min(data.stops.length - 1, i))].arrive + 0.005);
  }
  function current(t) {
    let i = 0;
    while (i + 1 < data.stops.length && data.stops[i + 1].arrive <= t + 1e-6) i++;
    return i;
  }
  function toggle() {
    if (animator.playing) animator.pause();
    else {
      if (animator.time >= end() - 1e-3) animator.reset();
      animator.play();
    }
    refresh();
  }

  function refresh() {
    if (!data || !data.done || !data.stops.length) return;
    const t = animator.time;
    const i = current(t);
    const s = data.stops[i];
    const next = data.stops[i + 1];
    $("time").max = end();
    if (document.activeElement !== $("time") || animator.playing) $("time").value = t;
    $("play").firstElementChild.firstElementChild.setAttribute("d", animator.playing ? "M3 2h4v12H3zM9 2h4v12H9z" : "M3 1l11 7-11 7z");
    const moving = next && t > s.leave + 1e-6;
    const at = moving ? next : s;
    $("label").textContent = (data.stops.indexOf(at) + 1) + "/" + data.stops.length + "  " + (moving ? "on the way: " : "") + at.label;
    $("step").textContent = "step " + at.step;
    if (i !== stop) {
      stop = i;
      rows(s);
      [...$("marks").children].forEach((a, k) => a.classList.toggle("now", k === i));
    }
  }
  (function frame() { refresh(); requestAnimationFrame(frame); })();

  $("time").addEventListener("input", () => seek(Number($("time").value)));
  $("play").addEventListener("click", toggle);
  $("back").addEventListener("click", () => go(animator.time > data.stops[current(animator.time)].arrive + 0.05 ? current(animator.time) : current(animator.time) - 1));
  $("forward").addEventListener("click", () => go(current(animator.time) + 1));
  document.addEventListener("keydown", (e) => {
    if ($("timeline").hidden || e.target.tagName === "INPUT" && e.target.type !== "checkbox") return;
    if (e.key === "ArrowRight") $("forward").click();
    else if (e.key === "ArrowLeft") $("back").click();
    else if (e.key === " " && e.target.tagName !== "BUTTON" && e.target.tagName !== "INPUT") { toggle(); e.preventDefault(); }
  });

  const handle = viewer.handle_command.bind(viewer);
  viewer.handle_command = (command) => {
    handle(command);
    if (command.type === "set_property" && command.property === "userData" && command.path === "/clamp3d") tell(command.value);
    else if (command.type === "set_property" && command.property === "visible") {
      // A switch that the user has set outlasts what the program sends.
      for (const s of Object.values(switches)) if (s.touched) s.apply();
    }
  };

  if (messages.length) {
    for (const m of messages) viewer.handle_command_bytearray(Uint8Array.from(atob(m), (c) => c.charCodeAt(0)));
  } else {
    viewer.connect("ws://" + location.host + "/scene");
    viewer.connection.onclose = () => { $("status").textContent = (data ? data.status + " \u2014 " : "") + "the program has ended; this picture stays"; };
  }
}
