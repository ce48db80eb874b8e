// The page of a measured set: readings and predictions with their widths, errors, and what the widths come from.
"use strict";
const WIDE = 2; // bars and bands are of two standard deviations

const pointsOf = (data, name) => data.points.filter(point => point.series === name);
const conditionsOf = point => Object.entries(point.conditions).map(([key, value]) => `${key} = ${value}`).join(", ");
const told = value => Number(value).toPrecision(4);

// Readings that differ in nothing but the condition that the series is drawn over, or all of them, by their number.
function groupsOf(series, points) {
  const groups = new Map();
  points.forEach((point, i) => {
    const key = series.by.filter(name => name in point.conditions).map(name => `${name} ${point.conditions[name]}`).join(", ");
    if (!groups.has(key)) groups.set(key, []);
    groups.get(key).push({ ...point, x: series.over ? point.conditions[series.over] : i + 1 });
  });
  for (const group of groups.values()) group.sort((a, b) => a.x - b.x);
  return groups;
}

function drawReadings(node, data, i) {
  const series = data.series_of[i], points = pointsOf(data, series.name), traces = [];
  let n = 0;
  for (const [key, group] of groupsOf(series, points)) {
    const tint = PAIRS[n % PAIRS.length], shape = SYMBOLS[n % SYMBOLS.length], name = plain(key || series.name), x = group.map(p => p.x);
    const half = group.map(p => WIDE * Math.hypot(p.u_num, p.u_input));
    const high = group.map((p, k) => p.predicted + half[k]), low = group.map((p, k) => p.predicted - half[k]);
    n++;
    if (group.length > 1) traces.push({ x: [...x, ...[...x].reverse()], y: [...high, ...low.reverse()], type: "scatter", mode: "lines", fill: "toself", opacity: 0.35,
      fillcolor: tint, line: { width: 0 }, hoverinfo: "skip", showlegend: false, legendgroup: key });
    traces.push({ x, y: group.map(p => p.predicted), type: "scatter", mode: "lines+markers", name: name + ", predicted", legendgroup: key, showlegend: false,
      line: { color: tint, width: 1.6 }, marker: { color: tint, symbol: "line-ew-open", size: 9 }, hovertemplate: "S %{y:.5g}<extra>" + name + "</extra>",
      error_y: group.length > 1 ? undefined : { type: "data", array: half, color: tint, thickness: 5, width: 0 } });
    traces.push({ x, y: group.map(p => p.measured), type: "scatter", mode: "markers", name, legendgroup: key, text: group.map(p => plain(conditionsOf(p))),
      marker: { color: tint, symbol: shape, size: 7, line: { color: tone("ink"), width: 0.8 } }, hovertemplate: "D %{y:.5g}<br>%{text}<extra>" + name + "</extra>",
      error_y: { type: "data", array: group.map(p => WIDE * p.u_D), color: tone("ink"), thickness: 1, width: 3 } });
  }
  shown(node, traces, series.over || "number of the reading", `${series.what}, ${series.unit}`, "points: readings with 2 u_D; lines and bands: predictions with 2 of u_num and u_input");
}

function drawErrors(node, data, i) {
  const series = data.series_of[i], points = pointsOf(data, series.name), x = points.map((_, k) => k + 1);
  const half = points.map(p => WIDE * p.u_val);
  const traces = [{ x: [...x, ...[...x].reverse()], y: [...half, ...half.map(v => -v).reverse()], type: "scatter", mode: "lines", fill: "toself", fillcolor: tone("band"),
    line: { color: tone("edge"), width: 1 }, name: "2 u_val", hoverinfo: "skip" }];
  for (const [within, name, tint, symbol] of [[true, "within", tone("good"), "circle"], [false, "outside", tone("bad"), "x"]]) {
    const some = x.filter(k => points[k - 1].within === within);
    if (some.length) traces.push({ x: some, y: some.map(k => points[k - 1].E), type: "scatter", mode: "markers", name, marker: { color: tint, symbol, size: 8 },
      text: some.map(k => { const p = points[k - 1]; return `${plain(conditionsOf(p))}<br>u_num ${told(p.u_num)}, u_input ${told(p.u_input)}, u_D ${told(p.u_D)}`; }),
      hovertemplate: "E %{y:.4g}<br>%{text}<extra></extra>" });
  }
  shown(node, traces, "number of the reading", "E, " + series.unit, "");
}

function drawShares(node, data, i) {
  const series = data.series_of[i], bars = data.inputs.map((given, k) => ({ name: given.name, share: series.shares[k] })).filter(bar => bar.share !== 0).reverse();
  const traces = [{ type: "bar", orientation: "h", x: bars.map(bar => 100 * bar.share), y: bars.map(bar => plain(bar.name)), marker: { color: COLOURS.native },
    name: "share", hovertemplate: "%{x:.1f} %<extra>%{y}</extra>" }];
  const left = 20 + 6.6 * Math.max(8, ...bars.map(bar => bar.name.length));
  node.style.height = 90 + 26 * Math.max(bars.length, 1) + "px";
  Plotly.react(node, traces, layout({ hovermode: "closest", showlegend: false, margin: { l: left, r: 14, t: 8, b: 52 },
    xaxis: { title: { text: bars.length ? "share of u_input², %" : "no input has a width here", font: { size: 12 } }, zeroline: true }, yaxis: { ticks: "" } }), CONFIG);
}

function shown(node, traces, across, up, note) {
  const legend = legendHeight(traces, node.clientWidth - 76);
  node.style.height = 380 + legend + "px";
  Plotly.react(node, traces, layout({ hovermode: "closest", legend: BELOW, margin: { l: 72, r: 12, t: 24, b: 44 + legend },
    annotations: note ? [{ xref: "paper", yref: "paper", x: 0, xanchor: "left", y: 1, yanchor: "bottom", showarrow: false, text: note, font: { size: 10.5, color: tone("soft") } }] : [],
    xaxis: { title: { text: plain(across), standoff: 4, font: { size: 12 } } },
    yaxis: { title: { text: fitted(plain(up), 330), font: { size: 12 } }, exponentformat: "power" } }), CONFIG);
}

document.addEventListener("DOMContentLoaded", () => {
  document.querySelectorAll("section.measured").forEach(section => {
    const id = section.dataset.set, data = crosscheck.cases.get(id), host = section.querySelector(".panels"), names = data.series_of.map(series => series.name);
    for (const [title, draw, about] of [
      ["Readings and predictions", drawReadings, "measured values with bars, and the prediction with its band"],
      ["Errors and their uncertainty", drawErrors, "errors of the prediction inside and outside of twice their uncertainty"],
      ["What u_input comes from", drawShares, "share of each input in the uncertainty by inputs"],
    ]) chart(host, id, title, names, (node, i) => draw(node, data, i), i => `Chart: ${about}, of ${names[i]}`);
  });
});
