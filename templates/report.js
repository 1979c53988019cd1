"use strict";
// Zoom and read-out of the time histories. The figure is complete without it; nothing is fetched.
(function () {
  const figure = document.querySelector("figure.interactive");
  const svg = figure && figure.querySelector("svg");
  const data = JSON.parse(document.getElementById("traces").textContent || "null");
  if (!svg || !data) return;
  const NS = "http://www.w3.org/2000/svg";
  const prefix = "histories-";
  const controls = figure.querySelector(".controls");
  const region = figure.querySelector(".drawing");
  const readout = document.getElementById("readout");
  const select = document.getElementById("span");

  function make(name, attributes, parent) {
    const element = document.createElementNS(NS, name);
    for (const key in attributes) element.setAttribute(key, attributes[key]);
    if (parent) parent.appendChild(element);
    return element;
  }

  // Panels: their boxes from the clip paths of what moves; each moving group keeps its clip outside of its movement.
  const moving = [], curves = [];
  let left = 0, right = 0, top = Infinity, bottom = 0;
  for (const group of svg.querySelectorAll('[id^="histories-trace-"],[id^="histories-span-"],[id^="histories-edge-"]')) {
    const clip = group.querySelector("[clip-path]");
    if (!clip) continue;
    const id = clip.getAttribute("clip-path").slice(5, -1);
    const box = svg.getElementById(id).querySelector("rect");
    const [x, y, w, h] = ["x", "y", "width", "height"].map((name) => parseFloat(box.getAttribute(name)));
    left = x; right = x + w; top = Math.min(top, y); bottom = Math.max(bottom, y + h);
    const frame = make("g", { "clip-path": "url(#" + id + ")" });
    group.parentNode.insertBefore(frame, group);
    frame.appendChild(group);
    for (const child of group.querySelectorAll("[clip-path]")) child.removeAttribute("clip-path");
    group.classList.add("moving");
    moving.push(group);
    const [, kind, panel, line] = group.id.match(/(trace|span)-(\d+)(?:-(\d+))?$/) || [];
    if (kind) curves.push({ kind, panel: +panel, line: +line, path: group.querySelector("path"), box: [x, y, w, h] });
  }
  if (!moving.length) return;
  const fixed = svg.querySelectorAll('[id^="histories-xaxis-"]');
  const upright = make("g", {}, svg);
  svg.querySelector("#histories-axes_1, g").before(upright);
  const layer = make("g", {}, svg);
  const over = make("g", {}, svg);
  const about = document.createElement("p");
  about.className = "hint";
  readout.after(about);
  const cursor = make("line", { class: "cursor", y1: top, y2: bottom, visibility: "hidden" }, over);
  const brush = make("rect", { class: "brush", y: top, height: bottom - top, visibility: "hidden" }, over);

  let [first, last] = data.span;
  let from = first, to = last, at = null;
  const place = (t) => left + ((t - from) / (to - from)) * (right - left);
  const time = (x) => from + ((x - left) / (right - left)) * (to - from);

  function show(a, b) {
    const least = (last - first) * 1e-4;
    const width = Math.min(Math.max(b - a, least), last - first);
    from = Math.min(Math.max(a, first), last - width);
    to = from + width;
    const k = (last - first) / width;
    const shift = left - k * (left + ((from - first) / (last - first)) * (right - left));
    for (const group of moving) group.setAttribute("transform", "matrix(" + k + " 0 0 1 " + shift + " 0)");
    const whole = k < 1.0001;
    for (const axis of fixed) axis.style.display = whole && !data.sets ? "" : "none";
    layer.replaceChildren();
    if (!whole || data.sets) ticks();
    for (const button of controls.querySelectorAll("button")) {
      const does = button.dataset.do;
      button.disabled = (whole && does !== "in") || (does === "left" && from <= first) || (does === "right" && to >= last);
    }
    if (at !== null) point(Math.min(Math.max(at, from), to));
  }

  // Round spacing of about so many ticks over a range, and the decimals that it needs.
  function spacing(range, count) {
    const raw = range / count, base = Math.pow(10, Math.floor(Math.log10(raw)));
    const step = base * ([1, 2, 5, 10].find((m) => m * base >= raw) || 10);
    return [step, Math.max(0, -Math.floor(Math.log10(step) + 1e-9))];
  }

  function ticks() {
    const [step, digits] = spacing(to - from, 7);
    for (let n = Math.ceil(from / step); n * step <= to; n++) {
      const x = place(n * step);
      make("line", { class: "tick-line", x1: x, x2: x, y1: top, y2: bottom }, layer);
      make("text", { class: "tick-text", x: x, y: bottom + 12 }, layer).textContent = (n * step).toFixed(digits);
    }
    make("text", { class: "tick-text", x: (left + right) / 2, y: bottom + 24 }, layer).textContent = data.label;
  }

  // Cycles to choose from: their curves take the place of those drawn, with vertical axes of their own.
  function decoded(packed) {
    return packed.values.map((text) => {
      const bytes = atob(text), out = [];
      for (let k = 0; k < bytes.length; k += 2) {
        const share = (bytes.charCodeAt(k) + 256 * bytes.charCodeAt(k + 1)) / 65535;
        out.push(packed.low + (packed.high - packed.low) * share);
      }
      return out;
    });
  }

  function choose(number) {
    const set = data.sets[number];
    data.times = decoded(set.times)[0];
    const sides = set.traces.map((packed) => packed && decoded(packed));
    data.traces = [];
    sides.forEach((xs, k) => { if (xs) data.traces.push({ ...data.panels[k], xs }); });
    [first, last] = [data.times[0], data.times[data.times.length - 1]];
    [from, to] = [first, last];
    upright.replaceChildren();
    const ranges = {};
    for (const { kind, panel, line, path, box } of curves) {
      const xs = sides[panel >> 1], residual = panel % 2;
      if (kind === "span") {
        const [a, b] = set.payout.map(place), [y, h] = [box[1], box[3]];
        path.setAttribute("d", "M" + a + " " + y + "H" + b + "V" + (y + h) + "H" + a + "Z");
        continue;
      }
      if (!xs || !xs[line]) { path.setAttribute("d", ""); continue; }
      const shown = (k) => (residual ? xs[0].map((value, n) => value - xs[k][n]) : xs[k]);
      if (!ranges[panel]) {
        const all = residual ? [0].concat(...xs.slice(1).map((_, k) => shown(k + 1))) : [].concat(...xs);
        const low = all.reduce((a, b) => Math.min(a, b)), high = all.reduce((a, b) => Math.max(a, b));
        const pad = 0.05 * (high - low || 1);
        ranges[panel] = [low - pad, high + pad];
        levels(box, ranges[panel]);
        const zero = svg.getElementById(prefix + "zero-" + panel);
        if (zero) zero.querySelector("path").setAttribute("d", "M" + left + " " + height(0, box, ranges[panel]) + "H" + right);
      }
      const range = ranges[panel];
      path.setAttribute("d", "M" + shown(line).map((value, n) =>
        place(data.times[n]).toFixed(2) + " " + height(value, box, range).toFixed(2)).join("L"));
    }
    about.textContent = set.note;
    at = null;
    show(first, last);
  }

  const height = (value, [, y, , h], [low, high]) => y + h - ((value - low) / (high - low)) * h;

  function levels(box, range) {
    const [step, digits] = spacing(range[1] - range[0], box[3] > 50 ? 5 : 4);
    for (let n = Math.ceil(range[0] / step); n * step <= range[1]; n++) {
      const y = height(n * step, box, range);
      make("line", { class: "tick-line", x1: left, x2: right, y1: y, y2: y }, upright);
      const text = make("text", { class: "tick-text level", x: left - 5, y: y + 2.5 }, upright);
      text.textContent = (n * step).toFixed(digits);
    }
  }

  // Text of a trace at an instant: between two samples, or the range of a stretch of a long log.
  function value(trace, t) {
    const times = data.times;
    let low = 0, high = times.length;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= t) low = middle; else high = middle;
    }
    if (trace.low) {
      const [a, b] = [trace.low[low], trace.high[low]];
      return (a === b ? String(a) : a + " to " + b) + " " + trace.unit;
    }
    const next = Math.min(low + 1, times.length - 1);
    const share = next > low ? Math.min(Math.max((t - times[low]) / (times[next] - times[low]), 0), 1) : 0;
    const between = (x) => Number((x[low] + share * (x[next] - x[low])).toPrecision(4));
    return (trace.xs || [trace.x]).map(between).join(" | ") + " " + trace.unit;
  }

  function point(t) {
    at = t;
    const x = place(t);
    cursor.setAttribute("x1", x); cursor.setAttribute("x2", x); cursor.setAttribute("visibility", "visible");
    readout.replaceChildren();
    const parts = [["t", t.toFixed(2) + " s"]];
    for (const trace of data.traces) parts.push([trace.name, value(trace, t)]);
    parts.forEach(([name, text], k) => {
      const strong = document.createElement("b");
      strong.textContent = text;
      readout.append((k ? " · " : "") + name + " ", strong);
    });
  }

  function svgX(event) {
    const box = svg.getBoundingClientRect();
    const view = svg.viewBox.baseVal;
    return Math.min(Math.max(view.x + ((event.clientX - box.left) / box.width) * view.width, left), right);
  }

  const unselect = () => { if (!data.sets) select.value = ""; };
  let started = null;
  svg.addEventListener("pointermove", (event) => {
    const x = svgX(event);
    readout.setAttribute("aria-live", "off");
    point(time(x));
    if (started !== null) {
      brush.setAttribute("x", Math.min(x, started)); brush.setAttribute("width", Math.abs(x - started));
      brush.setAttribute("visibility", Math.abs(x - started) > 4 ? "visible" : "hidden");
    }
  });
  svg.addEventListener("pointerdown", (event) => { if (event.button === 0 && event.pointerType === "mouse") started = svgX(event); });
  window.addEventListener("pointerup", (event) => {
    if (started === null) return;
    const x = svgX(event), a = time(Math.min(x, started)), b = time(Math.max(x, started));
    const enough = Math.abs(x - started) > 4;
    started = null;
    brush.setAttribute("visibility", "hidden");
    if (enough) { unselect(); show(a, b); }
  });
  svg.addEventListener("dblclick", () => { unselect(); show(first, last); });

  const act = {
    in: () => zoom(0.5), out: () => zoom(2),
    left: () => show(from - (to - from) / 2, from + (to - from) / 2),
    right: () => show(from + (to - from) / 2, to + (to - from) / 2),
  };
  function zoom(factor) {
    const centre = at !== null && at >= from && at <= to ? at : (from + to) / 2;
    const a = centre - (centre - from) * factor;
    show(a, a + (to - from) * factor);
  }
  controls.addEventListener("click", (event) => { const does = event.target.dataset && event.target.dataset.do; if (does) act[does](); });
  (data.sets || []).forEach((set, k) => {
    if (!k) select.replaceChildren();
    const option = document.createElement("option");
    option.value = k; option.textContent = set.name;
    select.append(option);
  });
  for (const [number, a, b] of data.cycles) {
    const option = document.createElement("option");
    option.value = a + " " + b; option.textContent = "cycle " + number;
    select.append(option);
  }
  select.addEventListener("change", () => {
    if (data.sets) { choose(Number(select.value)); return; }
    const ends = select.value.split(" ").map(Number);
    if (select.value) show(ends[0], ends[1]); else show(first, last);
  });
  region.addEventListener("keydown", (event) => {
    const step = (to - from) / (event.shiftKey ? 20 : 200);
    const moves = { ArrowLeft: -step, ArrowRight: step };
    if (event.key in moves) {
      readout.setAttribute("aria-live", "polite");
      point(Math.min(Math.max((at === null ? from : at) + moves[event.key], from), to));
    } else if (event.key === "+" || event.key === "=") act.in();
    else if (event.key === "-") act.out();
    else if (event.key === "Home") show(first, last);
    else return;
    event.preventDefault();
  });
  region.setAttribute("aria-label", "Time histories; arrow keys move the cursor, plus and minus zoom, Home shows all");
  window.addEventListener("beforeprint", () => { unselect(); show(first, last); });
  controls.hidden = false;
  if (data.sets) {
    for (const axis of svg.querySelectorAll('[id^="histories-yaxis-"]')) for (const part of axis.querySelectorAll('[id*="tick"]')) part.remove();
    select.value = data.first; choose(data.first);
  } else show(first, last);
})();
