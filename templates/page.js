// Folded sections open where a link leads to them and in print; time histories are drawn by uPlot.
function reveal() {
  const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  const folded = target && target.closest("details");
  if (folded) { folded.open = true; target.scrollIntoView(); }
}
addEventListener("hashchange", reveal);
const fits = [];  // what gives the plots of a place the width that it has now
function fit() { fits.forEach((one) => one()); }
addEventListener("resize", fit);
addEventListener("toggle", fit, true);
addEventListener("beforeprint", () => { document.querySelectorAll("details").forEach((part) => { part.open = true; }); fit(); });
reveal();

function colour(name) { return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim(); }

// stretches behind the curves of a row, from its lower edge to a share of its height
function spans(plot, found, share) {
  const { ctx, bbox } = plot;
  for (const span of found) {
    const [left, right] = [span.from, span.to].map((t) => Math.round(plot.valToPos(t, "x", true)));
    ctx.fillStyle = colour(span.colour);
    ctx.fillRect(left, bbox.top + (1 - share) * bbox.height, Math.max(right - left, 1), share * bbox.height);
  }
}

const plain = (_, values) => values.map((value) => String(+value.toPrecision(6)).replace("-", "−"));

// one plot below the other, with the same time axis, cursor and zoom
function histories(place, data) {
  const sync = uPlot.sync(place.parentElement.id), plots = [];
  data.rows.forEach((row, k) => {
    const last = k === data.rows.length - 1;
    const axis = { stroke: colour("ink"), grid: { stroke: colour("grid"), width: 1 }, ticks: { stroke: colour("grid") } };
    const plot = new uPlot({
      width: place.clientWidth, height: last ? 142 : 98, padding: [20, null, null, null], legend: { live: true },
      cursor: { sync: { key: sync.key }, drag: { x: true, y: false } },
      scales: { x: { time: false } },
      axes: [
        { ...axis, label: last ? "time (s)" : undefined, values: last ? plain : () => [], size: last ? 40 : 8 },
        { ...axis, label: row.label, values: plain, size: 60 },
      ],
      series: [{ label: "t (s)" }, ...row.series.map((one) => ({ label: one.label, stroke: colour(one.colour), width: 1.25, dash: one.dash }))],
      hooks: {
        drawClear: [(drawn) => { spans(drawn, data.spans, 1); spans(drawn, row.repaired, 0.07); }],
        setScale: [(drawn, name) => {
          if (name !== "x") return;
          const { min, max } = drawn.scales.x;
          for (const other of plots) {
            if (other !== drawn && (other.scales.x.min !== min || other.scales.x.max !== max)) other.setScale("x", { min, max });
          }
        }],
      },
    }, [data.t, ...row.series.map((one) => one.values)], place);
    plots.push(plot);
  });
  fits.push(() => plots.forEach((plot) => plot.setSize({ width: place.clientWidth, height: plot.height })));
}
for (const place of document.querySelectorAll(".histories")) {
  histories(place, JSON.parse(place.nextElementSibling.textContent));
}
