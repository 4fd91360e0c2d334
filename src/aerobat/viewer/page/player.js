// The page: its controls, its clock, and what is drawn when.

const SPEEDS = [0.05, 0.1, 0.25, 0.5, 1, 2, 4];
const LONGEST = 0.25; // [s] that a frame counts for: whoever looks elsewhere meanwhile misses nothing
const STEPS = 100; // presses of an arrow key from start to end
const SLOW = 0.05; // [s] a frame: what is drawn slower than that is drawn coarser while it plays,
const COARSER = 0.7; // of the pixels across, each time,
const COARSEST = 0.5; // down to this part of them
const PACE = 0.3; // of the mean time of a frame, the weight of the last
const ICONS = { play: "M5 2l14 9-14 9z", pause: "M4 2h5v18H4zM13 2h5v18h-5z", again: "M11 3a8 8 0 1 0 8 8h-3a5 5 0 1 1-5-5v4l7-5.500-7-5.500z" };
const element = (id) => document.getElementById(id);

class Player {
  constructor() {
    this.time = 0;
    this.playing = false;
    this.repeats = false; // from the start when it has come to the end
    this.frames = 0;
    this.stale = true;
    this.fineness = 1; // of pixels across, the part that is drawn
    this.open();
    for (const speed of SPEEDS) element("speed").add(new Option(`${speed}×`, speed));
    this.speed = DURATION < 1.5 ? 0.25 : DURATION < 5 ? 0.5 : 1; // what is short is shown slowly
    element("speed").value = this.speed;
    this.listen();
    this.show();
    this.view("orbit");
    this.resize();
    this.tick = this.tick.bind(this);
    requestAnimationFrame(this.tick);
  }

  open() {
    const canvas = element("canvas");
    try {
      this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
      this.cameras = new Cameras(canvas);
      this.cameras.controls.addEventListener("change", () => (this.stale = true));
    } catch (error) {
      element("sorry").hidden = false;
      element("sorry").textContent = "This browser has no WebGL, so that nothing is drawn in space; the plots show the flight.";
      for (const id of ["views", "corner"]) element(id).hidden = true;
      console.warn(error);
    }
  }

  // The scene that is loaded, at the same part of its time as the one before it.
  show() {
    this.time = this.duration ? (this.time / this.duration) * DURATION : 0;
    this.duration = DURATION;
    this.trueSize = TRACKS.length > 1; // of many, how far they spread is the point
    this.fill();
    this.plots = new Plots((time) => this.seek(time));
    if (this.renderer) {
      const colourBy = this.world?.colourBy ?? "speed";
      this.world?.close();
      this.world = new World(colourBy);
      this.world.show(this.time);
      this.cameras.look(this.world);
      this.enlarge();
    }
    this.choose(this.world?.track.index ?? 0);
    this.mark();
  }

  fill() {
    element("title").textContent = HEADER.title;
    element("facts").textContent = element("flight").textContent = "";
    HEADER.facts.forEach((fact, k) => {
      const span = document.createElement("span");
      span.textContent = fact;
      if (k === 0 && !HEADER.isWell) span.className = "wrong";
      element("facts").append(span);
    });
    element("choice").hidden = TRACKS.length === 1;
    for (const track of TRACKS) element("flight").add(new Option(`${track.failed ? "✗ " : ""}${track.name}: ${track.sentence}`, track.index));
    document.querySelector("[data-view=gate]").hidden = !HEADER.gates.length;
  }

  // Stages along the time bar; names where there is room.
  mark() {
    const width = element("marks").clientWidth;
    element("marks").textContent = "";
    let end = -Infinity;
    const byRank = [...HEADER.stages].sort((a, b) => (b.gate !== null) - (a.gate !== null) || a.time - b.time);
    const taken = [];
    for (const { name, time, gate } of byRank) {
      const left = `${(100 * time) / DURATION}%`;
      const tick = document.createElement("i");
      tick.style.left = left;
      tick.className = gate === null ? "" : "gate";
      element("marks").append(tick);
      const [x, half] = [(time / DURATION) * width, 3.4 * name.length + 4];
      if (taken.some(([a, b]) => Math.abs(a - x) < b + half)) continue;
      taken.push([x, half]);
      const text = document.createElement("span");
      text.style.left = left;
      text.textContent = name;
      element("marks").append(text);
    }
  }

  listen() {
    element("play").onclick = () => this.toggle();
    element("time").oninput = () => this.seek(element("time").value * DURATION);
    element("speed").onchange = () => (this.speed = +element("speed").value);
    element("flight").onchange = () => this.choose(+element("flight").value);
    element("previous").onclick = () => this.choose(this.plots.focus - 1);
    element("next").onclick = () => this.choose(this.plots.focus + 1);
    element("legend").onclick = () => this.recolour();
    element("size").onclick = () => this.resizeVehicle();
    for (const button of document.querySelectorAll("[data-view]")) button.onclick = () => this.view(button.dataset.view);
    addEventListener("keydown", (event) => this.press(event));
    new ResizeObserver(() => this.resize()).observe(element("stage"));
    new ResizeObserver(() => this.resize()).observe(element("plots"));
  }

  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const step = (event.shiftKey ? 10 : 1) * (DURATION / STEPS);
    const keys = {
      " ": () => this.toggle(),
      ArrowLeft: () => this.seek(this.time - step),
      ArrowRight: () => this.seek(this.time + step),
      Home: () => this.seek(0),
      End: () => this.seek(DURATION),
      1: () => this.view("orbit"),
      2: () => this.view("follow"),
      3: () => this.view("gate"),
      ArrowUp: () => this.faster(1),
      ArrowDown: () => this.faster(-1),
      "[": () => this.choose(this.plots.focus - 1),
      "]": () => this.choose(this.plots.focus + 1),
      c: () => this.recolour(),
      s: () => this.resizeVehicle(),
    };
    const isList = event.target.tagName === "SELECT" && event.key.startsWith("Arrow");
    if (!(event.key in keys) || isList) return;
    event.preventDefault();
    keys[event.key]();
  }

  toggle() {
    if (!this.playing && this.time >= DURATION) this.seek(0);
    this.playing = !this.playing;
    [this.last, this.pace] = [null, 0];
    this.icon();
  }

  icon() {
    const [name, word] = this.playing ? ["pause", "Pause"] : this.time >= DURATION ? ["again", "Play again"] : ["play", "Play"];
    if (this.shownIcon === name) return;
    this.shownIcon = name;
    element("play").innerHTML = `<svg viewBox="0 0 22 22"><path d="${ICONS[name]}"/></svg>`;
    element("play").setAttribute("aria-label", word);
  }

  seek(time) {
    this.time = Math.min(Math.max(time, 0), DURATION);
    this.stale = true;
  }

  faster(steps) {
    const k = Math.min(Math.max(SPEEDS.indexOf(this.speed) + steps, 0), SPEEDS.length - 1);
    this.speed = SPEEDS[k];
    element("speed").value = this.speed;
  }

  view(name) {
    if (name === "gate" && !HEADER.gates.length) return;
    this.world?.show(this.time);
    this.cameras?.take(name);
    this.enlarge();
    for (const button of document.querySelectorAll("[data-view]"))
      button.setAttribute("aria-pressed", button.dataset.view === name);
    this.stale = true;
  }

  // Draw vehicles larger than they are where all is seen from afar, unless told not to.
  enlarge() {
    if (!this.world) return;
    const { enlargement } = this.world;
    const scale = this.trueSize || this.cameras.view !== "orbit" ? 1 : enlargement;
    this.world.enlarge(scale);
    this.world.vehicle.shell.visible = this.cameras.view === "gate"; // whether it fits is asked there
    element("size").hidden = enlargement === 1 || this.cameras.view !== "orbit";
    element("size").textContent = `vehicle ×${scale}`;
    this.stale = true;
  }

  choose(index) {
    const focus = (index + TRACKS.length) % TRACKS.length;
    this.world?.choose(focus);
    this.plots.choose(focus);
    this.plots.draw();
    element("flight").value = focus;
    element("flight").className = TRACKS[focus].failed ? "wrong" : "";
    this.legend();
    this.stale = true;
  }

  recolour() {
    if (!this.world) return;
    this.world.colourBy = this.world.colourBy === "speed" ? "time" : "speed";
    this.world.paint();
    this.legend();
    this.stale = true;
  }

  resizeVehicle() {
    this.trueSize = !this.trueSize;
    this.enlarge();
  }

  legend() {
    if (!this.world) return;
    const [name, top] = this.world.colourBy === "speed" ? ["speed", `${label(+this.world.top.toPrecision(3))} m/s`] : ["time", `${DURATION.toFixed(2)} s`];
    const ramp = RAMP.map((colour) => `#${colour.getHexString()}`).join(",");
    element("legend").innerHTML = `${name} 0<i style="background:linear-gradient(90deg,${ramp})"></i>${top}`;
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = element("stage");
    if (this.world && width && height) {
      this.renderer.setPixelRatio(this.fineness * Math.min(devicePixelRatio, 2));
      this.renderer.setSize(width, height, false);
      this.cameras.resize(width, height);
    }
    this.plots.draw();
    this.mark();
    this.stale = true;
  }

  tick(now) {
    requestAnimationFrame(this.tick);
    if (this.playing) this.advance(this.last === null ? 0 : (now - this.last) / 1000);
    this.last = this.playing ? now : null;
    this.refine(this.playing ? this.fineness : 1);
    if (!this.stale) return;
    this.stale = false;
    this.draw();
  }

  // Play on by so much of the viewer's time [s].
  advance(elapsed) {
    this.time += this.speed * Math.min(elapsed, LONGEST);
    this.stale = true;
    if (this.time >= DURATION) [this.time, this.playing] = this.repeats ? [0, true] : [DURATION, false];
    this.pace = (1 - PACE) * this.pace + PACE * elapsed;
    if (this.pace < SLOW || this.fineness <= COARSEST) return;
    this.pace = 0; // of what is drawn coarser nothing is known yet
    this.refine(Math.max(COARSER * this.fineness, COARSEST));
  }

  // Draw this part of all pixels across.
  refine(fineness) {
    if (fineness === this.fineness) return;
    this.fineness = fineness;
    this.renderer?.setPixelRatio(fineness * Math.min(devicePixelRatio, 2));
    this.stale = true;
  }

  draw() {
    this.icon();
    element("time").value = this.time / DURATION;
    element("clock").innerHTML = `${this.time.toFixed(3)} <small>/ ${DURATION.toFixed(3)} s</small>`;
    this.plots.seek(this.time);
    if (!this.world) return;
    this.world.show(this.time);
    this.cameras.follow();
    this.renderer.render(this.world.scene, this.cameras.camera);
    const { clientWidth, clientHeight } = element("stage");
    this.world.placeLabels(this.cameras, clientWidth, clientHeight);
    this.frames += 1;
  }
}

load(JSON.parse(element("header").textContent), element("arrays").textContent);
window.replay = new Player(); // for whoever embeds the page: seek(), toggle(), view(), time
