// A case's page: charts and animation are made when they come into view; the target of a link is opened.
"use strict";
const pending = new Map();
const seen = new IntersectionObserver(entries => entries.forEach(entry => { if (entry.isIntersecting) made(entry.target); }), { rootMargin: "300px" });

async function made(node) {
  if (!pending.has(node)) return;
  const make = pending.get(node);
  pending.delete(node); seen.unobserve(node);
  try { await make(); } catch (error) { node.textContent = "Nothing can be drawn here: " + error.message; console.error(error); }
}

// A page is printed with what is drawn by then, and a browser does not wait for more: charts that are out of view are
// drawn one after the other once all else has been. The single file, of many cases, has those that came into view.
const idle = call => (globalThis.requestIdleCallback ? requestIdleCallback(call, { timeout: 200 }) : setTimeout(call, 50)); // an animation leaves little idle time
async function rest() {
  const next = [...pending.keys()].find(node => node.classList.contains("plot") && node.clientWidth);
  if (!next) return;
  await made(next);
  idle(rest);
}

function later(node, make) { pending.set(node, make); seen.observe(node); }

// A chart in a box, with a menu if there are several; `words` describe an entry.
function chart(host, id, title, choices, draw, words, first = 0) {
  const box = document.createElement("div"); box.className = "chart";
  box.innerHTML = '<div class="head"><span></span></div><div class="plot" role="img"></div>';
  box.querySelector("span").textContent = title + (choices.length === 1 && choices[0] ? ": " + choices[0] : "");
  const plot = box.querySelector(".plot");
  let chosen = first;
  const redraw = async () => {
    await library("Plotly", "plotly-basic.min.js");
    plot.setAttribute("aria-label", words(chosen));
    draw(plot, chosen, await seriesOf(id));
    plot.classList.add("drawn");
  };
  if (choices.length > 1) {
    const select = document.createElement("select");
    select.setAttribute("aria-label", "channel shown in " + title);
    choices.forEach((name, i) => select.add(new Option(name, i)));
    select.value = first;
    select.onchange = () => { chosen = Number(select.value); redraw(); };
    box.querySelector(".head").append(select);
  }
  host.append(box);
  later(plot, redraw);
  redrawn(plot, redraw);
}

// Draw a chart again when the reader's colours change, or the width by so much that titles and legend break otherwise.
function redrawn(plot, redraw) {
  let width = 0;
  const again = () => { if (plot.classList.contains("drawn")) redraw(); };
  dark.addEventListener("change", again);
  new ResizeObserver(() => {
    if (!plot.clientWidth) return; // it is not shown
    if (width && Math.abs(plot.clientWidth - width) > 40) again();
    width = plot.clientWidth;
  }).observe(plot);
}

const listed = names => [...new Set(names)].join(", ");

function fill(section) {
  const id = section.dataset.case, data = crosscheck.cases.get(id), title = section.querySelector(".title").childNodes[1].textContent.trim();
  section.querySelectorAll(".panels").forEach(host => {
    for (const panel of data.panels) if (panel.comparison === host.dataset.comparison) {
      const about = i => `Chart: ${panel.channels[i].name} over time, by ${listed(panel.channels[i].sides.map(s => s.label))}, with distances and uncertainties`;
      chart(host, id, panel.title, panel.channels.map(c => c.name), (node, i, series) => drawChannel(node, panel.channels[i], series), about, panel.first);
    }
  });
  section.querySelectorAll(".drifts").forEach(host => {
    for (const drift of data.drifts) {
      const about = () => `Chart: drift of ${drift.title} over time, by ${listed(drift.curves.map(c => c.engine))}`;
      chart(host, id, drift.title, [""], (node, i, series) => drawDrift(node, drift, series), about);
    }
  });
  section.querySelectorAll(".work").forEach(host => {
    for (const work of data.work) {
      const about = () => `Chart: error of ${work.observable} against wall time, by ${listed(work.points.map(p => p.engine))}`;
      chart(host, id, work.title, [""], node => drawWork(node, work), about);
    }
    if (!data.work.length) host.textContent = "No chart: its reference did not finish, or the case declares none.";
  });
  section.querySelectorAll(".animation").forEach(host => {
    if (data.animations.length) later(host, async () => {
      await library("THREE", "three.iife.min.js");
      host.view = new SceneView(host, data.animations, await seriesOf(id), title);
    });
    else host.remove();
  });
}

// Open the closed details that contain the target of a link.
function reveal() {
  const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (!target) return;
  for (let node = target; node; node = node.parentElement) if (node.tagName === "DETAILS") node.open = true;
  const next = target.tagName === "H3" && target.nextElementSibling;
  if (next && next.tagName === "DETAILS") next.open = true;
  target.scrollIntoView();
}

document.addEventListener("DOMContentLoaded", () => {
  document.querySelectorAll("section.case").forEach(fill);
  addEventListener("hashchange", reveal);
  reveal();
});
addEventListener("load", () => { if (document.querySelectorAll("section.case").length === 1) idle(rest); });
