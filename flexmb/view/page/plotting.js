// What all pages with charts by plotly have in common: settings, names as text, legends below charts, layouts.
"use strict";
const CONFIG = { displayModeBar: false, responsive: true, scrollZoom: false };
const DRAG = matchMedia("(pointer: coarse)").matches ? false : "zoom"; // a finger on a chart scrolls the page
// Plotly interprets text as markup and as a template, so names are written with character references.
const plain = text => String(text).replace(/[&<>%${}]/g, c => "&#" + c.charCodeAt(0) + ";");

// Height of a legend below a chart, in pixels: plotly sets entries one after the other where traces form groups, and else
// gives each the width of the longest; 48 pixels are for its line.
function legendHeight(traces, width) {
  const shown = traces.filter(trace => trace.showlegend !== false), wide = shown.map(trace => trace.name.replace(/&#\d+;/g, "x").length * 6.2 + 48);
  const grouped = shown.some(trace => trace.legendgroup), widest = Math.max(...wide);
  let rows = 1, used = 0;
  for (const each of wide.map(own => (grouped ? own : widest))) {
    if (used && used + each > width) { rows++; used = 0; }
    used += each;
  }
  return 19 * rows + 12;
}
const BELOW = { orientation: "h", yref: "container", y: 0, yanchor: "bottom", tracegroupgap: 0, font: { size: 11 } }; // a legend at the lower edge

const column = (series, j) => Array.from(series[j]);

function layout(extra) {
  const line = tone("edge"), axis = { gridcolor: tone("line"), zerolinecolor: line, linecolor: line, ticks: "outside", tickcolor: line };
  const base = {
    margin: { l: 64, r: 12, t: 8, b: 40 }, font: { family: "system-ui, sans-serif", size: 11.5, color: tone("ink") },
    paper_bgcolor: tone("page"), plot_bgcolor: tone("page"), dragmode: DRAG,
    hoverlabel: { bgcolor: tone("wash"), font: { color: tone("ink") } }, hovermode: "x unified", legend: { orientation: "h", y: -0.16, yanchor: "top", font: { size: 11 } },
  };
  for (const key of Object.keys(extra)) base[key] = /axis/.test(key) ? { ...axis, ...extra[key] } : extra[key];
  return base;
}
