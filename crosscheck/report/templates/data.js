// Shared by all scripts: cases register their data here; series are unpacked (unpack.js) and libraries loaded when first needed.
"use strict";
const crosscheck = {
  cases: new Map(),
  register(id, data) { this.cases.set(id, data); },
};

const unpacked = new Map();
function seriesOf(id) {
  if (!unpacked.has(id)) unpacked.set(id, unpack(crosscheck.cases.get(id).series));
  return unpacked.get(id);
}

// Load a library from the assets folder and return the global that it defines; the single file contains it.
const loading = new Map();
function library(name, file) {
  if (!loading.has(name)) loading.set(name, name in globalThis ? Promise.resolve() : new Promise((done, failed) => {
    const script = document.createElement("script");
    script.src = document.documentElement.dataset.assets + file;
    script.onload = done;
    script.onerror = () => failed(new Error(file + " cannot be loaded"));
    document.head.append(script);
  }));
  return loading.get(name);
}
