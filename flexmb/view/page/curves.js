// Charts of a run by plotly: panels of curves over time, events as dotted lines. Data: see charting.py.
"use strict";
const TONES = ["#0072b2", "#d55e00", "#009e73", "#c28800", "#b8609a", "#5d6877", "#3aa0d8", "#8a6d1f", "#7c52b6", "#a74b40"];
const PANEL = 150, WITHIN = 34; // height of a panel and of what is between two, in pixels
const STYLES = { "": {}, sum: { width: 2.2 }, applied: { dash: "dash" } }; // kinds of curves

function drawCharts(host, data, series) {
  if (data.events.length) {
    const told = document.createElement("p");
    told.className = "hint"; told.textContent = "Events: " + data.events.map(event => `${event.name} at ${event.t.toPrecision(6)} s`).join(", ") + ".";
    host.append(told);
  }
  for (const chart of data.charts) {
    const title = document.createElement("h2"), node = document.createElement("div");
    title.textContent = chart.name;
    host.append(title, node);
    if (chart.note) { const note = document.createElement("p"); note.className = "hint"; note.textContent = chart.note; node.before(note); }
    const draw = () => drawPanels(node, chart, data, series);
    draw(); dark.addEventListener("change", draw);
  }
}

// Panels in a grid: all of a column on one time axis, each on its own axis of values; a name has one colour everywhere.
function drawPanels(node, chart, data, series) {
  const wide = Math.max(...chart.rows.map(row => row.length)), high = chart.rows.length, gap = 0.07, tall = high * (PANEL + WITHIN) - WITHIN;
  const times = column(series[data.times], 0), names = [...new Set(chart.rows.flat().flatMap(panel => panel.curves.map(curve => curve.name)))];
  const traces = [], axes = {}, told = new Set(), numbered = n => (n ? n + 1 : "");
  chart.rows.forEach((row, i) => row.forEach((panel, j) => {
    const k = i * wide + j, top = 1 - i * (PANEL + WITHIN) / tall;
    axes["yaxis" + numbered(k)] = { domain: [top - PANEL / tall, top], anchor: "x" + numbered(j), title: { text: plain(panel.label), font: { size: 11 }, standoff: 4 }, exponentformat: "power", automargin: true };
    for (const curve of panel.curves) {
      const style = STYLES[curve.kind], tint = curve.kind === "sum" ? tone("ink") : TONES[names.indexOf(curve.name) % TONES.length];
      traces.push({ x: times, y: column(series[curve.values], 0), type: "scatter", mode: "lines", name: plain(curve.name), legendgroup: curve.name, showlegend: !told.has(curve.name),
        visible: curve.shown ? true : "legendonly", xaxis: "x" + numbered(j), yaxis: "y" + numbered(k), line: { color: tint, width: 1.5, ...style }, hovertemplate: "%{y:.6g}" });
      told.add(curve.name);
    }
  }));
  for (let j = 0; j < wide; j++) axes["xaxis" + numbered(j)] = { domain: [j * (1 + gap) / wide, (j + 1) / wide - (j + 1 < wide ? gap / wide * (wide - 1 - j) : 0)], matches: j ? "x" : undefined,
    anchor: "y" + numbered((high - 1) * wide + j), title: { text: "time, s" + (data.events.length ? "; dotted lines: events" : ""), standoff: 4, font: { size: 12 } } };
  const legend = legendHeight(traces, node.clientWidth - 76);
  node.style.height = tall + 52 + legend + "px";
  Plotly.react(node, traces, layout({
    ...axes, margin: { l: 64, r: 12, t: 8, b: 44 + legend }, legend: BELOW, hoversubplots: "axis",
    shapes: data.events.map(event => ({ type: "line", x0: event.t, x1: event.t, yref: "paper", y0: 0, y1: 1, line: { color: tone("soft"), width: 1, dash: "dot" } }))
      .flatMap(shape => [...Array(wide).keys()].map(j => ({ ...shape, xref: "x" + numbered(j) }))),
  }), CONFIG);
}
