// Shared by all scripts: cases register their data here; series are unpacked and libraries loaded when first needed.
"use strict";
const crosscheck = {
  cases: new Map(),
  register(id, data) { this.cases.set(id, data); },
};

// The inverse of store.py: base64, inflate, planes of bytes, differences of bit patterns, columns of float32.
async function unpack({ shapes, data }) {
  if (!shapes.length) return [];
  const packed = Uint8Array.from(atob(data), c => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const planes = new Uint8Array(await new Response(stream).arrayBuffer()), count = planes.length / 4;
  const bits = new Uint32Array(count), numbers = new Float32Array(bits.buffer);
  const series = [];
  let at = 0;
  for (const [rows, columns] of shapes) {
    const found = [];
    for (let j = 0; j < columns; j++, at += rows) {
      let last = 0;
      for (let i = at; i < at + rows; i++) {
        last = (last + planes[i] + planes[count + i] * 0x100 + planes[2 * count + i] * 0x10000 + planes[3 * count + i] * 0x1000000) >>> 0;
        bits[i] = last;
      }
      found.push(numbers.subarray(at, at + rows));
    }
    series.push(found);
  }
  return series;
}

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

// The colours of the reader's present colour scheme, as defined in style.css.
const tone = name => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
const dark = matchMedia("(prefers-color-scheme: dark)"), calm = matchMedia("(prefers-reduced-motion: reduce)");
