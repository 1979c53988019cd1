"use strict";
// Figures: read-out beside the pointer, zoom of both axes, series that are switched; histories with cycles to choose from.
// Every figure is complete without this script; nothing is fetched.
(function () {
  const NS = "http://www.w3.org/2000/svg";
  const NEAR = 28;  // a single point is read out within this distance of the pointer [px]
  const FINEST = 1e-4;  // narrowest zoom, as a share of an axis

  function make(name, attributes, parent) {
    const element = document.createElementNS(NS, name);
    for (const key in attributes) element.setAttribute(key, attributes[key]);
    if (parent) parent.appendChild(element);
    return element;
  }
  function html(name, attributes, parent, text) {
    const element = document.createElement(name);
    for (const key in attributes) element.setAttribute(key, attributes[key]);
    if (text) element.textContent = text;
    if (parent) parent.appendChild(element);
    return element;
  }
  const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
  const minus = (text) => text.replace("-", "\u2212");

  // A text with its symbols: E_line has a low "line".
  function symbols(text, parent) {
    for (const part of text.split(/([EPFvpητ]_[\w→]+)/)) {
      const [letter, low] = part.split("_");
      if (/^[EPFvpητ]_/.test(part)) { parent.append(letter); html("sub", {}, parent, low); } else parent.append(part);
    }
  }

  // ------------------------------------------------------------------------------------------------- numbers of an axis
  // Round spacing of about so many ticks over a range, and the decimals that it needs.
  function spacing(range, count) {
    const raw = range / count, base = Math.pow(10, Math.floor(Math.log10(raw)));
    const step = base * ([1, 2, 5, 10].find((m) => m * base >= raw) || 10);
    return [step, Math.max(0, -Math.floor(Math.log10(step) + 1e-9))];
  }
  const fixed = (value, decimals) => minus((Math.abs(value) < 0.5 * Math.pow(10, -decimals) ? 0 : value).toFixed(decimals));
  // A value with the digits that a five-hundredth of its axis needs.
  function rounded(value, range) {
    if (Math.abs(value) >= 1e6 || !(range > 0)) return minus(String(Number(value.toPrecision(4))));
    return fixed(value, clamp(Math.ceil(-Math.log10(range / 500) - 1e-9), 0, 8));
  }
  const to = (axis, value) => (axis.log ? Math.log10(value) : value);
  const back = (axis, value) => (axis.log ? Math.pow(10, value) : value);
  const [NAME, UNIT] = [1, 2];
  const labelled = (label) => label.match(/^(.*?),? ?\(([^()]*)\)$/) || [label, label, ""];
  const withUnit = (text, unit) => (unit && unit !== "1" ? text + "\u00a0" + unit : text);

  function tickValues(axis, length) {
    const [a, b] = axis.now, low = Math.min(a, b), high = Math.max(a, b), found = [];
    if (axis.texts) return axis.texts.map(([v, text]) => [to(axis, v), text]).filter(([v]) => v >= low && v <= high);
    if (axis.log && high - low > 1) {
      for (let n = Math.floor(low); n <= high; n++) for (const m of [1, 2, 5]) {
        const v = n + Math.log10(m);
        if (v >= low && v <= high) found.push([v, String(Number((m * Math.pow(10, n)).toPrecision(2)))]);
      }
      return found;
    }
    const [from, till] = axis.log ? [back(axis, low), back(axis, high)] : [low, high];
    const [step, decimals] = spacing(till - from, Math.max(2, Math.floor(length / (axis.upright ? 15 : 52))));
    for (let n = Math.ceil(from / step - 1e-9); n * step <= till + 1e-9 * step; n++) found.push([to(axis, n * step), fixed(n * step, decimals)]);
    return found;
  }

  // ------------------------------------------------------------------------------------------------------ the read-out
  const tip = html("div", { class: "tip", id: "readout", role: "status", "aria-live": "off", hidden: "" }, document.querySelector("main"));

  function showTip(head, rows, x, y) {
    tip.replaceChildren();
    if (head) symbols(head, html("p", {}, tip));
    const table = html("dl", {}, tip);
    for (const [name, text, near, colour] of rows) {
      const row = html("div", near ? { class: "near" } : {}, table);
      const key = html("dt", {}, row);
      if (colour) html("i", { style: "background:" + colour }, key);
      symbols(name, key);
      html("dd", {}, row, text);
    }
    tip.hidden = false;
    const { width, height } = tip.getBoundingClientRect();
    const left = x + 18 + width < innerWidth ? x + 18 : x - 18 - width;
    tip.style.left = clamp(left, 4, Math.max(4, innerWidth - width - 4)) + "px";
    tip.style.top = clamp(y - height / 2, 4, Math.max(4, innerHeight - height - 4)) + "px";
  }
  const hideTip = () => { tip.hidden = true; };
  addEventListener("scroll", hideTip, { passive: true });

  // -------------------------------------------------------------------------------------------------------- one figure
  function plot(figure) {
    const svg = figure.querySelector("svg"), region = figure.querySelector(".drawing");
    const marks = JSON.parse(figure.querySelector("script.marks").textContent);
    const prefix = figure.id.slice("figure-".length) + "-";
    const byId = (id) => svg.getElementById(prefix + id);
    const self = { figure, svg, region, byId, panels: null, source: null, at: null };
    let cursor = null, dot = null, brush = null;

    const series = marks.series.map((one) => ({ ...one, on: true }));
    const named = {};
    for (const one of series) for (const id of one.ids) (named[id] = named[id] || []).push(one);
    const visible = (id) => (named[id] || []).every((one) => one.on);

    function toggle(one) {
      one.on = !one.on;
      for (const id of one.ids) { const item = byId(id); if (item) item.style.display = visible(id) ? "" : "none"; }
      for (const id of one.keys) { const key = byId(id); if (key) key.style.opacity = one.on ? "" : "0.3"; }
      if (one.box) one.box.checked = one.on;
    }

    // Panels, their axes in the coordinates of their scales, and what moves with them; made when the figure is first used.
    function prepared() {
      if (self.panels) return self.panels;
      self.panels = marks.panels.map((panel, k) => {
        const [left, top, width, height] = panel.box;
        const axis = (given, upright) => {
          const ends = [to(given, given.low), to(given, given.high)], group = byId(given.id);
          const ticks = group ? [...group.querySelectorAll(':scope > [id*="tick"]')] : [];
          const text = ticks.map((tick) => tick.querySelector('g[transform*="scale("]')).find(Boolean);
          const above = !upright && text && text.getBoundingClientRect().bottom <= clientPoint(left, top + 1)[1];
          return { ...given, upright, ticks, above, shows: !!text, grid: ticks.some((tick) => tick.querySelector("[clip-path]")), base: ends, now: [...ends] };
        };
        return { ...panel, k, left, top, width, height, x: axis(panel.x, false), y: axis(panel.y, true), items: null, points: null };
      });
      const over = make("g", { class: "over" }, svg);
      cursor = make("line", { class: "cursor", visibility: "hidden" }, over);
      dot = make("circle", { class: "dot", r: 2.4, visibility: "hidden" }, over);
      brush = make("rect", { class: "brush", visibility: "hidden" }, over);
      return self.panels;
    }

    // Artists of a panel, each in a frame that keeps the panel's edges while what is in it moves.
    function itemsOf(panel) {
      if (panel.items) return panel.items;
      const clip = make("clipPath", { id: prefix + "edges-" + panel.k }, make("defs", {}, svg));
      make("rect", { x: panel.left, y: panel.top, width: panel.width, height: panel.height }, clip);
      const column = make("clipPath", { id: prefix + "column-" + panel.k }, clip.parentNode);  // of names above the panel
      make("rect", { x: panel.left, y: 0, width: panel.width, height: svg.viewBox.baseVal.height }, column);
      panel.items = [];
      for (const [ids, along] of [[panel.moved, "xy"], [panel.along_x, "x"], [panel.along_y, "y"]]) for (const id of ids || []) {
        const group = byId(id);
        if (!group) continue;
        const frame = make("g", {});
        const clipped = group.querySelectorAll("[clip-path]");
        group.before(frame);
        frame.append(group);
        for (const part of clipped) part.removeAttribute("clip-path");
        if (clipped.length) frame.setAttribute("clip-path", "url(#" + clip.id + ")");
        const text = group.querySelector('g[transform*="scale("]');
        panel.items.push({
          frame, group, along, text, always: clipped.length > 0,
          paths: text ? [] : [...group.querySelectorAll("path")].filter((path) => !path.closest("defs")),
          uses: text ? [] : [...group.querySelectorAll("use")].map((use) => [use, Number(use.getAttribute("x")), Number(use.getAttribute("y"))]),
          middle: null,
        });
      }
      const first = panel.items[0];
      panel.under = make("g", {});
      panel.axes = make("g", {}, svg);
      if (first) first.frame.before(panel.under); else svg.append(panel.under);
      return panel.items;
    }

    // Factor and shift from the positions that are drawn to those of the present limits.
    function movement(panel, axis) {
      const [b0, b1] = axis.base, [n0, n1] = axis.now, factor = (b1 - b0) / (n1 - n0), away = (b0 - n0) / (n1 - n0);
      if (!axis.upright) return [factor, panel.left * (1 - factor) + away * panel.width];
      const bottom = panel.top + panel.height;
      return [factor, bottom * (1 - factor) - away * panel.height];
    }
    const isWhole = (axis) => Math.abs(axis.now[0] - axis.base[0]) + Math.abs(axis.now[1] - axis.base[1]) < 1e-9 * Math.abs(axis.base[1] - axis.base[0]);

    function place(panel) {
      const whole = isWhole(panel.x) && isWhole(panel.y);
      if (whole && !panel.items) return;
      const items = itemsOf(panel), scale = svg.clientWidth / svg.viewBox.baseVal.width || 1;
      let [kx, dx] = movement(panel, panel.x), [ky, dy] = movement(panel, panel.y);
      for (const item of items) {
        const [a, b, c, d] = [item.along.includes("x") ? kx : 1, item.along.includes("x") ? dx : 0, item.along.includes("y") ? ky : 1, item.along.includes("y") ? dy : 0];
        if (!item.always) { if (whole) item.frame.removeAttribute("clip-path"); else item.frame.setAttribute("clip-path", "url(#" + prefix + (item.text && item.along === "x" ? "column-" : "edges-") + panel.k + ")"); }
        for (const path of item.paths) {
          if (whole) { path.removeAttribute("transform"); path.style.vectorEffect = ""; path.style.strokeWidth = path.dataset.wide || ""; path.style.strokeDasharray = path.dataset.dashes || ""; continue; }
          if (path.dataset.wide === undefined) { path.dataset.wide = path.style.strokeWidth; path.dataset.dashes = path.style.strokeDasharray; }
          const wide = parseFloat(path.dataset.wide || "1") * scale;
          path.setAttribute("transform", "matrix(" + a + " 0 0 " + c + " " + b + " " + d + ")");
          path.style.vectorEffect = "non-scaling-stroke";
          path.style.strokeWidth = wide + "px";
          const dashes = (path.dataset.dashes || "none").match(/[\d.]+/g);
          if (dashes) path.style.strokeDasharray = dashes.map((v) => v * scale).join(" ");
        }
        for (const [use, x, y] of item.uses) { use.setAttribute("x", a * x + b); use.setAttribute("y", c * y + d); }
        if (item.text) {
          if (!item.middle) { const box = item.group.getBBox(); item.middle = [box.x + box.width / 2, box.y + box.height / 2]; }
          const [x, y] = item.middle;
          item.group.setAttribute("transform", "translate(" + ((a - 1) * x + b) + " " + ((c - 1) * y + d) + ")");
        }
      }
      panel.under.replaceChildren();
      panel.axes.replaceChildren();
      for (const axis of [panel.x, panel.y]) {
        const drawn = isWhole(axis) && !axis.own;
        for (const tick of axis.ticks) tick.style.display = drawn ? "" : "none";
        if (!drawn) ticks(panel, axis);
      }
      if (panel.second) {
        const second = byId(panel.second.id), share = (panel.second.high - panel.second.low) / (panel.x.base[1] - panel.x.base[0]);
        if (second) for (const tick of second.querySelectorAll('[id*="tick"]')) tick.style.display = isWhole(panel.x) ? "" : "none";
        const now = panel.x.now.map((v) => panel.second.low + (v - panel.x.base[0]) * share);
        if (!isWhole(panel.x)) ticks(panel, { now, shows: true, above: true });
      }
    }

    function ticks(panel, axis) {
      const { left, top, width, height } = panel, [a, b] = axis.now;
      for (const [v, text] of tickValues(axis, axis.upright ? height : width)) {
        const share = (v - a) / (b - a);
        if (axis.upright) {
          const y = top + height * (1 - share);
          if (axis.grid) make("line", { class: "tick-line", x1: left, x2: left + width, y1: y, y2: y }, panel.under);
          if (axis.shows) make("text", { class: "tick-text level", x: left - 4.5, y: y + 2.6 }, panel.axes).textContent = text;
        } else {
          const x = left + width * share;
          if (axis.grid) make("line", { class: "tick-line", x1: x, x2: x, y1: top, y2: top + height }, panel.under);
          if (axis.shows) make("text", { class: "tick-text", x, y: axis.above ? top - 4.5 : top + height + 11 }, panel.axes).textContent = text;
        }
      }
    }

    // Limits of an axis of a panel and of those that share it, within what is drawn.
    function limit(panel, which, a, b) {
      const axis = panel[which], [low, high] = axis.base, whole = high - low, least = Math.abs(whole) * FINEST;
      let width = b - a;
      if (Math.abs(width) < least) { const middle = (a + b) / 2; width = Math.sign(whole) * least; a = middle - width / 2; }
      if (Math.abs(width) >= Math.abs(whole)) { a = low; width = whole; }
      const far = [low, high - width].sort((p, q) => p - q);
      a = clamp(a, far[0], far[1]);
      for (const other of prepared()) if (other[which].shared === axis.shared) other[which].now = [a, a + width];
    }
    function refresh() {
      for (const panel of prepared()) place(panel);
      const whole = prepared().every((panel) => isWhole(panel.x) && isWhole(panel.y));
      figure.classList.toggle("zoomed", !whole);
      for (const button of figure.querySelectorAll("[data-do=all]")) button.hidden = whole;
      mark(null);
      if (self.zoomed) self.zoomed(whole);
    }
    function all() {
      for (const panel of prepared()) for (const which of ["x", "y"]) panel[which].now = [...panel[which].base];
      refresh();
    }
    // Zoom of one axis by a factor about a share of it.
    function scale(panel, which, factor, share) {
      const [a, b] = panel[which].now, at = a + (b - a) * share;
      limit(panel, which, at - (at - a) * factor, at + (b - at) * factor);
    }
    function shift(panel, which, share) {
      const [a, b] = panel[which].now;
      limit(panel, which, a + (b - a) * share, b + (b - a) * share);
    }
    Object.assign(self, { prepared, itemsOf, place, limit, refresh, all, scale, shift, toggle, series, readAt, ticks });

    // ------------------------------------------------------------------------------------------- what lies under a point
    function svgPoint(event) {
      const box = svg.getBoundingClientRect(), view = svg.viewBox.baseVal;
      return [view.x + ((event.clientX - box.left) / box.width) * view.width, view.y + ((event.clientY - box.top) / box.height) * view.height];
    }
    function clientPoint(x, y) {
      const box = svg.getBoundingClientRect(), view = svg.viewBox.baseVal;
      return [box.left + ((x - view.x) / view.width) * box.width, box.top + ((y - view.y) / view.height) * box.height];
    }
    const panelAt = (x, y, slack) => prepared().find((p) => x >= p.left - slack && x <= p.left + p.width + slack && y >= p.top - slack && y <= p.top + p.height + slack);
    const valueAt = (panel, axis, at) => {
      const share = axis.upright ? 1 - (at - panel.top) / panel.height : (at - panel.left) / panel.width;
      return axis.now[0] + (axis.now[1] - axis.now[0]) * share;
    };

    // Points of the lines and the marks of a panel, and its bars, as they are drawn without zoom.
    function pointsOf(panel) {
      if (panel.points) return panel.points;
      panel.points = [];
      for (const id of panel.moved || []) {
        const group = byId(id);
        if (!group || group.querySelector('g[transform*="scale("]')) continue;
        const paths = [...group.querySelectorAll("path")].filter((path) => !path.closest("defs"));
        const lines = paths.filter((path) => path.style.fill === "none");
        const numbers = (path) => (path.getAttribute("d").match(/-?[\d.]+/g) || []).map(Number);
        let xs = [], ys = [], bars = [];
        if (lines.length > 1) continue;  // bars of intervals
        for (const path of lines) { const all = numbers(path); for (let k = 0; k + 1 < all.length; k += 2) { xs.push(all[k]); ys.push(all[k + 1]); } }
        if (!lines.length) for (const use of group.querySelectorAll("use")) { xs.push(Number(use.getAttribute("x"))); ys.push(Number(use.getAttribute("y"))); }
        if (!xs.length) for (const path of paths) {
          const all = numbers(path), [px, py] = [all.filter((_, k) => k % 2 === 0), all.filter((_, k) => k % 2)];
          if (all.length >= 8 && all.length <= 12) bars.push([Math.min(...px), Math.max(...px), Math.min(...py), Math.max(...py)]);
        }
        const colour = (paths[0] || group.querySelector("use") || group).style;
        panel.points.push({
          id, xs, ys, bars, line: lines.length > 0, ordered: xs.length > 1 && xs[0] < xs[xs.length - 1] && xs.every((x, k) => !k || x >= xs[k - 1] - 0.011),
          colour: colour.stroke && colour.stroke !== "none" ? colour.stroke : colour.fill && colour.fill !== "none" ? colour.fill : "",
        });
      }
      return panel.points;
    }
    const nameOf = (panel, id) => (named[id] || []).map((one) => one.name).join(", ");
    const titled = (panel) => panel.title.replace(/^\(\w\) /, "") || labelled(panel.y.label)[NAME] || "value";
    const nearestText = (axis, value) => (axis.texts || []).reduce((best, one) => (Math.abs(to(axis, one[0]) - value) < Math.abs(to(axis, best[0]) - value) ? one : best), axis.texts[0])[1];

    function written(axis, value) {
      if (axis.texts && !axis.log) return nearestText(axis, value);
      const range = Math.abs(back(axis, axis.base[1]) - back(axis, axis.base[0])), real = back(axis, value);
      const text = axis.log ? minus(String(Number(real.toPrecision(4)))) : rounded(real, range);
      return withUnit(text, labelled(axis.label)[UNIT]);
    }

    // Rows of a panel at a place of the present drawing: every curve at that x, and the nearest single point.
    function read(panel, x, y) {
      const [kx, dx] = movement(panel, panel.x), [ky, dy] = movement(panel, panel.y), unit = svg.viewBox.baseVal.width / (svg.clientWidth || 1);
      const rows = [], within = (py) => py >= panel.top - 1 && py <= panel.top + panel.height + 1;
      const bottom = (py) => panel.y.base[0] + (panel.y.base[1] - panel.y.base[0]) * (1 - (py - panel.top) / panel.height);
      const across = (px) => panel.x.base[0] + (panel.x.base[1] - panel.x.base[0]) * ((px - panel.left) / panel.width);
      let single = null;
      for (const one of pointsOf(panel)) {
        if (!visible(one.id)) continue;
        const name = nameOf(panel, one.id) || titled(panel);
        for (const [x0, x1, y0, y1] of one.bars) {
          if (x < kx * x0 + dx || x > kx * x1 + dx || y < ky * y0 + dy || y > ky * y1 + dy) continue;
          const lying = panel.y.texts && !panel.x.texts, cell = panel.y.texts && panel.x.texts;
          const [axis, low, high] = lying ? [panel.x, across(x0), across(x1)] : [panel.y, bottom(y1), bottom(y0)];
          const where = panel.y.texts ? nearestText(panel.y, bottom((y0 + y1) / 2)) : panel.x.texts ? nearestText(panel.x, across((x0 + x1) / 2)) : "";
          if (cell) return { head: where, rows: [[labelled(panel.x.label)[NAME] || "", nearestText(panel.x, across((x0 + x1) / 2)), true, ""]], x, y };
          return { head: where, rows: [[name, written({ ...axis, texts: null }, high - low), true, one.colour]], x, y };
        }
        if (one.ordered && one.xs.length > 1 && !panel.y.texts) {
          const px = (x - dx) / kx;
          if (px < one.xs[0] - 4 || px > one.xs[one.xs.length - 1] + 4) continue;
          let low = 0, high = one.xs.length - 1;
          while (high - low > 1) { const middle = (low + high) >> 1; if (one.xs[middle] <= px) low = middle; else high = middle; }
          const share = clamp((px - one.xs[low]) / (one.xs[high] - one.xs[low] || 1), 0, 1);
          const py = one.line ? one.ys[low] + share * (one.ys[high] - one.ys[low]) : one.ys[share < 0.5 ? low : high];
          rows.push({ name, py: ky * py + dy, px: x, value: bottom(py), colour: one.colour, line: one.line });
        } else for (let k = 0; k < one.xs.length; k++) {
          const [px, py] = [kx * one.xs[k] + dx, ky * one.ys[k] + dy], away = Math.hypot(px - x, py - y) / unit;
          if (away < NEAR && (!single || away < single.away)) single = { away, name, px, py, value: bottom(one.ys[k]), at: across(one.xs[k]), colour: one.colour };
        }
      }
      const nearer = (row) => !rows.some((other) => other !== row && other.name === row.name && Math.abs(other.py - y) < Math.abs(row.py - y));
      const seen = rows.filter((row) => within(row.py) && nearer(row)).sort((a, b) => a.py - b.py);
      const curve = seen.reduce((best, row) => (!best || Math.abs(row.py - y) < Math.abs(best.py - y) ? row : best), null);
      if (single && (!curve || single.away + 6 < Math.abs(curve.py - y) / unit)) {
        const at = { x: single.px, y: single.py, point: true };
        if (panel.y.texts) return { head: nearestText(panel.y, single.value), rows: [[single.name, written(panel.x, single.at), true, single.colour]], ...at };
        return { head: "", rows: [...heading(panel, single.at), [single.name, written(panel.y, single.value), true, single.colour]], ...at };
      }
      if (!curve) return null;
      const nearest = [...seen].sort((a, b) => Math.abs(a.py - y) - Math.abs(b.py - y)).slice(0, 12);
      return { head: "", rows: [...heading(panel, valueAt(panel, panel.x, x)), ...seen.filter((row) => nearest.includes(row)).map((row) => [row.name, written(panel.y, row.value), row === curve, row.colour])], x, y: curve.py, line: true };
    }
    const heading = (panel, value) => (panel.x.texts && !panel.x.label ? [[nearestText(panel.x, value), "", false, ""]] : [[panel.x.label ? labelled(panel.x.label)[NAME] : xLabel(panel), written(panel.x.label ? panel.x : { ...panel.x, label: "x (" + labelled(sharedLabel(panel))[UNIT] + ")" }, value), false, ""]]);
    const sharedLabel = (panel) => (prepared().find((other) => other.x.shared === panel.x.shared && other.x.label) || panel).x.label || "";
    const xLabel = (panel) => labelled(sharedLabel(panel))[NAME] || "x";

    function mark(found, panel) {
      if (!cursor) return;
      for (const element of [cursor, dot]) element.setAttribute("visibility", "hidden");
      if (!found || !panel) { hideTip(); return; }
      if (found.line) {
        const group = prepared().filter((other) => other.x.shared === panel.x.shared);
        cursor.setAttribute("x1", found.x); cursor.setAttribute("x2", found.x);
        cursor.setAttribute("y1", Math.min(...group.map((p) => p.top))); cursor.setAttribute("y2", Math.max(...group.map((p) => p.top + p.height)));
        cursor.setAttribute("visibility", "visible");
      }
      if (found.point || (found.line && !self.source)) { dot.setAttribute("cx", found.x); dot.setAttribute("cy", found.y); dot.setAttribute("visibility", "visible"); }
    }

    function readAt(panel, x, y, client) {
      const found = self.source ? self.source(panel, valueAt(panel, panel.x, x), x, y) : read(panel, x, y);
      self.at = [panel.k, x, y];
      mark(found, panel);
      if (found) showTip(found.head, found.rows, ...(client || clientPoint(x, y)));
    }

    // ------------------------------------------------------------------------------------------------------ the pointer
    function keyUnder(event) {
      return series.find((one) => one.ids.length && one.keys.some((id) => {
        const key = byId(id);
        if (!key) return false;
        const box = key.getBoundingClientRect();
        return event.clientX >= box.left - 3 && event.clientX <= box.right + 3 && event.clientY >= box.top - 4 && event.clientY <= box.bottom + 4;
      }));
    }
    const fingers = new Map();
    let start = null;

    svg.addEventListener("pointermove", (event) => {
      const [x, y] = svgPoint(event);
      if (fingers.has(event.pointerId)) { touchMoved(event, x, y); if (fingers.size > 1 || start && start.panning) return; }
      const panel = start && start.panel ? start.panel : panelAt(x, y, 0);
      svg.style.cursor = keyUnder(event) ? "pointer" : panel ? "crosshair" : "";
      tip.setAttribute("aria-live", "off");
      if (start && start.panel && event.pointerType === "mouse") {
        const box = dragged(start, x, y);
        brush.setAttribute("visibility", box ? "visible" : "hidden");
        if (box) for (const [name, value] of Object.entries(box)) brush.setAttribute(name, value);
      }
      if (panel) readAt(panel, clamp(x, panel.left, panel.left + panel.width), clamp(y, panel.top, panel.top + panel.height), [event.clientX, event.clientY]);
      else mark(null);
    });
    svg.addEventListener("pointerleave", (event) => { if (event.pointerType === "mouse" && !start) mark(null); });

    // The rectangle of a drag; along one axis alone where the other way was short.
    function dragged(from, x, y) {
      const p = from.panel, few = 5;
      x = clamp(x, p.left, p.left + p.width); y = clamp(y, p.top, p.top + p.height);
      const [wide, high] = [Math.abs(x - from.x), Math.abs(y - from.y)];
      if (wide < few && high < few) return null;
      const flat = high < few, upright = wide < few;
      return {
        x: upright ? p.left : Math.min(x, from.x), width: upright ? p.width : wide,
        y: flat ? p.top : Math.min(y, from.y), height: flat ? p.height : high,
      };
    }
    svg.addEventListener("pointerdown", (event) => {
      const [x, y] = svgPoint(event);
      if (event.pointerType === "mouse") { if (event.button === 0) start = { x, y, panel: panelAt(x, y, 0) }; return; }
      fingers.set(event.pointerId, [x, y]);
      start = { x, y, panel: panelAt(x, y, 4), panning: false };
    });
    addEventListener("pointerup", (event) => {
      fingers.delete(event.pointerId);
      if (!start) return;
      const [x, y] = svgPoint(event), from = start, box = from.panel && event.pointerType === "mouse" ? dragged(from, x, y) : null;
      if (!fingers.size) start = null;
      if (brush) brush.setAttribute("visibility", "hidden");
      if (box) {
        const p = from.panel, [a, b] = [valueAt(p, p.x, box.x), valueAt(p, p.x, box.x + box.width)];
        const [c, d] = [valueAt(p, p.y, box.y + box.height), valueAt(p, p.y, box.y)];
        limit(p, "x", a, b); limit(p, "y", c, d);
        refresh();
      } else if (!from.panning) {
        const one = keyUnder(event);
        if (one && svg.contains(event.target)) toggle(one);
        else if (event.pointerType !== "mouse" && from.panel) readAt(from.panel, x, y, [event.clientX, event.clientY]);
      }
    });
    addEventListener("pointercancel", (event) => { fingers.delete(event.pointerId); start = null; });
    svg.addEventListener("dblclick", (event) => { if (!keyUnder(event)) all(); });
    svg.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.metaKey && !event.shiftKey) return;
      const [x, y] = svgPoint(event), panel = panelAt(x, y, 0);
      if (!panel) return;
      event.preventDefault();
      const factor = Math.pow(1.0015, clamp(event.deltaY || event.deltaX, -300, 300));
      scale(panel, "x", factor, (x - panel.left) / panel.width);
      if (!event.shiftKey) scale(panel, "y", factor, 1 - (y - panel.top) / panel.height);
      refresh();
    }, { passive: false });

    // Two fingers zoom about their middle; one finger moves a figure that is zoomed.
    function touchMoved(event, x, y) {
      const [oldX, oldY] = fingers.get(event.pointerId), panel = start && start.panel;
      const others = [...fingers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
      fingers.set(event.pointerId, [x, y]);
      if (!panel) return;
      if (others.length) {
        const [ox, oy] = others[0];
        for (const [which, before, after, middle, from, size] of [["x", oldX - ox, x - ox, (x + ox) / 2, panel.left, panel.width], ["y", oldY - oy, y - oy, (y + oy) / 2, panel.top, panel.height]]) {
          if (Math.min(Math.abs(before), Math.abs(after)) < 12) continue;
          const share = (middle - from) / size;
          scale(panel, which, clamp(Math.abs(before / after), 0.5, 2), which === "y" ? 1 - share : share);
        }
        start.panning = true;
        refresh();
      } else if (figure.classList.contains("zoomed")) {
        start.panning = start.panning || Math.abs(x - start.x) > 4;
        shift(panel, "x", (oldX - x) / panel.width);
        shift(panel, "y", (y - oldY) / panel.height);
        refresh();
      }
    }

    // ------------------------------------------------------------------------------------------------------ the keyboard
    region.addEventListener("keydown", (event) => {
      if (event.target !== region) return;
      const panels = prepared();
      let [k, x, y] = self.at || [0, panels[0].left, panels[0].top + panels[0].height / 2];
      const panel = panels[k], step = panel.width / (event.shiftKey ? 20 : 200);
      const share = clamp((x - panel.left) / panel.width, 0, 1);
      tip.setAttribute("aria-live", "polite");
      if (event.key === "ArrowLeft" || event.key === "ArrowRight") readAt(panel, clamp(x + (event.key === "ArrowLeft" ? -step : step), panel.left, panel.left + panel.width), y);
      else if (event.key === "ArrowUp" || event.key === "ArrowDown") {
        const next = panels[clamp(k + (event.key === "ArrowUp" ? -1 : 1), 0, panels.length - 1)];
        readAt(next, next.left + share * next.width, next.top + next.height / 2);
      } else if ("+=".includes(event.key)) { scale(panel, "x", 0.5, share); scale(panel, "y", event.altKey ? 0.5 : 1, 0.5); refresh(); }
      else if (event.key === "-") { scale(panel, "x", 2, share); scale(panel, "y", event.altKey ? 2 : 1, 0.5); refresh(); }
      else if (event.key === "Home" || event.key === "0") all();
      else if (event.key === "Escape") mark(null);
      else return;
      event.preventDefault();
    });
    region.addEventListener("blur", () => mark(null));

    // -------------------------------------------------------------------------------------------------------- the tools
    const tools = html("div", { class: "tools" });
    region.after(tools);
    const switched = series.filter((one) => one.ids.length);
    if (switched.length > 1) {
      const list = html("details", {}, tools);
      html("summary", {}, list, "Series");
      for (const one of switched) {
        const label = html("label", {}, list);
        one.box = html("input", { type: "checkbox" }, label);
        one.box.checked = true;
        one.box.addEventListener("change", () => toggle(one));
        symbols(one.name, label);
      }
    }
    html("button", { type: "button", "data-do": "all", hidden: "" }, tools, "Show all again").addEventListener("click", all);
    region.setAttribute("aria-label", region.getAttribute("aria-label") + "; arrow keys read values, plus and minus zoom, Home shows all");
    addEventListener("beforeprint", () => { if (self.panels) all(); });
    return self;
  }

  // -------------------------------------------------------------------------------------------------- the time histories
  function histories(self, data) {
    const { figure, svg, byId } = self, controls = figure.querySelector(".controls"), select = figure.querySelector("select");
    const about = html("p", { class: "hint" }, controls), panels = self.prepared();
    const axis = () => panels[0].x;

    // Curves of the cycle that is chosen take the place of those drawn, with vertical axes of their own.
    function decoded(packed) {
      return packed.values.map((text) => {
        const bytes = atob(text), out = [];
        for (let k = 0; k < bytes.length; k += 2) out.push(packed.low + (packed.high - packed.low) * ((bytes.charCodeAt(k) + 256 * bytes.charCodeAt(k + 1)) / 65535));
        return out;
      });
    }
    const extent = (values) => [values.reduce((a, b) => Math.min(a, b)), values.reduce((a, b) => Math.max(a, b))];
    function choose(number) {
      const set = data.sets[number], times = decoded(set.times)[0], sides = set.traces.map((packed) => packed && decoded(packed));
      data.times = times;
      data.traces = [];
      data.spans = set.spans;
      sides.forEach((xs, k) => { if (xs) data.traces.push({ ...data.panels[k], xs, repaired: set.repaired[k] }); });
      for (const panel of panels) { panel.x.base = [times[0], times[times.length - 1]]; panel.x.own = panel.y.own = true; }
      panels.forEach((panel, k) => {
        self.itemsOf(panel);
        const xs = sides[k >> 1], { left, top, width, height } = panel;
        const place = (t) => left + ((t - panel.x.base[0]) / (panel.x.base[1] - panel.x.base[0])) * width;
        const span = byId("span-" + k), [a, b] = set.payout.map(place);
        if (span) span.querySelector("path").setAttribute("d", "M" + a + " " + top + "H" + b + "V" + (top + height) + "H" + a + "Z");
        const marks = k % 2 ? null : byId("repaired-" + k), bottom = top + height;
        if (marks) marks.querySelector("path").setAttribute("d", set.repaired[k >> 1].map(([c, d]) => "M" + place(c) + " " + bottom + "H" + place(d) + "V" + (bottom - data.repaired_height * height) + "H" + place(c) + "Z").join(""));
        const curves = xs ? (k % 2 ? xs.map((side, n) => (n ? xs[0].map((value, m) => value - side[m]) : null)) : xs) : [];
        const [low, high] = curves.length ? extent([].concat(k % 2 ? [0] : [], ...curves.filter(Boolean))) : panel.y.base;
        const pad = 0.05 * (high - low || 1);
        panel.y.base = [low - pad, high + pad];
        const level = (value) => top + height - ((value - panel.y.base[0]) / (panel.y.base[1] - panel.y.base[0])) * height;
        const zero = byId("zero-" + k);
        if (zero) zero.querySelector("path").setAttribute("d", "M" + left + " " + level(0) + "H" + (left + width));
        for (let n = 0; n < 3; n++) {
          const group = byId("trace-" + k + "-" + n), values = curves[n];
          if (group) group.querySelector("path").setAttribute("d", values ? "M" + values.map((v, m) => place(times[m]).toFixed(2) + " " + level(v).toFixed(2)).join("L") : "");
        }
      });
      about.textContent = set.note;
      self.all();
    }

    // Text of a trace at an instant: between two samples, or the range of a stretch of a long log.
    function value(trace, t) {
      const times = data.times;
      let low = 0, high = times.length;
      while (high - low > 1) { const middle = (low + high) >> 1; if (times[middle] <= t) low = middle; else high = middle; }
      if (trace.range === undefined) {
        const [least, most] = extent([].concat(...(trace.xs || (trace.low ? [trace.low, trace.high] : [trace.x]))));
        trace.range = most - least;
      }
      const shown = (v) => rounded(v, trace.range);
      if (trace.low) {
        const [a, b] = [shown(trace.low[low]), shown(trace.high[low])];
        return withUnit(a === b ? a : a + " to " + b, trace.unit);
      }
      const next = Math.min(low + 1, times.length - 1);
      const share = next > low ? clamp((t - times[low]) / (times[next] - times[low]), 0, 1) : 0;
      return withUnit((trace.xs || [trace.x]).map((x) => shown(x[low] + share * (x[next] - x[low]))).join(" | "), trace.unit);
    }
    // Phase and window of an instant, and the traces with those that are repaired there.
    const within = (t, spans) => (spans || []).filter((span) => t >= span[span.length - 2] && t <= span[span.length - 1]);
    self.source = (panel, t, x, y) => ({
      head: within(t, data.spans).map((span) => span[0]).join(", "), x, y, line: true,
      rows: [["Time", withUnit(fixed(t, 2), "s"), false, ""], ...data.traces.map((trace) => [
        trace.name, value(trace, t) + (within(t, trace.repaired).length ? " (repaired)" : ""), panel.title.replace(/^\(\w\) /, "") === trace.name, "",
      ])],
    });

    const span = (a, b) => { self.limit(panels[0], "x", a, b); self.refresh(); };
    const act = { in: () => self.scale(panels[0], "x", 0.5, centre()), out: () => self.scale(panels[0], "x", 2, centre()), left: () => self.shift(panels[0], "x", -0.5), right: () => self.shift(panels[0], "x", 0.5) };
    const centre = () => (self.at ? clamp((self.at[1] - panels[0].left) / panels[0].width, 0, 1) : 0.5);
    controls.addEventListener("click", (event) => { const does = act[event.target.dataset && event.target.dataset.do]; if (does) { does(); self.refresh(); } });
    self.zoomed = (whole) => {
      const { now, base } = axis();
      for (const button of controls.querySelectorAll("button")) {
        const does = button.dataset.do;
        button.disabled = (whole && does !== "in") || (does === "left" && now[0] <= base[0]) || (does === "right" && now[1] >= base[1]);
      }
      if (whole && !data.sets) select.value = "";
    };
    (data.sets || []).forEach((set, k) => { if (!k) select.replaceChildren(); html("option", { value: k }, select, set.name); });
    for (const [number, a, b] of data.cycles) html("option", { value: a + " " + b }, select, "cycle " + number);
    select.addEventListener("change", () => {
      if (data.sets) { choose(Number(select.value)); return; }
      for (const panel of panels) panel.y.now = [...panel.y.base];
      if (select.value) span(...select.value.split(" ").map(Number)); else self.all();
    });
    controls.hidden = false;
    if (data.sets) { select.value = data.first; choose(data.first); } else self.refresh();
  }

  // The section that is read is marked in the contents, and stays in sight there.
  const entries = [...document.querySelectorAll('nav a[href^="#"]')];
  const seen = new IntersectionObserver((changes) => {
    for (const { target, isIntersecting } of changes) {
      const entry = isIntersecting && entries.find((one) => one.hash === "#" + target.id);
      if (!entry) continue;
      for (const one of entries) one.removeAttribute("aria-current");
      entry.setAttribute("aria-current", "true");
      const list = entry.closest("nav"), box = entry.getBoundingClientRect(), whole = list.getBoundingClientRect();
      if (box.left < whole.left || box.right > whole.right) list.scrollLeft += box.left - whole.left - 20;
    }
  }, { rootMargin: "-25% 0px -70% 0px" });
  for (const part of document.querySelectorAll("main > section[id]")) seen.observe(part);

  const traces = document.getElementById("traces");
  for (const figure of document.querySelectorAll("figure:has(script.marks)")) {
    const self = plot(figure);
    if (figure.classList.contains("interactive") && traces) histories(self, JSON.parse(traces.textContent));
  }
})();
