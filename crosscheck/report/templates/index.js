// The index: filters cases by name and by outcome.
"use strict";
document.addEventListener("DOMContentLoaded", () => {
  const search = document.getElementById("search"), filter = document.getElementById("filter"), shown = document.getElementById("shown");
  if (!search) return;
  const rows = [...document.querySelectorAll("#matrix tbody tr")];
  const apply = () => {
    const words = search.value.toLowerCase().split(/\s+/);
    for (const row of rows)
      row.hidden = !(words.every(word => row.dataset.words.includes(word)) && (!filter.value || filter.value === row.dataset.look));
    shown.textContent = `${rows.filter(row => !row.hidden).length} of ${rows.length} cases`;
  };
  search.oninput = filter.onchange = apply;
  apply();
});
