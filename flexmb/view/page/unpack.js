// Shared by the pages that show animations and charts: series as store.py packs them, and the reader's preferences.
"use strict";
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

// The colours of the reader's present colour scheme, as defined in style.css.
const tone = name => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
const dark = matchMedia("(prefers-color-scheme: dark)"), calm = matchMedia("(prefers-reduced-motion: reduce)");
