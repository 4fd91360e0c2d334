// Three cameras: around the whole scene, with the vehicle, and through a gate. Each can be turned and zoomed.

const FIELD = 38; // [deg] of view, up and down
const WIDTH_FILLED = 0.84; // of the picture by the whole scene
const EDGES = [0.09, 0.13]; // of its height that stay free above and below it, where there are no buttons

class Cameras {
  constructor(canvas) {
    this.camera = new THREE.PerspectiveCamera(FIELD, 1);
    this.camera.up.set(0, 0, 1);
    this.controls = new THREE.OrbitControls(this.camera, canvas);
    this.view = "orbit";
    this.gate = 0;
    this.touched = false;
    this.controls.addEventListener("start", () => (this.touched = true));
  }

  // Look at a world; at another than before in the same way.
  look(world) {
    this.world = world;
    [this.camera.near, this.camera.far] = [0.01 * SPAN, 100 * world.bounds.size];
    [this.controls.minDistance, this.controls.maxDistance] = [0.6 * SPAN, 8 * world.bounds.size];
    this.camera.updateProjectionMatrix();
    this.frame();
  }

  // Take a view; through the gate once more, through the next gate.
  take(view) {
    if (view === "gate" && this.view === "gate") this.gate = (this.gate + 1) % HEADER.gates.length;
    this.view = view;
    this.touched = false;
    this.widest = null;
    this.frame();
  }

  // Stand where the view is best, unless somebody has moved the camera since.
  frame() {
    if (this.touched) return;
    const [target, offset] = { orbit: () => this.whole(), follow: () => this.chase(), gate: () => this.through() }[this.view]();
    this.controls.target.copy(target);
    this.camera.position.copy(target).add(offset);
    this.controls.update();
  }

  // Move along with the vehicle, if it is followed.
  follow() {
    if (this.view !== "follow") return;
    const step = this.world.vehicle.position.clone().sub(this.controls.target);
    this.controls.target.add(step);
    this.camera.position.add(step);
    this.camera.lookAt(this.controls.target);
  }

  resize(width, height) {
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.widest = null;
    this.frame();
  }

  whole() {
    const direction = (this.widest ??= bestDirection(this.world.bounds, this.camera.aspect)).clone();
    return fitted(this.world.bounds.points, direction, this.camera.aspect, edges(this.camera.aspect));
  }

  chase() {
    const offset = bestDirection(this.world.bounds, 1).multiplyScalar(4.8 * SPAN);
    return [this.world.vehicle.position.clone(), offset];
  }

  // From behind the gate, a little to the side, toward the vehicle that comes through.
  through() {
    const gate = HEADER.gates[this.gate];
    const [normal, across] = [vector(gate.normal), crossOf(gate)];
    const distance = 2.5 * Math.max(gate.width, gate.height, 1.5 * SPAN) / Math.min(this.camera.aspect, 1);
    const offset = normal.multiplyScalar(distance).addScaledVector(across, 0.28 * distance);
    offset.z += 0.22 * distance;
    return [vector(gate.position), offset];
  }
}

// The direction from which the path spreads widest and gates are seen open, x to the right among equals.
function bestDirection({ lower, upper }, aspect) {
  const planned = values(HEADER.planned);
  let [best, found] = [-1, null];
  for (let degrees = -180; degrees < 180; degrees += 5) {
    const azimuth = (degrees * Math.PI) / 180;
    const direction = new THREE.Vector3(Math.cos(azimuth), Math.sin(azimuth), 0);
    const right = new THREE.Vector3(-direction.y, direction.x, 0);
    let [low, high] = [Infinity, -Infinity];
    for (let k = 0; k < planned.length; k += 3) {
      const x = planned[k] * right.x + planned[k + 1] * right.y;
      [low, high] = [Math.min(low, x), Math.max(high, x)];
    }
    const openness = HEADER.gates.map((gate) => Math.abs(vector(gate.normal).dot(direction)));
    const depth = Math.min(1, Math.min(Math.abs(direction.x), Math.abs(direction.y)) / 0.3);
    const travel = vector(planned.slice(-3)).sub(vector(planned.slice(0, 3)));
    const onward = travel.dot(right) / Math.max(travel.length(), 1);
    const spread = (high - low + 0.1 * (upper.z - lower.z)) * Math.sqrt(Math.min(1, ...openness) + 0.02);
    const score = spread * Math.sqrt(depth + 0.05) * (1 + 0.15 * onward + 0.02 * Math.cos(azimuth + Math.PI / 3));
    if (score > best) [best, found] = [score, direction];
  }
  return found.setZ(aspect < 1 ? 0.25 : 0.3).normalize();
}

// Parts of the picture's height that buttons take above and below, where they take its whole width.
function edges(aspect) {
  if (aspect > 1.2) return EDGES;
  const [stage, views, choice, corner] = ["stage", "views", "choice", "corner"].map((id) => document.getElementById(id).getBoundingClientRect());
  const top = Math.max(views.bottom, choice.bottom) - stage.top;
  return [(top + 8) / stage.height, (stage.bottom - corner.top + 8) / stage.height];
}

// Where to look, and from how far in a direction, to have all points in the picture and its middle.
function fitted(points, direction, aspect, [above, below]) {
  const probe = new THREE.PerspectiveCamera(FIELD, aspect, 1e-3, 1e6);
  probe.up.set(0, 0, 1);
  const target = points.reduce((sum, point) => sum.add(point), new THREE.Vector3()).divideScalar(points.length);
  let distance = 4 * Math.max(...points.map((point) => point.distanceTo(target)));
  for (let round = 0; round < 12; round++) {
    probe.position.copy(target).addScaledVector(direction, distance);
    probe.lookAt(target);
    probe.updateMatrixWorld();
    const seen = points.map((point) => point.clone().project(probe));
    const [left, right, low, high] = [
      Math.min(...seen.map((p) => p.x)), Math.max(...seen.map((p) => p.x)),
      Math.min(...seen.map((p) => p.y)), Math.max(...seen.map((p) => p.y)),
    ];
    const half = distance * Math.tan((FIELD * Math.PI) / 360); // [m] half the picture's height at the target
    const [across, up] = [0, 1].map((k) => new THREE.Vector3().setFromMatrixColumn(probe.matrixWorld, k));
    target.addScaledVector(across, (half * aspect * (left + right)) / 2).addScaledVector(up, half * ((low + high) / 2 - (below - above)));
    distance *= Math.max((right - left) / 2 / WIDTH_FILLED, (high - low) / 2 / (1 - above - below));
  }
  return [target, direction.clone().multiplyScalar(distance)];
}
