// Animation of a scene: lines between points carried by markers, in a parallel projection that the mouse turns.
"use strict";
const STYLES = { box: ["#7d8fa3", 1.1], arm: ["#1c2430", 2.2], wheel: ["#c98a00", 2], beam: ["#1b62a5", 3] };
const LOOP_S = 8, TRAIL = 60;

class SceneView {
  constructor(host, animations, series) {
    this.series = series; this.animations = animations; this.yaw = -0.6; this.pitch = 0.35; this.phase = 0; this.playing = false;
    host.innerHTML = '<canvas width="840" height="630"></canvas><div class="controls"><button type="button" class="play" aria-label="play or pause">▶</button>' +
      '<input type="range" min="0" max="1" step="0.001" value="0" aria-label="time"><span class="clock"></span></div><div class="controls"></div>';
    this.canvas = host.querySelector("canvas"); this.context = this.canvas.getContext("2d");
    this.slider = host.querySelector("input"); this.clock = host.querySelector(".clock"); this.button = host.querySelector("button");
    this.button.onclick = () => { this.wanted = !this.playing; this.play(this.wanted); };
    this.slider.oninput = () => { this.phase = Number(this.slider.value); this.draw(); };
    const chooser = document.createElement("select");
    animations.forEach((animation, i) => chooser.add(new Option(animation.title, i)));
    chooser.onchange = () => this.load(Number(chooser.value));
    host.querySelectorAll(".controls")[1].append(chooser);
    this.listen(); this.load(0);
    // It plays while it is seen, unless the reader stopped it or asks for less motion.
    this.wanted = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    new IntersectionObserver(([entry]) => this.play(this.wanted && entry.isIntersecting)).observe(this.canvas);
  }

  play(on) {
    if (on === this.playing) return;
    this.playing = on; this.last = null; this.button.textContent = on ? "❚❚" : "▶";
    if (on) requestAnimationFrame(t => this.tick(t));
  }

  listen() {
    let grip = null;
    this.canvas.onpointerdown = e => { grip = [e.clientX, e.clientY]; this.canvas.setPointerCapture(e.pointerId); };
    this.canvas.onpointerup = () => { grip = null; };
    this.canvas.onpointermove = e => {
      if (!grip) return;
      this.yaw += (e.clientX - grip[0]) * 0.01;
      this.pitch = Math.max(-1.57, Math.min(1.57, this.pitch + (e.clientY - grip[1]) * 0.01));
      grip = [e.clientX, e.clientY]; this.draw();
    };
  }

  load(i) {
    const a = this.scene = this.animations[i];
    this.times = decode(this.series[a.times]);
    this.paths = a.markers.map(m => [decode(this.series[m.position]), decode(this.series[m.orientation])]);
    this.frames = this.times.length;
    let low = [0, 0, 0], high = [0, 0, 0];
    for (let f = 0; f < this.frames; f += Math.max(1, Math.floor(this.frames / 40)))
      for (const line of a.lines) for (const point of line.points) {
        const p = this.place(point, f);
        for (let k = 0; k < 3; k++) { low[k] = Math.min(low[k], p[k]); high[k] = Math.max(high[k], p[k]); }
      }
    this.centre = low.map((v, k) => (v + high[k]) / 2);
    this.reach = Math.max(1e-9, Math.hypot(...high.map((v, k) => v - low[k])) / 2);
    this.draw();
  }

  // Position of a carried point at a whole frame: marker position + R(quaternion) offset.
  place([m, x, y, z], f) {
    if (m < 0) return [x, y, z];
    const [p, q] = this.paths[m], w = q[4 * f], a = q[4 * f + 1], b = q[4 * f + 2], c = q[4 * f + 3];
    const u = 2 * (b * z - c * y), v = 2 * (c * x - a * z), t = 2 * (a * y - b * x);
    return [p[3 * f] + x + w * u + b * t - c * v, p[3 * f + 1] + y + w * v + c * u - a * t, p[3 * f + 2] + z + w * t + a * v - b * u];
  }

  between(point, s) {
    const f = Math.min(Math.floor(s), this.frames - 1), g = Math.min(f + 1, this.frames - 1), r = s - f;
    const a = this.place(point, f), b = this.place(point, g);
    return a.map((v, k) => v + r * (b[k] - v));
  }

  project(p) {
    const [x, y, z] = p.map((v, k) => v - this.centre[k]), cy = Math.cos(this.yaw), sy = Math.sin(this.yaw);
    const right = cy * x - sy * z, away = sy * x + cy * z, up = Math.cos(this.pitch) * y - Math.sin(this.pitch) * away;
    const scale = 0.46 * Math.min(this.canvas.width, this.canvas.height) / this.reach;
    return [this.canvas.width / 2 + scale * right, this.canvas.height / 2 - scale * up];
  }

  stroke(points, style, width) {
    const c = this.context; c.strokeStyle = style; c.lineWidth = width * 1.6; c.lineJoin = c.lineCap = "round"; c.beginPath();
    points.map(p => this.project(p)).forEach(([x, y], i) => (i ? c.lineTo(x, y) : c.moveTo(x, y)));
    c.stroke();
  }

  axes() {
    const size = 0.22 * this.reach, names = ["x", "y", "z"], tones = ["#c62828", "#2e7d32", "#1565c0"];
    names.forEach((name, k) => {
      const tip = [0, 0, 0]; tip[k] = size;
      this.stroke([[0, 0, 0], tip], tones[k], 1);
      const [x, y] = this.project(tip); this.context.fillStyle = tones[k]; this.context.font = "20px system-ui"; this.context.fillText(name, x + 5, y - 5);
    });
  }

  draw() {
    const s = this.phase * (this.frames - 1), whole = Math.floor(s);
    this.context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    this.axes();
    for (const m of this.scene.trails) {
      const trail = [];
      for (let f = Math.max(0, whole - TRAIL); f <= whole; f++) trail.push(this.place([m, 0, 0, 0], f));
      trail.push(this.between([m, 0, 0, 0], s));
      this.stroke(trail, "rgba(209, 73, 91, 0.35)", 1);
    }
    for (const line of this.scene.lines) this.stroke(line.points.map(p => this.between(p, s)), ...STYLES[line.kind]);
    for (const m of this.scene.trails) {
      const [x, y] = this.project(this.between([m, 0, 0, 0], s)); this.context.fillStyle = "#d1495b";
      this.context.beginPath(); this.context.arc(x, y, 5, 0, 7); this.context.fill();
    }
    this.slider.value = this.phase;
    const f = Math.min(whole, this.frames - 1), g = Math.min(f + 1, this.frames - 1);
    this.clock.textContent = (this.times[f] + (s - f) * (this.times[g] - this.times[f])).toFixed(2) + " s";
  }

  tick(now) {
    if (!this.playing) return;
    if (this.last !== null) this.phase = (this.phase + (now - this.last) / 1000 / LOOP_S) % 1;
    this.last = now; this.draw(); requestAnimationFrame(t => this.tick(t));
  }
}
