// Charts of the report: overlays with distances and uncertainties, drifts, work-precision. Data: see charts.py.
// Curves have colours of medium lightness, which are visible on a white and on a dark page.
"use strict";
// They are those of Okabe and Ito, darker where these are pale, so that readers with any colour vision tell them apart;
// the shapes say the same once more. What is ours is blue.
const COLOURS = { native: "#0072b2", "native-composite": "#6a63c8", "native-frisch": "#3a9adb", "native-frisch-as-printed": "#7c8794",
  "native-radau5": "#2d64b0", "native-exponential": "#4b8fc0", "native-generalised-alpha": "#1f86a8",
  pinocchio: "#d55e00", mujoco: "#009e73", exudyn: "#c28800", "exudyn-beam": "#b8609a", drake: "#995133", dart: "#6a7f00", basilisk: "#ab3d62", opensim: "#8a6d1f",
  kratos: "#5b6bb5", kane: "#3d7a6a" };
const SHIPPED = Object.keys(COLOURS).length;
const SPARE = ["#0f8b8d", "#a74b40", "#5d6877", "#b917a1", "#497215"];
const SYMBOLS = ["circle", "square", "diamond", "triangle-up", "triangle-down", "cross", "star", "hexagon"];
const SHAPES = ["circle", "diamond", "triangle-up", "square", "triangle-down", "cross", "star", "hexagon", "pentagon", "x", "hourglass", "bowtie"];
const DASHES = ["solid", "dash", "dot"];
const PAIRS = ["#556984", "#c2410c", "#7f42de", "#0e7490", "#c61d61", "#4d7c0f", "#aa4b10", "#345cdc"];

function colour(name) {
  if (!(name in COLOURS)) COLOURS[name] = SPARE[(Object.keys(COLOURS).length - SHIPPED) % SPARE.length];
  return COLOURS[name];
}

// A text broken into lines that fit a width in pixels, at 6.6 pixels for a letter of 12 pixels.
function fitted(text, width) {
  const lines = [""], most = Math.max(16, Math.floor(width / 6.6));
  for (const word of text.split(" ")) {
    const line = lines[lines.length - 1];
    if (line && line.length + word.length + 1 > most) lines.push(word);
    else lines[lines.length - 1] = line ? line + " " + word : word;
  }
  return lines.join("<br>");
}

// Names at the ends of lines, none over another: annotations for ends { x, y, text, colour } in powers of ten, on axes of
// `ranges` [[x0, x1], [y0, y1]] that are drawn on `size` [width, height] pixels.
// Texts are of the colour of texts, since those of curves stand out too little on one of the two grounds; leaders have these.
const LABEL = 13; // pixels between two names
function endLabels(ends, [[x0, x1], [y0, y1]], [width, height]) {
  const placed = [];
  const seen = ends.map(end => ({ ...end, px: (end.x - x0) / (x1 - x0) * width, py: (y1 - end.y) / (y1 - y0) * height, wide: 6.2 * end.text.length + 12 }));
  for (const end of seen.sort((a, b) => a.py - b.py)) {
    const left = end.px + end.wide + 10 > width; // no room to the right of the point
    const from = left ? end.px - 10 - end.wide : end.px + 10;
    let at = end.py;
    for (const other of placed) if (from < other.to && other.from < from + end.wide && at < other.at + LABEL) at = Math.max(at, other.at + LABEL);
    at = Math.min(at, height - LABEL / 2);
    placed.push({ from, to: from + end.wide, at });
    placed.sort((a, b) => a.at - b.at);
    end.note = { xref: "x", yref: "y", x: end.x, y: end.y, ax: left ? -10 : 10, ay: at - end.py, xanchor: left ? "right" : "left", showarrow: true, arrowhead: 0,
      arrowwidth: 0.6, arrowcolor: end.colour, text: `<b>${end.text}</b>`, font: { size: 11, color: tone("ink") }, bgcolor: tone("page"), borderpad: 0 };
  }
  return seen.map(end => end.note);
}

// Zero has no logarithm: such samples are left out of a logarithmic curve.
const positive = values => values.map(v => (v > 0 ? v : null));

function sides(channel, series) {
  const traces = [], wide = channel.sides.length;
  channel.sides.forEach((side, i) => channel.components.forEach((component, j) => traces.push({
    x: column(series[side.times], 0), y: column(series[side.values], j), type: "scatter", mode: "lines",
    name: plain(side.label), legendgroup: side.label, showlegend: j === 0, hovertemplate: "%{y:.6g}",
    line: { color: colour(side.engine + (side.label === side.engine ? "" : side.label)), width: 1.4 + 2.2 * (wide - 1 - i), dash: DASHES[j % 3] },
  })));
  return traces;
}

function distances(channel, series) {
  const traces = [];
  channel.pairs.forEach((pair, i) => {
    const x = column(series[pair.times], 0), name = plain(pair.a + " – " + pair.b), tone = PAIRS[i % PAIRS.length];
    const common = { x, type: "scatter", mode: "lines", yaxis: "y2", legendgroup: name };
    traces.push({ ...common, y: positive(column(series[pair.error], 0)), name: "|" + name + "|", line: { color: tone, width: 1.5 },
      hovertemplate: "E %{y:.2e}" });
    traces.push({ ...common, y: positive(column(series[pair.doubt], 0)), name: "U", showlegend: false, hovertemplate: "U %{y:.2e}",
      line: { color: tone, width: 1, dash: "dot" } });
  });
  return traces;
}

function drawChannel(node, channel, series) {
  const letters = channel.components.length > 1 ? channel.components.map((c, j) => c + " " + DASHES[j % 3]).join(", ") : "";
  const judged = channel.pairs.length > 0;
  const traces = [...sides(channel, series), ...distances(channel, series)], legend = legendHeight(traces, node.clientWidth - 76);
  node.style.height = 365 + legend + "px";
  const below = !judged ? {} : { yaxis2: { domain: [0, 0.38], type: "log", exponentformat: "power", nticks: 5,
    title: { text: "E, and U dotted" + (channel.unit ? ", " + channel.unit : ""), font: { size: 10.5 } } } };
  Plotly.react(node, traces, layout({
    margin: { l: 64, r: 12, t: 20, b: 44 + legend }, legend: BELOW,
    annotations: letters ? [{ xref: "paper", yref: "paper", x: 0, xanchor: "left", y: 1, yanchor: "bottom", showarrow: false, text: letters, font: { size: 10.5, color: tone("soft") } }] : [],
    shapes: channel.events.map(t => ({ type: "line", x0: t, x1: t, yref: "paper", y0: 0, y1: 1, line: { color: tone("soft"), width: 1, dash: "dot" } })),
    xaxis: { title: { text: "time, s" + (channel.events.length ? "; dotted lines: events" : ""), standoff: 4, font: { size: 12 } }, anchor: judged ? "y2" : "y" },
    yaxis: { domain: judged ? [0.46, 1] : [0, 1], title: { text: channel.unit, font: { size: 10.5 } }, exponentformat: "power",
      range: channel.range || undefined },
    ...below,
  }), CONFIG);
}

function drawDrift(node, drift, series) {
  const traces = drift.curves.map(curve => ({
    x: column(series[curve.times], 0), y: positive(column(series[curve.values], 0)), type: "scatter", mode: "lines", name: plain(curve.engine),
    line: { color: colour(curve.engine), width: 1.6 }, hovertemplate: "%{y:.2e}",
  }));
  const legend = legendHeight(traces, node.clientWidth - 76);
  node.style.height = 220 + legend + "px";
  Plotly.react(node, traces, layout({
    margin: { l: 64, r: 12, t: 8, b: 44 + legend }, legend: BELOW,
    xaxis: { title: { text: "time, s", standoff: 4, font: { size: 12 } } }, yaxis: { type: "log", exponentformat: "power", nticks: 6, title: { text: "relative drift", font: { size: 12 } } },
    shapes: [{ type: "line", xref: "paper", x0: 0, x1: 1, y0: drift.limit, y1: drift.limit, line: { color: tone("bad"), width: 1, dash: "dash" } }],
    annotations: [{ xref: "paper", x: 1, xanchor: "right", y: Math.log10(drift.limit), yanchor: "bottom", showarrow: false, text: "limit", font: { color: tone("bad"), size: 10.5 } }],
  }), CONFIG);
}

function drawWork(node, work) {
  const variants = [...new Set(work.points.map(p => p.variant))], groups = new Map();
  const ofModels = new Set(work.points.map(p => p.engine)).size < variants.length, tint = p => colour(ofModels ? p.variant : p.engine);
  const errors = work.points.filter(p => p.error > 0).map(p => p.error);
  const margin = 10 ** (Math.ceil(Math.log10(Math.max(...errors, 1e-16))) + 0.6);
  for (const point of work.points) {
    const key = (ofModels ? [point.variant, point.engine] : [point.engine, ...(variants.length > 1 ? [point.variant] : []), point.method]).join(" · ");
    groups.set(key, [...(groups.get(key) || []), point]);
  }
  const low = Math.floor(Math.log10(Math.min(...errors, work.doubt))) - 0.7;
  const quickest = Math.min(...work.points.map(p => p.wall_s).filter(s => s > 0)), wall = p => p.wall_s || quickest;
  const text = p => `${plain(p.effort)}<br>${p.evaluations || "?"} evaluations<br>${plain(p.message || "")}`;
  const traces = [];
  for (const [key, points] of groups) {
    const good = points.filter(p => p.error > 0).sort((a, b) => b.error - a.error), bad = points.filter(p => !(p.error > 0));
    const marker = { color: tint(points[0]), symbol: SYMBOLS[variants.indexOf(points[0].variant) % SYMBOLS.length], size: 8 };
    traces.push({ x: good.map(wall), y: good.map(p => p.error), text: good.map(text), name: plain(key), legendgroup: key, type: "scatter",
      mode: "lines+markers", line: { color: marker.color, width: 1 }, marker, hovertemplate: "%{x:.3g} s, error %{y:.2e}<br>%{text}<extra>" + plain(key) + "</extra>" });
    if (bad.length) traces.push({ x: bad.map(wall), y: bad.map(() => margin), text: bad.map(text), name: plain(key) + " failed", legendgroup: key,
      showlegend: !good.length, type: "scatter", mode: "markers", marker: { ...marker, symbol: "x", size: 9 },
      hovertemplate: "failed after %{x:.3g} s<br>%{text}<extra>" + plain(key) + "</extra>" });
  }
  const front = work.points.filter(p => p.best && p.error > 0);
  traces.unshift({ x: front.map(wall), y: front.map(p => p.error), name: "Pareto front", type: "scatter", mode: "lines",
    line: { color: tone("band"), width: 9, shape: "hv" }, hoverinfo: "skip" });
  const width = node.clientWidth, narrow = width < 600, left = narrow ? 90 : 100, top = Math.log10(margin) + 0.4;
  const times = fitted("wall time of the solve, s (compile time apart)", width - left - 12), below = legendHeight(traces, width - left - 12) + 40 + 16 * times.split("<br>").length;
  const across = [work.points.map(wall).reduce((a, b) => Math.min(a, b)), work.points.map(wall).reduce((a, b) => Math.max(a, b))].map(Math.log10);
  const range = [across[0] - 0.1, across[1] + (width < 420 ? 0.1 : 0.12 + 0.15 * (across[1] - across[0]))]; // room for names
  const ends = width < 420 ? [] : [...groups].map(([, points]) => points.filter(p => p.error > 0).sort((a, b) => a.error - b.error)[0])
    .filter(Boolean).map(last => ({ x: Math.log10(wall(last)), y: Math.log10(last.error), text: plain(ofModels ? last.variant : variants.length > 1 ? `${last.engine} · ${last.variant}` : last.engine), colour: tint(last) }));
  node.style.height = 374 + below + "px";
  Plotly.react(node, traces, layout({
    hovermode: "closest", margin: { l: left, r: 12, t: 26, b: below },
    xaxis: { type: "log", exponentformat: "power", nticks: narrow ? 5 : 12, range,
      title: { font: { size: 12 }, standoff: 4, text: times } },
    yaxis: { type: "log", exponentformat: "power", range: [low, top], dtick: Math.ceil((Math.log10(margin) - low) / 9),
      title: { font: { size: 12 }, text: fitted(`error of ${plain(work.observable)}, relative to ${work.scale.toPrecision(3)} ${work.unit}, against ${plain(work.reference)}`, 330) } },
    shapes: [{ type: "rect", xref: "paper", x0: 0, x1: 1, y0: 1e-18, y1: work.doubt, fillcolor: tone("wash"), line: { width: 0 }, layer: "below" }],
    annotations: [
      { xref: "paper", x: 0.99, xanchor: "right", y: Math.log10(work.doubt), yanchor: "top", showarrow: false, font: { size: 10.5, color: tone("soft") },
        text: "below the uncertainty of the reference" },
      { xref: "paper", x: 0, xanchor: "left", yref: "paper", y: 1, yanchor: "bottom", showarrow: false, font: { size: 10.5, color: tone("soft") }, text: "× at the top: failed runs" },
      ...endLabels(ends, [range, [low, top]], [width - left - 12, 348])],
    legend: BELOW,
  }), CONFIG);
}
