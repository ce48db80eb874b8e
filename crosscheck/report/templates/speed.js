// The index: speed against accuracy of all charted cases. Data: see speed.py.
"use strict";
const chosen = { cases: "", time: "relative" };

// A case by its number, a family by its name, or all.
function chartsOf(data, which) {
  return data.charts.filter((chart, i) => !which || chart.family === which || String(i) === which);
}

// Runs of one chart that belong together, by variant and method, from the largest error to the smallest.
function ladders(chart, engine) {
  const groups = new Map();
  for (const point of chart.points) {
    const key = point.variant + "\n" + point.method;
    if (point.engine === engine) groups.set(key, [...(groups.get(key) || []), point]);
  }
  return [...groups.values()].map(points => points.sort((a, b) => b.error - a.error));
}

// One curve out of several: nothing is drawn between them.
function joined(pieces, more) {
  const trace = { x: [], y: [], text: [], customdata: [], type: "scatter", ...more };
  for (const { chart, points, unit } of pieces) {
    for (const p of points) {
      trace.x.push(p.wall_s / unit); trace.y.push(p.error); trace.customdata.push(chart.link);
      trace.text.push(`<b>${plain(chart.name)}</b><br>${plain(p.engine)} on ${plain(p.variant)}, ${plain(p.effort)}<br>${p.wall_s.toPrecision(3)} s`
        + ` (${(p.wall_s / chart.unit_s).toPrecision(2)} × the chart's fastest)<br>error ${p.error.toExponential(1)} against ${plain(chart.reference)}`);
    }
    trace.x.push(null); trace.y.push(null); trace.customdata.push(""); trace.text.push("");
  }
  return trace;
}

// The median of the times in which charts reach an error, for every power of ten that at least half of them reach.
// `points` gives those of a chart that count.
function medians(charts, points) {
  const curve = { x: [], y: [], text: [] };
  const some = charts.map(chart => ({ unit: chart.unit_s, points: points(chart) })).filter(each => each.points.length);
  for (let k = -1; k >= -13; k--) {
    const times = some.map(({ unit, points }) => Math.min(...points.filter(p => p.error <= 10 ** k).map(p => p.wall_s / unit)))
      .filter(Number.isFinite).sort((a, b) => a - b);
    if (times.length === 0 || 2 * times.length < some.length) break;
    const middle = times.length >> 1, value = times.length % 2 ? times[middle] : Math.sqrt(times[middle - 1] * times[middle]);
    curve.x.push(value); curve.y.push(10 ** k); curve.text.push(`${times.length} of ${some.length} charts`);
  }
  return curve;
}

// One chart in full; several by their medians, with all their points pale behind.
function curves(charts, engines, relative, seen) {
  const overlaid = charts.length > 1 && relative, unit = chart => (relative ? chart.unit_s : 1);
  const look = (engine, size) => ({ color: colour(engine), symbol: SHAPES[seen.indexOf(engine) % SHAPES.length], size, line: { color: tone("page"), width: 0.5 } });
  const band = { name: "Pareto front", hoverinfo: "skip", type: "scatter", mode: "lines", line: { color: tone("band"), width: 9, shape: overlaid ? "linear" : "hv" } };
  const traces = [overlaid ? { ...medians(charts, chart => chart.points), ...band, name: "Pareto front (median)" }
    : { ...joined(charts.map(chart => ({ chart, unit: unit(chart), points: chart.points.filter(p => p.best) })), {}), ...band }];
  for (const engine of engines)
    traces.push(joined(charts.flatMap(chart => ladders(chart, engine).map(points => ({ chart, points, unit: unit(chart) }))), {
      name: plain(engine), legendgroup: engine, showlegend: !overlaid, mode: overlaid ? "markers" : "lines+markers", hovertemplate: "%{text}<extra></extra>",
      opacity: overlaid ? 0.4 : 1, line: { color: colour(engine), width: 1.2 }, marker: look(engine, overlaid ? 6 : 9) }));
  for (const engine of overlaid ? engines : []) {
    const curve = medians(charts, chart => chart.points.filter(p => p.engine === engine));
    const shown = curve.x.length ? {} : { x: [null], y: [null], text: [""] }; // its points only, and its place in the legend
    traces.push({ ...curve, ...shown, type: "scatter", mode: "lines+markers", name: plain(engine), legendgroup: engine,
      line: { color: colour(engine), width: 3 }, marker: look(engine, 11), hovertemplate: plain(engine) + ", median of %{text}<br>%{x:.3g} × the fastest<br>error at most %{y:.0e}<extra></extra>" });
  }
  return traces;
}

// The ends of the lines that are drawn, by the names of their engines: medians of several charts, ladders of one.
function named(charts, engines, relative) {
  if (charts.length > 1 && !relative) return []; // a cloud of lines
  return engines.flatMap(engine => {
    const own = charts.length > 1 ? medians(charts, chart => chart.points.filter(p => p.engine === engine))
      : joined(charts.map(chart => ({ chart, points: chart.points.filter(p => p.engine === engine), unit: relative ? chart.unit_s : 1 })), {});
    const ends = own.x.map((x, i) => [x, own.y[i]]).filter(([x, y]) => x > 0 && y > 0).sort((a, b) => a[1] - b[1]);
    return ends.length ? [{ x: Math.log10(ends[0][0]), y: Math.log10(ends[0][1]), text: plain(engine), colour: colour(engine) }] : [];
  });
}

function drawSpeed(node, data) {
  const charts = chartsOf(data, chosen.cases), relative = chosen.time === "relative", width = node.clientWidth, narrow = width < 600;
  const names = list => data.engines.filter(engine => list.some(chart => chart.points.some(p => p.engine === engine)));
  const engines = names(charts), references = new Set(charts.map(chart => chart.reference));
  const errors = charts.flatMap(chart => chart.points.map(p => p.error));
  const low = Math.floor(Math.log10(Math.min(...errors))), high = Math.ceil(Math.log10(Math.max(...errors)));
  const against = references.size === 1 ? [...references][0] : "the best known reference of each case";
  const left = narrow ? 78 : 84, across = width - left - 12;
  const traces = curves(charts, engines, relative, data.engines);
  const times = fitted(relative ? "wall time of the solve, relative to the fastest run of the chart with an error of 1e-6" : "wall time of the solve, s", across);
  const below = legendHeight(traces, across) + 44 + 16 * times.split("<br>").length;
  const tall = 360, tops = high + 0.3, bottom = low - 0.3; // with heading and form it fits a window of 800 pixels
  node.style.height = tall + below + "px";
  const drawn = traces.flatMap(trace => trace.x.filter(x => x > 0)).map(Math.log10), from = Math.min(...drawn), to = Math.max(...drawn);
  const range = [from - 0.1, to + (narrow ? 0.1 : 0.12 + 0.1 * (to - from))];
  const ends = narrow ? [] : named(charts, engines, relative);
  Plotly.react(node, traces, layout({
    hovermode: "closest", margin: { l: left, r: 12, t: 10, b: below },
    xaxis: { type: "log", exponentformat: "power", nticks: narrow ? 6 : 12, range, title: { font: { size: 12 }, standoff: 6,
      text: times } },
    yaxis: { type: "log", exponentformat: "power", range: [bottom, tops], dtick: Math.max(1, Math.round((high - low) / 8)),
      title: { font: { size: 12 }, text: fitted("error, relative to the range, against " + plain(against), 400) } },
    shapes: relative ? [["x", 1], ["y", data.reached]].map(([axis, at]) => ({ type: "line", layer: "below", line: { color: tone("edge"), width: 1, dash: "dot" },
      ...(axis === "x" ? { x0: at, x1: at, yref: "paper", y0: 0, y1: 1 } : { y0: at, y1: at, xref: "paper", x0: 0, x1: 1 }) })) : [],
    annotations: [{ xref: "paper", yref: "paper", x: 0.01, y: 0.01, xanchor: "left", yanchor: "bottom", showarrow: false, text: "↙ faster and more accurate",
      font: { size: 11, color: tone("soft") } }, ...endLabels(ends, [range, [bottom, tops]], [across, tall - 10])],
    legend: BELOW,
  }), CONFIG);
  if (!node.listens) {
    node.listens = true;
    node.on("plotly_click", event => { if (event.points[0].customdata) location.href = event.points[0].customdata; });
  }
}

document.addEventListener("DOMContentLoaded", () => {
  const host = document.querySelector(".overall");
  if (!host) return;
  const data = JSON.parse(document.getElementById("speed-data").textContent);
  const cases = document.getElementById("speed-cases"), time = document.getElementById("speed-time");
  const plot = document.createElement("div"); plot.className = "plot"; plot.setAttribute("role", "img");
  host.append(plot);
  const redraw = async () => {
    await library("Plotly", "plotly-basic.min.js");
    const charts = chartsOf(data, chosen.cases);
    plot.setAttribute("aria-label", `Chart: error against wall time in ${charts.length} charts, by ${listed(charts.flatMap(chart => chart.points.map(p => p.engine)))}`);
    drawSpeed(plot, data);
    plot.classList.add("drawn");
  };
  cases.onchange = () => {
    chosen.cases = cases.value;
    chosen.time = time.value = /^\d+$/.test(cases.value) ? "seconds" : "relative";
    redraw();
  };
  time.onchange = () => { chosen.time = time.value; redraw(); };
  [cases.value, time.value] = ["", "relative"]; // a browser may have kept what was chosen before
  later(plot, redraw);
  redrawn(plot, redraw);
});
