// A scene that the page itself computes, by WebAssembly (export/c/page.c), drawn by scene.js. Data: see export/web.py.
"use strict";
const BUDGET_MS = 12, LONGEST_FRAME_S = 0.1; // of computing in a frame; a longer pause of the page is not made up for

// The exported equations with the places of their numbers.
class Model {
  constructor(instance, data) {
    this.data = data; this.code = instance.exports;
    this.code.initialise();
    const memory = this.code.memory.buffer; // nothing allocates, so that the memory never grows
    this.state = new Float64Array(memory, this.code.states(), data.states);
    this.output = new Float64Array(memory, this.code.outputs(), data.outputs);
    this.text = at => { const bytes = new Uint8Array(memory, at); return new TextDecoder().decode(bytes.subarray(0, bytes.indexOf(0))); };
  }

  call(status) { if (status) throw new Error(this.text(this.code.explain(status))); }
  begin() { this.call(this.code.begin(0)); this.call(this.code.observe()); }
  advance(until) { this.call(this.code.advance(until, this.data.step)); }
  observe() { this.call(this.code.observe()); }
  get time() { return this.code.reached(); }

  // The present time, then positions, quaternions, angles of wheels and loads, as the series of `columns` have them.
  *values() {
    const { data: { markers, wheels, arrows }, output, state } = this;
    yield this.time;
    for (const { position, rotation } of markers) {
      yield* output.subarray(position, position + 3);
      yield* quaternion(output.subarray(rotation, rotation + 9));
    }
    for (const wheel of wheels) yield state[wheel.state];
    for (const arrow of arrows) yield* output.subarray(arrow.output, arrow.output + 3);
  }
}

// [w, x, y, z] of a rotation matrix by rows: the largest of the four first, from which the others follow without loss.
function quaternion([a, b, c, d, e, f, g, h, i]) {
  const squares = [1 + a + e + i, 1 + a - e - i, 1 - a + e - i, 1 - a - e + i], largest = squares.indexOf(Math.max(...squares));
  const rows = [[squares[0], h - f, c - g, d - b], [h - f, squares[1], d + b, c + g], [c - g, d + b, squares[2], h + f], [d - b, c + g, h + f, squares[3]]];
  const scale = 1 / (2 * Math.sqrt(squares[largest]));
  return rows[largest].map(v => v * scale);
}

class LiveView extends SceneView {
  constructor(host, model, data) {
    const widths = [1, ...data.markers.flatMap(() => [3, 4]), ...data.wheels.map(() => 1), ...data.arrows.map(() => 3)];
    const frames = TRAIL + 1, columns = widths.map(width => Array.from({ length: width }, () => new Float64Array(frames)));
    const flat = columns.flat(), markers = data.markers.length, wheels = data.wheels.length;
    // The camera and the arrows are made for a stretch of the motion, which then begins again.
    model.begin();
    try {
      for (let f = 0; f < frames; f++) {
        if (f) { model.advance(data.span * f / (frames - 1)); model.observe(); }
        let j = 0;
        for (const value of model.values()) flat[j++].fill(value, f);
      }
    } catch { /* what was reached is enough to look at, and the reader will see where it ends */ }
    super(host, [{
      title: "", times: 0, lines: data.lines, trails: data.trails, gravity: data.gravity, notes: data.notes,
      markers: data.markers.map(({ name }, i) => ({ name, position: 1 + 2 * i, orientation: 2 + 2 * i })),
      wheels: data.wheels.map((wheel, i) => ({ ...wheel, angle: 1 + 2 * markers + i })),
      arrows: data.arrows.map((arrow, i) => ({ ...arrow, values: 1 + 2 * markers + wheels + i })),
    }], columns, data.title);
    this.model = model; this.data = data; this.flat = flat; this.pace = 1;
    this.slider.hidden = true; this.phase = 1;
    host.querySelector(".hint:not(.notes)").textContent = "Computed here, as you look. Select the picture to turn it (drag, or shift and arrows) and to zoom (wheel, or + and -); space stops and goes on, arrows look back.";
    this.offer(host);
    this.restart();
  }

  // Sliders of inputs and parameters, and the button that begins again.
  offer(host) {
    const list = document.createElement("div"), again = document.createElement("button");
    list.className = "numbers";
    for (const { number, name, unit, value, low, high, again: begins } of this.data.sliders) {
      const label = document.createElement("label"), range = document.createElement("input"), shown = document.createElement("output");
      const show = () => { shown.textContent = `${Number(range.value).toPrecision(3)} ${unit}`; };
      Object.assign(range, { type: "range", min: low, max: high, step: "any", value });
      range.oninput = () => { this.model.code.change(number, Number(range.value)); show(); if (begins) this.restart(); }; // a prescribed motion has one course
      label.append(name, range, shown); list.append(label); show();
    }
    again.type = "button"; again.className = "again"; again.textContent = "begin again";
    again.onclick = () => { this.restart(); this.wanted = true; this.play(true); };
    this.said = document.createElement("p"); this.said.className = "said"; this.said.setAttribute("role", "status");
    this.read = document.createElement("p"); this.read.className = "hint";
    host.append(list, again, this.said, this.read);
  }

  restart() {
    this.said && (this.said.textContent = "");
    this.guarded(() => { this.model.begin(); let j = 0; for (const value of this.model.values()) this.flat[j++].fill(value); });
    this.draw();
  }

  // What fails stops the motion and says why; the last good frame stays.
  guarded(work) {
    try { work(); return true; } catch (error) {
      this.said.textContent = `t = ${this.model.time.toPrecision(4)} s: ${error.message}`;
      this.wanted = false; this.play(false);
      return false;
    }
  }

  tick(now) {
    if (!this.playing) return;
    if (this.last !== null) {
      const asked = Math.min(LONGEST_FRAME_S, (now - this.last) / 1000), from = this.model.time, began = performance.now();
      const good = this.guarded(() => {
        let done = 0; // in pieces, so that a slow machine shows a slower motion and not a stopped page
        for (; done < asked && performance.now() - began < BUDGET_MS; done += asked / 8) this.model.advance(from + Math.min(asked, done + asked / 8));
        this.model.observe();
      });
      if (asked > 0) this.pace += 0.05 * ((this.model.time - from) / asked - this.pace);
      if (!good) return;
      let j = 0;
      for (const value of this.model.values()) { const column = this.flat[j++]; column.copyWithin(0, 1); column[column.length - 1] = value; }
    }
    this.last = now; this.phase = 1; // the present frame is the last; before it stands what has passed
    this.draw(); requestAnimationFrame(t => this.tick(t));
  }

  draw() {
    super.draw();
    if (!this.read) return;
    const readings = this.data.readings.map(({ name, unit, output }) => `${name} ${this.model.output[output].toPrecision(6)} ${unit}`);
    this.read.textContent = [...readings, `steps of ${this.data.step.toPrecision(2)} s`, ...(this.pace < 0.97 ? [`${Math.round(100 * this.pace)} % of real time`] : [])].join(" · ");
  }
}

async function computed(host, data) {
  const { instance } = await WebAssembly.instantiate(Uint8Array.from(atob(data.wasm), c => c.charCodeAt(0)), {});
  return new LiveView(host, new Model(instance, data), data);
}
