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
  const moving = [];
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
  }
  if (!moving.length) return;
  const fixed = svg.querySelectorAll('[id^="histories-xaxis-"]');
  const layer = make("g", {}, svg);
  const over = make("g", {}, svg);
  const cursor = make("line", { class: "cursor", y1: top, y2: bottom, visibility: "hidden" }, over);
  const brush = make("rect", { class: "brush", y: top, height: bottom - top, visibility: "hidden" }, over);

  const [first, last] = data.span;
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
    for (const axis of fixed) axis.style.display = whole ? "" : "none";
    layer.replaceChildren();
    if (!whole) ticks();
    for (const button of controls.querySelectorAll("button")) {
      const does = button.dataset.do;
      button.disabled = (whole && does !== "in") || (does === "left" && from <= first) || (does === "right" && to >= last);
    }
    if (at !== null) point(Math.min(Math.max(at, from), to));
  }

  function ticks() {
    const raw = (to - from) / 7, base = Math.pow(10, Math.floor(Math.log10(raw)));
    const step = base * ([1, 2, 5, 10].find((m) => m * base >= raw) || 10);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    for (let n = Math.ceil(from / step); n * step <= to; n++) {
      const x = place(n * step);
      make("line", { class: "tick-line", x1: x, x2: x, y1: top, y2: bottom }, layer);
      make("text", { class: "tick-text", x: x, y: bottom + 12 }, layer).textContent = (n * step).toFixed(digits);
    }
    make("text", { class: "tick-text", x: (left + right) / 2, y: bottom + 24 }, layer).textContent = data.label;
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
    return Number((trace.x[low] + share * (trace.x[next] - trace.x[low])).toPrecision(4)) + " " + trace.unit;
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
    if (enough) { select.value = ""; show(a, b); }
  });
  svg.addEventListener("dblclick", () => { select.value = ""; show(first, last); });

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
  for (const [number, a, b] of data.cycles) {
    const option = document.createElement("option");
    option.value = a + " " + b; option.textContent = "cycle " + number;
    select.append(option);
  }
  select.addEventListener("change", () => {
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
  window.addEventListener("beforeprint", () => { select.value = ""; show(first, last); });
  controls.hidden = false;
  show(first, last);
})();
