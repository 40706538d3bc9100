"use strict";
// The time line: stops, play, "at this moment", and the distance curve of a finding. `story()` is what the page shows,
// `ask` measures pairs at a moment (null on a saved page), `follow` moves the camera along.
function timeLine($, story, animator, ask, follow) {
  let shown = -1, before = 0, played = false, live = null, asking = false;
  const end = () => story().stops[story().stops.length - 1].leave;
  const hidden = () => $("timeline").hidden;

  function stopAt(t) {
    let i = 0;
    while (i + 1 < story().stops.length && story().stops[i + 1].arrive <= t + 1e-6) i++;
    return i;
  }
  // The motion's own time, from 0 to 1, at a moment of the time line.
  function motionTime(seconds) {
    const i = stopAt(seconds), s = story().stops[i], next = story().stops[i + 1];
    if (!next || seconds <= s.leave) return s.t;
    const t0 = next.step === s.step ? s.t : 0;
    return t0 + (next.t - t0) * (seconds - s.leave) / (next.arrive - s.leave);
  }
  function mark(s, i) {
    const a = document.createElement("button");
    a.textContent = s.mark && s.mark === (story().stops[i - 1] || {}).mark ? "" : s.mark;
    a.title = s.label;
    a.setAttribute("aria-label", s.label);
    a.classList.toggle("halts", s.halts);
    a.classList.toggle("end", s.arrive > 0.92 * end());
    a.style.left = 100 * s.arrive / end() + "%";
    a.addEventListener("click", () => go(i));
    return a;
  }
  function seek(t) {
    animator.pause();
    played = false;
    animator.seek(t);
    animator.display_progress(t);
    before = t;
    refresh();
  }
  function go(i) {
    // A moment later: three.js keeps key times as 32-bit floats, so the exact time may count as before.
    seek(story().stops[Math.max(0, Math.min(story().stops.length - 1, i))].arrive + 0.005);
  }
  function toggle() {
    if (hidden()) return;
    if (animator.playing) animator.pause();
    else {
      if (animator.time >= end() - 1e-3) { animator.reset(); before = 0; }
      animator.play();
    }
    refresh();
  }
  const next = () => { if (!hidden()) go(stopAt(animator.time) + 1); };
  function back() {
    if (hidden()) return;
    const i = stopAt(animator.time);
    go(animator.time > story().stops[i].arrive + 0.05 ? i : i - 1);
  }

  // At this moment: the rows of a stop; between stops those that the program measures there, as quickly as it can.
  function showMoment(i, moving) {
    const is = moving ? -1 : i;
    if (is !== shown) {
      shown = is;
      for (const e of document.querySelectorAll(".stop")) e.hidden = Number(e.dataset.stop) !== is;
      [...$("marks").children].forEach((a, k) => { a.classList.toggle("now", k === i); });
      uncover(i);
      if ($("now")) $("now").hidden = !moving;
      live = null;
      if (moving) say("Distances are listed at the stops; a page served by clamp3d view measures them all the way.");
    }
    if (moving && !asking && !(live && live.seconds === animator.time)) measureNow(animator.time);
  }
  // The name of the stop that is shown stands; of the others those that it and each other leave free.
  function uncover(i) {
    const marks = [...$("marks").children], free = [];
    marks.forEach((a) => a.classList.remove("covered"));
    for (const a of marks[i] ? [marks[i], ...marks] : marks) {
      const box = a.getBoundingClientRect();
      const covered = free.some(([b, other]) => a !== b && box.left < other.right && other.left < box.right);
      a.classList.toggle("covered", covered);
      if (!covered && a.textContent) free.push([a, box]);
    }
  }
  async function measureNow(seconds) {
    asking = true;
    const rows = await ask({ time: seconds });
    asking = false;
    if (!rows || shown !== -1) return;
    live = { seconds, rows };
    say("");
    $("now").append(listed(rows));
    $("now").firstElementChild.textContent = `measured at t = ${motionTime(seconds).toFixed(3)} of this motion`;
  }
  function say(text) {
    const p = document.createElement("p");
    p.className = "small";
    p.textContent = text;
    if ($("now")) $("now").replaceChildren(p);
  }
  function listed(rows) {
    const table = document.createElement("table");
    table.className = "rows";
    for (const r of rows) {
      const tr = table.insertRow(), chip = tr.insertCell().appendChild(document.createElement("span"));
      Object.assign(tr.dataset, { a: r.a, b: r.b });
      chip.className = "chip";
      chip.style.background = r.colour;
      chip.title = r.verdict;
      const pair = tr.insertCell().appendChild(document.createElement("button"));
      pair.className = "pair";
      pair.textContent = r.a + "\u2013" + r.b;
      tr.insertCell().textContent = r.gap;
    }
    return table;
  }

  // The distance of a picked finding while its motion plays: a band between its bounds, a line at 0 mm. A saved page
  // holds the curves of the worst findings; a served one asks for each of its moments.
  let curve = null;
  async function setCurve(finding) {
    const k = finding ? story().findings.indexOf(finding) : -1, own = finding ? finding.moments : [];
    const bounds = (story().curves || {})[k], mine = curve = own.length ? { finding, seconds: own.slice(0, bounds ? own.length : 0), bounds: bounds || [] } : null;
    drawCurve();
    if (!mine || bounds) return;
    for (const seconds of own) {
      const rows = await ask({ time: seconds, a: finding.a, b: finding.b });
      if (curve !== mine) return;
      if (!rows) break;
      mine.seconds.push(seconds);
      mine.bounds.push([rows[0].at_least_mm, rows[0].at_most_mm]);
      drawCurve();
    }
  }
  function drawCurve() {
    $("curve").hidden = !curve || !curve.bounds.length;
    if ($("curve").hidden) return;
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
    const text = `distance of ${curve.finding.a} and ${curve.finding.b} at t = ${motionTime(curve.seconds[i]).toFixed(3)}: `
      + (lower === null ? "at most " : (Math.floor(lower * 1e4) / 1e4).toFixed(4) + " to ") + (Math.ceil(upper * 1e4) / 1e4).toFixed(4) + " mm";
    write($("curve").lastElementChild, "", text);
    write($("curve").firstElementChild, "aria-label", text);
  }

  // An attribute, or the text, where it is another: what is written is laid out and painted again, in each frame.
  function write(element, name, value) {
    if (!name && element.textContent !== value) element.textContent = value;
    else if (name && element.getAttribute(name) !== value) element.setAttribute(name, value);
  }
  function refresh() {
    if (!story() || !story().done || hidden()) return;
    const t = animator.time, stops = story().stops;
    if (animator.playing || played) {  // it may have come to the end since the last frame
      const halt = stops.find((s) => s.halts && before < s.arrive && s.arrive <= t);
      if (halt) return seek(halt.arrive + 0.005);
      before = t;
    }
    played = animator.playing;
    const i = stopAt(t), s = stops[i], moving = Boolean(stops[i + 1]) && t > s.leave + 1e-6, at = moving ? stops[i + 1] : s;
    const label = (stops.indexOf(at) + 1) + "/" + stops.length + "  " + (moving ? "moving to: " : "") + at.label;
    write($("time"), "max", String(end()));
    write($("time"), "aria-valuetext", label);
    if (document.activeElement !== $("time") || animator.playing) $("time").value = t;
    write($("play").firstElementChild.firstElementChild, "d", animator.playing ? "M3 2h4v12H3zM9 2h4v12H9z" : "M3 1l11 7-11 7z");
    write($("label"), "", label);
    write($("step"), "", at.label.startsWith(at.step) ? "" : "step " + at.step);
    showMoment(i, moving);
    if (curve && curve.bounds.length) sayCurve();
    follow();
  }
  (function frame() { refresh(); requestAnimationFrame(frame); })();
  $("time").addEventListener("input", () => seek(Number($("time").value)));
  $("play").addEventListener("click", toggle);
  $("back").addEventListener("click", back);
  $("forward").addEventListener("click", next);

  return {
    toggle, next, back, go,
    curve: setCurve,
    stop: () => Math.max(0, shown),
    rows: () => (shown < 0 && live ? live.rows : (story().stops[Math.max(0, shown)] || { rows: [] }).rows),
    // The stop, or both ends of the way that is playing; before the first stop, everything.
    around() {
      const stops = story().stops, i = stops.length ? stopAt(animator.time) : 0;
      if (!stops.length) return [story().frame];
      if (!story().done) return stops.slice(-1);
      return animator.playing && stops[i + 1] ? [stops[i], stops[i + 1]] : [stops[i]];
    },
    // The story has changed.
    reset() {
      const plays = story().done && story().stops.length > 1;
      $("timeline").hidden = !plays;
      $("marks").replaceChildren(...(plays ? story().stops.map(mark) : []));
      shown = -2;
      if (story().stops.length) showMoment(story().done ? stopAt(animator.time) : story().stops.length - 1, false);
      refresh();
    },
  };
}
