// The scene: ground, gates, planned path, ghosts, and the vehicles on their paths.

const DRAWN = 0.14; // of the scene's size, that vehicles are drawn with where they would be too small to see
const END_IN_SCENE = 0.007; // of the scene's size, the radius of the balls at start and end
const END_IN_VEHICLE = 0.05; // of the vehicle's span as it is drawn, at most: a vehicle there is seen
const ENLARGEMENTS = [1, 1.5, 2, 3, 4, 5, 6, 8, 10, 15, 20, 30, 50, 100];

class World {
  constructor(colourBy) {
    this.scene = new THREE.Scene();
    this.bounds = bounds();
    this.colourBy = colourBy;
    this.labels = [];
    this.scene.add(new THREE.HemisphereLight("#ffffff", "#b9c6d3", 2.1));
    const sun = new THREE.DirectionalLight("#ffffff", 1.9);
    sun.position.set(0.5, -0.8, 1.6);
    this.scene.add(sun);
    this.addGround();
    this.placeGates(HEADER.gates);
    if (HEADER.obstacles.triangles.length) this.scene.add(obstacleModel(HEADER.obstacles));
    this.moving = HEADER.moving.map((each) => ({ model: obstacleModel(each), places: values(each.places) }));
    for (const { model } of this.moving) this.scene.add(model);
    this.addPlan();
    this.addTracks();
    this.choose(Math.max(TRACKS.findIndex((track) => track.failed), 0));
  }

  label(text, position, kind = "") {
    const span = document.createElement("span");
    span.textContent = text;
    span.className = kind;
    document.getElementById("labels").append(span);
    this.labels.push({ span, position: vector(position) });
  }

  addGround() {
    const { lower, upper, floor, size } = this.bounds;
    const step = roundStep(size / 9);
    const pad = 0.5 * size;
    const [x0, y0] = [0, 1].map((i) => Math.floor((lower.getComponent(i) - pad) / step));
    const [x1, y1] = [0, 1].map((i) => Math.ceil((upper.getComponent(i) + pad) / step));
    for (const [every, colour] of [[1, COLOUR.hair], [5, "#c5d0da"]]) {
      const points = [];
      for (let x = x0; x <= x1; x++) if (x % every === 0) points.push(x, y0, 0, x, y1, 0);
      for (let y = y0; y <= y1; y++) if (y % every === 0) points.push(x0, y, 0, x1, y, 0);
      const shape = new THREE.BufferGeometry();
      shape.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
      const grid = new THREE.LineSegments(shape, new THREE.LineBasicMaterial({ color: colour }));
      grid.scale.set(step, step, 1);
      grid.position.z = floor + (every - 1) * 1e-5;
      this.scene.add(grid);
    }
  }

  // Draw gates, in place of those that are drawn.
  placeGates(gates) {
    if (this.gates) this.remove(this.gates);
    this.gates = new THREE.Group();
    this.movingGates = [];
    for (const gate of gates) {
      const foot = vector(gate.position);
      foot.z = Math.min(...outlineOf(gate).map((point) => point.z));
      const model = new THREE.Group().add(gateModel(gate), dropLine(foot, this.bounds.floor));
      this.gates.add(model);
      if (gate.places) this.movingGates.push({ model, places: values(gate.places) });
    }
    this.scene.add(this.gates);
  }

  addPlan() {
    const planned = drawn(values(HEADER.planned));
    const flat = planned.map((x, k) => (k % 3 === 2 ? this.bounds.floor + 1e-4 : x));
    this.scene.add(pathLine(flat, 3, "#d3dde6", 1, 1));
    this.scene.add(pathLine(planned, 8, COLOUR.band, 0.8, 2));
    const ghost = plainModel(COLOUR.sky, 0.3);
    this.ghosts = [];
    for (const { name, position, attitude } of HEADER.ghosts) {
      const copy = ghost.clone();
      copy.position.set(...position);
      copy.quaternion.set(...attitude.slice(1), attitude[0]);
      this.scene.add(copy);
      this.ghosts.push(copy);
      const isGate = HEADER.stages.some((stage) => stage.name === name && stage.gate !== null);
      if (name) this.label(name, position, isGate ? "gate" : "");
    }
    this.ends = [];
    this.addEnd(planned.slice(0, 3), COLOUR.blue, "start");
    this.addEnd(planned.slice(-3), COLOUR.ink, "end");
  }

  addEnd(position, colour, name) {
    const ball = new THREE.Mesh(new THREE.SphereGeometry(1, 20, 14), new THREE.MeshLambertMaterial({ color: colour }));
    ball.position.set(...position);
    this.scene.add(ball);
    this.ends.push(ball);
    this.label(name, position);
  }

  addTracks() {
    this.vehicle = vehicleModel();
    this.shadow = new THREE.Mesh(
      new THREE.CircleGeometry(0.5 * SPAN, 32),
      new THREE.MeshBasicMaterial({ color: COLOUR.ink, transparent: true, opacity: 0.1, depthWrite: false }),
    );
    this.drop = dropLine(new THREE.Vector3(), -1);
    this.scene.add(this.vehicle, this.shadow, this.drop);
    if (TRACKS.length === 1) return;
    const failed = TRACKS.filter((track) => track.failed);
    const fine = TRACKS.filter((track) => !track.failed);
    this.scene.add(thinLines(fine, COLOUR.blue, Math.max(0.15, fine.length ** -0.5)));
    this.scene.add(thinLines(failed, COLOUR.red, 0.8));
    const [good, bad] = [plainModel(COLOUR.sky, 0.4, false), plainModel(COLOUR.red, 0.85, false)];
    this.others = TRACKS.map((track) => (track.failed ? bad : good).clone());
    this.scene.add(...this.others);
  }

  // The round factor by which vehicles are drawn larger than they are, to be seen beside the whole scene; no
  // larger than the gates, though.
  get enlargement() {
    const widest = Math.min(...HEADER.gates.map((gate) => Math.max(gate.width, gate.height)));
    const fitting = ENLARGEMENTS.filter((step) => step === 1 || step * SPAN <= widest);
    return fitting.find((step) => step * SPAN >= 0.85 * DRAWN * this.bounds.size) ?? fitting.at(-1);
  }

  // Draw all vehicles so many times their size.
  enlarge(scale) {
    for (const model of [this.vehicle, this.shadow, ...this.ghosts, ...(this.others ?? [])]) model.scale.setScalar(scale);
    const radius = Math.min(END_IN_SCENE * this.bounds.size, END_IN_VEHICLE * SPAN * scale);
    for (const ball of this.ends) ball.scale.setScalar(radius);
  }

  // Follow another flight.
  choose(index) {
    this.track = TRACKS[index];
    this.paint();
  }

  // Draw the chosen flight's path in colours: faint in all, strong as far as it was flown.
  paint() {
    for (const line of [this.ahead, this.flown]) if (line) this.remove(line);
    const { position, speeds } = this.track;
    this.top = Math.max(...TRACKS.map((track) => greatest(track.speeds)), 1e-9);
    const colours = [];
    for (const k of DRAWN_ROWS) {
      const colour = mixed(RAMP, this.colourBy === "speed" ? speeds[k] / this.top : TIMES[k] / DURATION);
      colours.push(colour.r, colour.g, colour.b);
    }
    this.ahead = pathLine(drawn(position), 2, colours, 0.4, 3);
    this.flown = pathLine(drawn(position), 4, colours, 1, 4);
    this.scene.add(this.ahead, this.flown);
  }

  // Take a thing out of the scene, and its shapes out of the graphics card's memory. Materials stay: what they
  // hold are programs, which the next thing of the kind needs again, and software compiles for seconds.
  remove(thing) {
    thing.traverse(({ geometry }) => geometry?.dispose());
    thing.removeFromParent();
  }

  // Leave the page to another scene.
  close() {
    this.remove(this.scene);
    document.getElementById("labels").textContent = "";
  }

  // Everything as it is at a time.
  show(time) {
    const until = Math.min(time, this.track.end);
    const [before, part] = place(until);
    for (const { model, places } of [...this.moving, ...this.movingGates]) {
      const [a, b] = [before, Math.min(before + 1, places.length / 3 - 1)].map((k) => vector(places.subarray(3 * k, 3 * k + 3)));
      model.position.copy(a.lerp(b, part));
    }
    this.track.pose(until, this.vehicle);
    showThrusts(this.vehicle, this.track, until);
    const { x, y, z } = this.vehicle.position;
    this.shadow.position.set(x, y, this.bounds.floor + 2e-4);
    this.drop.position.set(x, y, 0);
    this.drop.scale.z = z - this.bounds.floor;
    this.drop.position.z = z;
    this.flown.geometry.instanceCount = Math.max(DRAWN_ROWS.findLastIndex((k) => k <= before + part + 0.5), 0);
    this.flown.visible = this.flown.geometry.instanceCount > 0;
    this.others?.forEach((model, k) => {
      model.visible = k !== this.track.index;
      if (model.visible) TRACKS[k].pose(time, model);
    });
  }

  // Write the labels where their points are on the picture [px]; one that would cover another stays away.
  placeLabels({ camera, view }, width, height) {
    const taken = [];
    for (const { span, position } of this.labels) {
      const inGate = view === "gate" && span.className === "gate"; // nothing to be told there
      const p = position.clone().project(camera);
      const [x, y] = [((p.x + 1) / 2) * width + 12, ((1 - p.y) / 2) * height - 24];
      const clear = taken.every(([a, b]) => Math.abs(a - x) > 46 || Math.abs(b - y) > 18);
      const shown = !inGate && p.z < 1 && x > 0 && y > 46 && x < width - 40 && y < height - 20 && clear;
      span.style.display = shown ? "" : "none";
      if (!shown) continue;
      taken.push([x, y]);
      span.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
    }
  }
}

function crossOf(gate) {
  return vector(gate.up).cross(vector(gate.normal));
}

// Points around a gate's opening, so many times as large as it is.
function outlineOf(gate, scale = 1) {
  const [up, across] = [vector(gate.up), crossOf(gate)];
  const point = ([left, above]) => vector(gate.position).addScaledVector(across, scale * left).addScaledVector(up, scale * above);
  return gate.outline.map(point);
}

// The box around all that is to be seen, some points that stand for it, its size and the floor below it.
function bounds() {
  const points = [];
  for (const positions of [values(HEADER.planned), ...TRACKS.map((track) => track.position)]) {
    const stride = 3 * Math.ceil((TRACKS.length * positions.length) / 3 / 3000);
    for (let k = 0; k < positions.length; k += stride) points.push(vector(positions.subarray(k, k + 3)));
  }
  for (const gate of HEADER.gates) {
    points.push(...outlineOf(gate, 1.24));
  }
  const corners = values(HEADER.obstacles.triangles);
  for (let k = 0; k < corners.length; k += 9) points.push(vector(corners.subarray(k, k + 3)));
  const [lower, upper] = [points[0].clone(), points[0].clone()];
  for (const point of points) (lower.min(point), upper.max(point));
  lower.subScalar(0.5 * SPAN);
  upper.addScalar(0.5 * SPAN);
  const size = Math.max(...upper.clone().sub(lower).toArray());
  const floor = HEADER.ground ?? lower.z - 0.03 * size;
  points.push(...points.filter((_, k) => k % 8 === 0).map(({ x, y, z }) => new THREE.Vector3(x, y, Math.max(floor, z - 0.3 * size))));
  return { lower, upper, size, floor, points };
}

function roundStep(length) {
  const decade = 10 ** Math.floor(Math.log10(length));
  return decade * [5, 2, 1].find((m) => m * decade <= length * (1 + 1e-9));
}

// A thin line of length one straight down from a point; scaled where the point moves.
function dropLine(point, floor) {
  const shape = new THREE.BufferGeometry();
  shape.setAttribute("position", new THREE.Float32BufferAttribute([0, 0, 0, 0, 0, -1], 3));
  const line = new THREE.LineSegments(shape, new THREE.LineBasicMaterial({ color: COLOUR.faint }));
  line.position.copy(point);
  line.scale.z = point.z - floor;
  return line;
}
