// The page: tables that open, reasons on request, charts drawn when they come into view.
"use strict";
const DATA = JSON.parse(document.getElementById("data").textContent);
const pending = new Map();
const seen = new IntersectionObserver(entries => entries.forEach(entry => {
  if (!entry.isIntersecting) return;
  seen.unobserve(entry.target);
  pending.get(entry.target)();
}), { rootMargin: "400px" });

function later(node, draw) { pending.set(node, draw); seen.observe(node); }

function chart(host, title, choices, draw, first = 0) {
  const box = document.createElement("div"); box.className = "chart";
  box.innerHTML = '<div class="head"><span></span></div><div class="plot"></div>';
  box.querySelector("span").textContent = title;
  const plot = box.querySelector(".plot");
  let chosen = first;
  if (choices.length > 1) {
    const select = document.createElement("select");
    choices.forEach((name, i) => select.add(new Option(name, i)));
    select.value = first;
    select.onchange = () => { chosen = Number(select.value); draw(plot, chosen); };
    box.querySelector(".head").append(select);
  } else box.querySelector("span").textContent = title + (choices[0] ? ": " + choices[0] : "");
  host.append(box);
  later(plot, () => draw(plot, chosen));
}

document.querySelectorAll(".panels").forEach(host => {
  for (const panel of DATA.cases[host.dataset.case].panels)
    if (panel.comparison === host.dataset.comparison)
      chart(host, panel.title, panel.channels.map(c => c.name), (node, i) => drawChannel(node, panel.channels[i], DATA.series), panel.first);
});
document.querySelectorAll(".drifts").forEach(host => {
  for (const drift of DATA.cases[host.dataset.case].drifts) chart(host, drift.title, [""], node => drawDrift(node, drift, DATA.series));
});
document.querySelectorAll(".work").forEach(host => {
  const charts = DATA.cases[host.dataset.case].work;
  for (const work of charts) chart(host, work.title, [""], node => drawWork(node, work));
  if (!charts.length) host.textContent = "No chart: its reference did not finish, or the case declares none.";
});
document.querySelectorAll(".animation").forEach(host => {
  const animations = DATA.cases[host.dataset.case].animations;
  if (animations.length) new SceneView(host, animations, DATA.series);
});

document.querySelectorAll(".verdicts tr.parent").forEach(row => {
  const level = Number(row.className.match(/level-(\d)/)[1]), button = row.querySelector("button");
  button.onclick = () => {
    const open = button.getAttribute("aria-expanded") !== "true";
    button.setAttribute("aria-expanded", open); button.textContent = open ? "▾" : "▸";
    for (let next = row.nextElementSibling; next && (next.classList.contains("reason") || Number(next.className.match(/level-(\d)/)[1]) > level); next = next.nextElementSibling)
      next.hidden = !open;
  };
});

function reasons(cell) {
  const row = cell.parentElement, next = row.nextElementSibling;
  if (next && next.classList.contains("reason")) {
    const same = next.dataset.column === String(cell.cellIndex);
    next.remove();
    if (same) return;
  }
  const line = document.createElement("tr"); line.className = "reason"; line.dataset.column = cell.cellIndex;
  line.innerHTML = "<th></th><td></td>";
  line.querySelector("td").colSpan = row.cells.length - 1;
  line.querySelector("td").textContent = cell.dataset.reasons;
  row.after(line);
}
document.querySelectorAll(".verdicts td[tabindex]").forEach(cell => {
  cell.onclick = () => reasons(cell);
  cell.onkeydown = e => { if (e.key === "Enter" || e.key === " ") { e.preventDefault(); reasons(cell); } };
});
