// Animation of a scene by three.js: solids, arms, wheels and bent beams that move with markers. Data: see drawing.py and scene_view.py.
"use strict";
const TRAIL = 60, RING = 8, FINER = 8; // frames of a trail; sides of a tube; pieces between two nodes of a beam
const SHORTEST_LOOP_S = 4, LONGEST_LOOP_S = 12, FAR = 4; // a motion this many bodies wide is followed by the camera
const VIEW_DEG = 32;
const SIGNS = { play: "M3 1 L14 8 L3 15 Z", pause: "M2 1 H6 V15 H2 Z M10 1 H14 V15 H10 Z" };
const BODIES = ["#1d69b1", "#d1495b", "#2a9d6f", "#c38600", "#7c52b6", "#0f8b8d", "#a74b40", "#556984", "#b917a1", "#497215"];
const CONNECTORS = { spring: ["#2b2b2b", "#e0e0e0"], mount: ["#d97500", "#ffa940"], joint: ["#5a6572", "#c3ccd6"] }, NAMES_OF = { spring: "springs", mount: "bushings, springs in hinges", joint: "hinges, closures" };
const ARROWS = { force: ["#b3261e", "#ff8a80"], torque: ["#6a1b9a", "#ce93d8"], "applied force": ["#00695c", "#80cbc4"], "applied torque": ["#8a5a00", "#ffcc80"] };
const LOADS = { force: "forces at hinges", torque: "torques at hinges", "applied force": "forces from outside", "applied torque": "torques from outside", "": "no loads" };
const TURNS = 7, PER_TURN = 8; // of the coil that a spring is drawn as
const AXES = ["#d43c3c", "#3a8f3e", "#2f74c9"], TRAIL_TONE = "#d1495b";

// One WebGL context draws for all views, whose canvases are copies: browsers allow few contexts on a page.
let stage = null;
function render(scene, camera, canvas) {
  stage = stage || new THREE.WebGLRenderer({ alpha: true, antialias: true });
  stage.setSize(canvas.width, canvas.height, false);
  stage.render(scene, camera);
  const paper = canvas.getContext("2d");
  paper.clearRect(0, 0, canvas.width, canvas.height);
  paper.drawImage(stage.domElement, 0, 0);
}

// The animation to begin with: the first in which something bends, but none of a wrong model that runs away from the others.
const RUNAWAY = 2; // travel over that of the calmest quarter
function firstShown(animations, series) {
  const bends = a => a.lines.some(line => ["beam", "sheet"].includes(line.kind)), some = animations.some(bends) ? animations.filter(bends) : animations;
  const extent = column => column.reduce((most, v) => Math.max(most, v), -Infinity) - column.reduce((least, v) => Math.min(least, v), Infinity);
  const travel = new Map(some.map(a => [a, Math.max(0, ...a.markers.map(m => Math.hypot(...series[m.position].map(extent))))]));
  const moving = [...travel.values()].filter(v => v > 0).sort((a, b) => a - b), usual = moving[Math.floor((moving.length - 1) / 4)] ?? 0;
  return animations.indexOf(some.find(a => travel.get(a) > 0 && travel.get(a) <= RUNAWAY * usual) || some[0]);
}

class SceneView {
  constructor(host, animations, series, title) {
    this.series = series; this.animations = animations; this.phase = 0; this.playing = false;
    host.innerHTML = '<canvas tabindex="0" role="img"></canvas><div class="controls"><button type="button" class="play" aria-label="play"><svg viewBox="0 0 16 16" aria-hidden="true"><path></path></svg></button>' +
      '<input type="range" min="0" max="1" step="0.001" value="0" aria-label="time"><span class="clock"></span></div>' +
      '<div class="controls"></div><ul class="bodies" aria-label="bodies"></ul>' +
      '<p class="hint notes"></p><p class="hint">Select the picture to turn it (drag, or shift and arrows) and to zoom (wheel, or + and -); space plays, arrows step.</p>';
    const first = firstShown(animations, series);
    this.canvas = host.querySelector("canvas"); this.title = title; this.names = host.querySelector(".bodies"); this.notes = host.querySelector(".notes");
    this.slider = host.querySelector("input"); this.clock = host.querySelector(".clock"); this.button = host.querySelector("button");
    this.button.onclick = () => this.toggle();
    this.slider.oninput = () => { this.phase = Number(this.slider.value); this.draw(); };
    if (animations.length > 1) {
      const chooser = document.createElement("select");
      chooser.setAttribute("aria-label", "variant shown");
      animations.forEach((animation, i) => chooser.add(new Option(animation.title, i)));
      chooser.value = first;
      chooser.onchange = () => this.load(Number(chooser.value));
      host.querySelectorAll(".controls")[1].append(chooser);
    } else host.querySelectorAll(".controls")[1].textContent = animations[0].title;
    this.canvas.onkeydown = event => this.key(event);
    this.canvas.onfocus = () => this.hold(true);
    this.canvas.onblur = () => this.hold(false);
    this.arrowKind = "force";
    if (animations.some(a => a.arrows?.length)) {
      const chooser = document.createElement("select");
      chooser.setAttribute("aria-label", "loads shown"); chooser.className = "loads";
      const moving = arrow => series[arrow.values].some(c => c.some(v => v !== 0));
      const kinds = new Set(animations.flatMap(a => a.arrows || []).filter(arrow => !arrow.kind.startsWith("applied") || moving(arrow)).map(arrow => arrow.kind));
      for (const [kind, text] of Object.entries(LOADS)) if (!kind || kinds.has(kind)) chooser.add(new Option(text, kind));
      this.arrowKind = chooser.value;
      chooser.onchange = () => { this.arrowKind = chooser.value; this.draw(); };
      host.querySelectorAll(".controls")[1].append(chooser);
    }
    if (this.canvas.captureStream && globalThis.MediaRecorder) {
      const film = document.createElement("button");
      film.type = "button"; film.className = "film"; film.textContent = "save as video"; film.onclick = () => this.film(film);
      host.querySelectorAll(".controls")[1].append(film);
    }
    this.sign(); this.load(first);
    new ResizeObserver(() => { this.fitCanvas(); if (!this.turned) this.stand(); this.draw(); }).observe(this.canvas);
    dark.addEventListener("change", () => this.load(this.number));
    // It plays while visible, unless the reader stopped it or prefers reduced motion.
    this.wanted = !calm.matches;
    new IntersectionObserver(([entry]) => this.play(this.wanted && entry.isIntersecting)).observe(this.canvas);
  }

  toggle() { this.wanted = !this.playing; this.play(this.wanted); }

  play(on) {
    if (on === this.playing) return;
    this.playing = on; this.last = null; this.sign();
    if (on) requestAnimationFrame(t => this.tick(t));
  }

  // One pass of the motion as a video (WebM), recorded from the canvas by the browser in real time, and downloaded.
  async film(button) {
    const recorder = new MediaRecorder(this.canvas.captureStream(30)), pieces = [], wanted = this.wanted;
    recorder.ondataavailable = event => pieces.push(event.data);
    const ended = new Promise(done => { recorder.onstop = done; });
    button.disabled = true; button.textContent = "recording";
    this.phase = 0; this.play(true); recorder.start();
    await new Promise(done => setTimeout(done, 1000 * this.loop));
    recorder.stop(); await ended;
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob(pieces, { type: recorder.mimeType })); link.download = this.title.replace(/[^\w.-]+/g, "_") + ".webm";
    link.click(); setTimeout(() => URL.revokeObjectURL(link.href), 60000);
    this.recorded = pieces.reduce((sum, piece) => sum + piece.size, 0);
    button.disabled = false; button.textContent = "save as video"; this.play(wanted);
  }

  // The button shows the action that it performs.
  sign() {
    const offer = this.playing ? "pause" : "play";
    this.button.setAttribute("aria-label", offer);
    this.button.querySelector("path").setAttribute("d", SIGNS[offer]);
  }

  // Mouse wheel and touch scroll the page until the picture is selected.
  hold(on) {
    this.controls.enableZoom = on;
    this.canvas.style.touchAction = on ? "none" : "pan-y";
  }

  key(event) {
    const step = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (event.key === " ") this.toggle();
    else if (event.key === "+" || event.key === "-") this.camera.position.sub(this.controls.target).multiplyScalar(event.key === "+" ? 0.9 : 1.11).add(this.controls.target);
    else if (step && event.shiftKey) this.turn(step, event.key.endsWith("Up") || event.key.endsWith("Down"));
    else if (step) this.phase = Math.min(1, Math.max(0, this.phase + step / Math.max(1, this.frames - 1)));
    else return;
    this.turned ||= "+-".includes(event.key) || event.shiftKey;
    event.preventDefault(); this.controls.update(); this.draw();
  }

  turn(step, tilt) {
    const offset = this.camera.position.clone().sub(this.controls.target);
    const axis = tilt ? this.camera.up.clone().cross(offset).normalize() : this.camera.up;
    this.camera.position.copy(this.controls.target).add(offset.applyAxisAngle(axis, (tilt ? -0.1 : 0.1) * step));
  }

  fitCanvas() {
    const ratio = Math.min(2, devicePixelRatio || 1), { clientWidth, clientHeight } = this.canvas;
    this.canvas.width = Math.max(1, Math.round(clientWidth * ratio)); this.canvas.height = Math.max(1, Math.round(clientHeight * ratio));
    this.camera.aspect = this.canvas.width / this.canvas.height; this.camera.updateProjectionMatrix();
  }

  load(number) {
    const a = this.animations[number];
    this.number = number; this.shown = a;
    this.times = this.series[a.times][0]; this.frames = this.times.length;
    this.paths = a.markers.map(m => [this.series[m.position], this.series[m.orientation]]);
    this.loop = Math.min(LONGEST_LOOP_S, Math.max(SHORTEST_LOOP_S, this.times[this.frames - 1]));
    this.notes.textContent = (a.notes || []).join(" "); this.notes.hidden = !this.notes.textContent;
    this.canvas.setAttribute("aria-label", `Animation of ${this.title}: ${a.title}, ${this.frames} frames to ${this.times[this.frames - 1].toPrecision(3)} s`);
    this.measure();
    this.build();
    this.aim();
    this.draw();
  }

  // Position and orientation [w, x, y, z] of a marker between frames; -1 is the World.
  pose(m, s) {
    if (m < 0) return [[0, 0, 0], [1, 0, 0, 0]];
    const f = Math.min(Math.floor(s), this.frames - 1), g = Math.min(f + 1, this.frames - 1), r = s - f, [p, q] = this.paths[m];
    const sign = q.reduce((sum, c) => sum + c[f] * c[g], 0) < 0 ? -1 : 1;
    const turned = q.map(c => c[f] + r * (sign * c[g] - c[f])), size = Math.hypot(...turned) || 1;
    return [p.map(c => c[f] + r * (c[g] - c[f])), turned.map(v => v / size)];
  }

  // A carried point, its tangent, and the direction of a section's y, in World axes.
  place([m, x, y, z, tx = 0, ty = 0, tz = 0], s, across) {
    const [p, q] = this.pose(m, s), at = rotated(q, x, y, z);
    return [at.map((v, k) => v + p[k]), rotated(q, tx, ty, tz), across && rotated(q, ...across)];
  }

  // All drawn points of the scene at a frame.
  *points(s) {
    for (const line of this.shown.lines) for (const point of line.points) yield this.place(point, s)[0];
    for (const wheel of this.shown.wheels) yield this.place([wheel.marker, ...wheel.centre], s)[0];
  }

  // Centre and radius of the whole motion, or of the bodies alone if they travel far.
  measure() {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity], step = Math.max(1, Math.floor(this.frames / 60));
    this.size = 1e-9;
    for (let f = 0; f < this.frames; f += step) {
      const found = [...this.points(f)].filter(p => p.every(Number.isFinite)), middle = mean(found);
      for (const p of found) {
        p.forEach((v, k) => { low[k] = Math.min(low[k], v); high[k] = Math.max(high[k], v); });
        this.size = Math.max(this.size, Math.hypot(...p.map((v, k) => v - middle[k])));
      }
    }
    this.extents = low.map((v, k) => Math.max(0, high[k] - v) || 0);
    this.middle = low.map((v, k) => (v + high[k]) / 2 || 0);
    this.reach = 1e-9;
    for (let f = 0; f < this.frames; f += step)
      for (const p of this.points(f)) this.reach = Math.max(this.reach, Math.hypot(...p.map((v, k) => v - this.middle[k])) || 0);
    this.following = this.reach > FAR * this.size;
    if (this.following) this.reach = this.size;
  }

  aim() {
    const { extents, shown } = this, widest = Math.max(...extents), flat = extents.indexOf(Math.min(...extents));
    const heavy = Math.hypot(...shown.gravity) > 0, up = heavy ? shown.gravity.map(v => -v / Math.hypot(...shown.gravity)) : flat === 2 ? [0, 1, 0] : [0, 0, 1];
    const planar = extents[flat] < 0.15 * widest && Math.abs(up[flat]) < 0.5;
    const way = [0.75, -1, 0.55];
    if (planar) { way.fill(0.28); way[flat] = flat === 1 ? -1 : 1; }
    else if (Math.abs(up[1]) > 0.5) [way[1], way[2]] = [0.55, 1];
    this.camera = new THREE.PerspectiveCamera(VIEW_DEG, 4 / 3, this.reach / 50, this.reach * 200);
    this.camera.up.set(...up);
    this.fitCanvas();
    this.direction = new THREE.Vector3(...way).normalize();
    this.target = this.following ? mean([...this.points(0)]) : this.middle;
    this.turned = false;
    this.stand();
    this.controls?.dispose();
    this.controls = new THREE.OrbitControls(this.camera, this.canvas);
    this.controls.target.set(...this.target);
    this.controls.addEventListener("change", () => this.draw());
    this.controls.addEventListener("start", () => { this.turned = true; });
    this.controls.update();
    this.hold(document.activeElement === this.canvas);
  }

  // The camera where all is visible, until the reader moves it.
  stand() { this.camera.position.set(...this.target).addScaledVector(this.direction, this.distance(this.direction)); this.controls?.update(); }

  // The distance of the camera in a direction at which every point of the motion is visible.
  distance(direction) {
    const right = this.camera.up.clone().cross(direction).normalize(), above = direction.clone().cross(right);
    const slope = Math.tan(this.camera.fov / 2 * Math.PI / 180), step = Math.max(1, Math.floor(this.frames / 60)), offset = new THREE.Vector3();
    let least = 1.5 * this.reach;
    for (let f = 0; f < this.frames; f += step) {
      const found = [...this.points(f)].filter(p => p.every(Number.isFinite)), middle = this.following ? mean(found) : this.middle;
      for (const p of found) {
        offset.set(...p.map((v, k) => v - middle[k]));
        const aside = Math.max(Math.abs(offset.dot(right)) / this.camera.aspect, Math.abs(offset.dot(above)));
        least = Math.max(least, offset.dot(direction) + aside / (0.88 * slope));
      }
    }
    return least;
  }

  build() {
    this.world = new THREE.Scene();
    this.world.add(new THREE.AmbientLight(0xffffff, 1.6));
    const sun = new THREE.DirectionalLight(0xffffff, 1.8); sun.position.set(0.4, -0.7, 1); this.world.add(sun);
    const connectors = this.shown.lines.filter(line => CONNECTORS[line.kind]), thin = 0.008 * this.reach;
    const bodies = [...new Set(this.shown.lines.filter(line => !CONNECTORS[line.kind]).map(line => line.body))], colour = new Map(bodies.map((b, i) => [b, BODIES[i % BODIES.length]]));
    this.carriers = new Map(); this.tubes = []; this.spinning = [];
    for (const line of this.shown.lines) {
      const material = new THREE.MeshLambertMaterial({ color: colour.get(line.body) || connectorTone(line.kind), side: THREE.DoubleSide });
      if (line.kind === "solid") this.carrier(line.points[0][0]).add(...solid(line.points.map(p => p.slice(1, 4)), material));
      else if (["ball", "mount", "joint"].includes(line.kind)) for (const point of line.points) this.carrier(point[0]).add(dot(line.kind, point, (line.kind === "joint" ? 2.4 : 4.5) * thin, material));
      else if (line.kind === "sheet") this.tubes.push(new Sheet(this.world, line, material));
      else this.tubes.push(new Tube(this.world, line, { beam: 1.8, spring: 0.45 }[line.kind] * thin || thin, material));
    }
    for (const wheel of this.shown.wheels) {
      const disc = wheelMesh(wheel, thin); this.carrier(wheel.marker).add(disc);
      this.spinning.push([disc, wheel, this.series[wheel.angle][0]]);
    }
    // The longest arrow of a kind is a third of what the view reaches.
    const largest = Object.fromEntries(Object.keys(ARROWS).map(kind => [kind, 0]));
    this.arrows = (this.shown.arrows || []).map(({ kind, marker, values }) => ({ kind, marker, values: this.series[values] }));
    for (const { kind, values: [x, y, z] } of this.arrows) x.forEach((v, f) => { largest[kind] = Math.max(largest[kind], Math.hypot(v, y[f], z[f])); });
    for (const arrow of this.arrows) {
      arrow.scale = largest[arrow.kind] > 0 ? this.reach / 3 / largest[arrow.kind] : 0;
      arrow.mesh = arrowMesh(thin, new THREE.MeshLambertMaterial({ color: ARROWS[arrow.kind][dark.matches ? 1 : 0] }));
      this.world.add(arrow.mesh);
    }
    AXES.forEach((tone, k) => {
      const tip = [0, 0, 0]; tip[k] = 0.2 * this.reach;
      this.world.add(new THREE.Line(lineGeometry([[0, 0, 0], tip]), new THREE.LineBasicMaterial({ color: tone })));
    });
    this.trails = this.shown.trails.map(m => {
      const geometry = new THREE.BufferGeometry(), line = new THREE.Line(geometry, new THREE.LineBasicMaterial({ color: TRAIL_TONE }));
      geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * (TRAIL + 2)), 3)); line.frustumCulled = false;
      this.world.add(line);
      return [m, geometry];
    });
    const kinds = Object.keys(CONNECTORS).map(kind => [kind, connectors.filter(line => line.kind === kind).map(line => line.body)]);
    const names = [...bodies.map(b => [b, colour.get(b)]), ...this.shown.wheels.map(w => [w.name, WHEEL]),
      ...kinds.filter(([, held]) => held.length).map(([kind, held]) => [`${NAMES_OF[kind]}: ${held.join(", ")}`, connectorTone(kind)])];
    this.names.replaceChildren(...names.map(([name, tone]) => {
      const item = document.createElement("li"), chip = document.createElement("i");
      chip.style.background = tone; item.append(chip, name);
      return item;
    }));
  }

  // The rigid parts that move with one marker; -1 is the World.
  carrier(m) {
    if (!this.carriers.has(m)) { const group = new THREE.Group(); this.carriers.set(m, group); this.world.add(group); }
    return this.carriers.get(m);
  }

  draw() {
    const s = this.phase * (this.frames - 1), whole = Math.floor(s);
    for (const [m, group] of this.carriers) {
      const [p, [w, x, y, z]] = this.pose(m, s);
      group.position.set(...p); group.quaternion.set(x, y, z, w);
    }
    for (const tube of this.tubes) tube.bend(tube.line.points.map((point, i) => this.place(point, s, tube.line.across?.[i])));
    const g = Math.min(whole + 1, this.frames - 1);
    for (const { kind, marker, values, scale, mesh } of this.arrows) {
      const v = new THREE.Vector3(...values.map(c => scale * (c[whole] + (s - whole) * (c[g] - c[whole])))), length = v.length();
      mesh.visible = kind === this.arrowKind && length > 0.01 * this.reach;
      if (!mesh.visible) continue;
      mesh.position.set(...this.pose(marker, s)[0]);
      mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), v.normalize());
      mesh.children[0].scale.y = length; mesh.children[1].position.y = length;
    }
    for (const [disc, , angle] of this.spinning) disc.children[0].rotation.y = angle[whole] + (s - whole) * (angle[g] - angle[whole]);
    for (const [m, geometry] of this.trails) {
      const first = Math.max(0, whole - TRAIL), points = geometry.attributes.position;
      for (let f = first; f <= whole; f++) points.setXYZ(f - first, ...this.pose(m, f)[0]);
      points.setXYZ(whole + 1 - first, ...this.pose(m, s)[0]);
      points.needsUpdate = true; geometry.setDrawRange(0, whole + 2 - first);
    }
    if (this.following) {
      const now = mean([...this.points(s)]), moved = new THREE.Vector3(...now).sub(new THREE.Vector3(...this.target));
      this.camera.position.add(moved); this.controls.target.add(moved); this.target = now; this.camera.updateMatrixWorld();
    }
    render(this.world, this.camera, this.canvas);
    this.slider.value = this.phase;
    this.clock.textContent = (this.times[whole] + (s - whole) * (this.times[g] - this.times[whole])).toFixed(2) + " s";
  }

  tick(now) {
    if (!this.playing) return;
    if (this.last !== null) this.phase = (this.phase + (now - this.last) / 1000 / this.loop) % 1;
    this.last = now; this.draw(); requestAnimationFrame(t => this.tick(t));
  }
}

const WHEEL = "#8a7fd0";

function mean(points) {
  const sum = points.reduce((total, p) => total.map((v, k) => v + p[k]), [0, 0, 0]);
  return sum.map(v => v / Math.max(1, points.length));
}

function rotated([w, a, b, c], x, y, z) {
  const u = 2 * (b * z - c * y), v = 2 * (c * x - a * z), t = 2 * (a * y - b * x);
  return [x + w * u + b * t - c * v, y + w * v + c * u - a * t, z + w * t + a * v - b * u];
}

function lineGeometry(points) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(points.flat()), 3));
  return geometry;
}

// A box by its corners, with its edges, translucent so that wheels inside are visible.
function solid(corners, material) {
  const geometry = lineGeometry(corners);
  geometry.setIndex([0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3]);
  const faces = geometry.toNonIndexed(); faces.computeVertexNormals();
  material.transparent = true; material.opacity = 0.55; material.depthWrite = false;
  return [new THREE.Mesh(faces, material), new THREE.LineSegments(new THREE.EdgesGeometry(faces), new THREE.LineBasicMaterial({ color: tone("soft") }))];
}

// A point mass or the mark of a connector, fixed to a marker.
function dot(kind, [, x, y, z], size, material) {
  const [around, down] = kind === "mount" ? [4, 2] : [20, 14]; // a mark is an octahedron
  const mesh = new THREE.Mesh(new THREE.SphereGeometry(size, around, down), material);
  mesh.position.set(x, y, z);
  return mesh;
}

// An arrow along y with its tail at the origin, of unit length: a shaft that is stretched, and a head at its end.
function arrowMesh(thin, material) {
  const arrow = new THREE.Group(), shaft = new THREE.CylinderGeometry(0.5 * thin, 0.5 * thin, 1, 12), head = new THREE.CylinderGeometry(0, 1.8 * thin, 5 * thin, 16);
  shaft.translate(0, 0.5, 0);
  arrow.add(new THREE.Mesh(shaft, material), new THREE.Mesh(head, material));
  return arrow;
}

function connectorTone(kind) { return CONNECTORS[kind][dark.matches ? 1 : 0]; }

// A disc about its axis, with a spoke on either face so that its rotation is visible.
function wheelMesh(wheel, thin) {
  const outer = new THREE.Group(), turning = new THREE.Group(), radius = Math.max(wheel.radius, 3 * thin), width = Math.max(wheel.width, thin);
  turning.add(new THREE.Mesh(new THREE.CylinderGeometry(radius, radius, width, 32), new THREE.MeshLambertMaterial({ color: WHEEL })));
  turning.add(new THREE.Mesh(new THREE.BoxGeometry(2 * radius, 1.15 * width, 0.16 * radius), new THREE.MeshLambertMaterial({ color: TRAIL_TONE })));
  outer.add(turning);
  outer.position.set(...wheel.centre);
  outer.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), new THREE.Vector3(...wheel.axis).normalize());
  return outer;
}

// A surface of triangles between points, with their edges, seen from both sides.
class Sheet {
  constructor(world, line, material) {
    this.line = line;
    this.geometry = lineGeometry(line.points.map(() => [0, 0, 0]));
    this.geometry.setIndex(line.faces.flat());
    const edges = new THREE.BufferGeometry(), sides = line.faces.flatMap(([i, j, k]) => [[i, j], [j, k], [k, i]]);
    edges.setAttribute("position", this.geometry.attributes.position); edges.setIndex(sides.flat());
    for (const drawn of [new THREE.Mesh(this.geometry, material), new THREE.LineSegments(edges, new THREE.LineBasicMaterial({ color: tone("soft") }))]) {
      drawn.frustumCulled = false; world.add(drawn);
    }
  }

  bend(placed) {
    const { position } = this.geometry.attributes;
    placed.forEach(([p], i) => position.setXYZ(i, ...p));
    position.needsUpdate = true; this.geometry.computeVertexNormals();
  }
}

// A tube through points with tangents (cubic Hermite; unknown tangents are estimated as straight as possible), round or
// with the rectangles of a beam's sections.
class Tube {
  constructor(world, line, radius, material) {
    this.line = line; this.radius = radius;
    if (line.widths) this.halves = finer(line.widths.map(pair => pair.map(v => Math.max(v / 2, 0.4 * radius))));
    this.spine = { beam: hermite, spring: placed => coil(placed, 7 * radius) }[line.kind] || (placed => placed.map(([p]) => p));
    this.rings = { beam: (line.points.length - 1) * FINER + 1, spring: TURNS * PER_TURN + 3 }[line.kind] || line.points.length;
    this.geometry = new THREE.BufferGeometry();
    this.geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * RING * this.rings), 3));
    this.geometry.setAttribute("normal", new THREE.BufferAttribute(new Float32Array(3 * RING * this.rings), 3));
    const faces = [];
    for (let i = 0; i + 1 < this.rings; i++) for (let j = 0; j < RING; j++) {
      const a = i * RING + j, b = i * RING + (j + 1) % RING;
      faces.push(a, b, a + RING, b, b + RING, a + RING);
    }
    this.geometry.setIndex(faces);
    const mesh = new THREE.Mesh(this.geometry, material); mesh.frustumCulled = false;
    world.add(mesh);
  }

  bend(placed) {
    const spine = this.spine(placed), { position, normal } = this.geometry.attributes;
    const side = new THREE.Vector3(0, 0, 0), way = new THREE.Vector3(), other = new THREE.Vector3();
    const sides = this.halves && finer(placed.map(([, , across]) => across));
    spine.forEach((p, i) => {
      const from = spine[Math.max(0, i - 1)], to = spine[Math.min(spine.length - 1, i + 1)];
      way.set(...to.map((v, k) => v - from[k])).normalize();
      if (sides) side.set(...sides[i]);
      else if (i === 0) side.set(Math.abs(way.x) < 0.8 ? 1 : 0, Math.abs(way.x) < 0.8 ? 0 : 1, 0);
      side.addScaledVector(way, -side.dot(way)).normalize(); // the last ring's side, carried along
      other.crossVectors(way, side);
      for (let j = 0; j < RING; j++) {
        let c = Math.cos(2 * Math.PI * j / RING), d = Math.sin(2 * Math.PI * j / RING);
        if (sides) { // on the rectangle, in units of the radius
          const most = Math.max(Math.abs(c), Math.abs(d)) * this.radius;
          c *= this.halves[i][0] / most; d *= this.halves[i][1] / most;
        }
        const n = [c * side.x + d * other.x, c * side.y + d * other.y, c * side.z + d * other.z];
        position.setXYZ(i * RING + j, ...p.map((v, k) => v + this.radius * n[k])); normal.setXYZ(i * RING + j, ...n);
      }
    });
    position.needsUpdate = normal.needsUpdate = true;
  }
}

// A spring between two points: a helix of fixed width between straight ends.
function coil([[p], [q]], width) {
  const way = new THREE.Vector3(...q.map((v, k) => v - p[k])), side = new THREE.Vector3(Math.abs(way.x) < 0.8 * way.length() ? 1 : 0, 0, 0);
  if (!side.x) side.y = 1;
  side.addScaledVector(way, -side.dot(way) / (way.lengthSq() || 1)).normalize();
  const other = way.clone().normalize().cross(side), spine = [p], count = TURNS * PER_TURN;
  for (let i = 0; i <= count; i++) {
    const along = 0.15 + 0.7 * i / count, c = width * Math.cos(2 * Math.PI * i / PER_TURN), d = width * Math.sin(2 * Math.PI * i / PER_TURN);
    spine.push([..."xyz"].map((k, n) => p[n] + along * way[k] + c * side[k] + d * other[k]));
  }
  return [...spine, q];
}

// Values at points of a beam, and linearly between them.
function finer(values) {
  const found = [values[0]];
  for (let i = 0; i + 1 < values.length; i++) for (let j = 1; j <= FINER; j++) found.push(values[i].map((v, k) => v + j / FINER * (values[i + 1][k] - v)));
  return found;
}

function hermite(placed) {
  const spine = [placed[0][0]];
  for (let i = 0; i + 1 < placed.length; i++) {
    const [p, t] = placed[i], [q, u] = placed[i + 1], chord = q.map((v, k) => v - p[k]), length = Math.hypot(...chord);
    let m = t.map(v => v * length), n = u.map(v => v * length);
    if (!t.some(Boolean)) m = chord.map((v, k) => u.some(Boolean) ? 1.5 * v - 0.5 * n[k] : v);
    if (!u.some(Boolean)) n = chord.map((v, k) => t.some(Boolean) ? 1.5 * v - 0.5 * m[k] : v);
    for (let j = 1; j <= FINER; j++) {
      const x = j / FINER, y = 1 - x;
      spine.push(p.map((v, k) => (1 + 2 * x) * y * y * v + x * y * y * m[k] + x * x * (3 - 2 * x) * q[k] - x * x * y * n[k]));
    }
  }
  return spine;
}
