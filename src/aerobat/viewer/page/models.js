// Vehicles, gates and paths as shapes. Lengths are true: nothing is drawn larger than it is.

const COLOUR = {
  ink: "#1c2b39", muted: "#66788a", faint: "#a9b6c2", hair: "#dfe6ec", blue: "#004488", sky: "#6fa3d4",
  yellow: "#ddaa33", red: "#c8334e", band: "#b4c8dd",
};
const RAMP = ["#3b2a78", "#2c5fa8", "#1f8f9a", "#35b779", "#9ad13c"].map((c) => new THREE.Color(c)); // slow to fast
const DISC = ["#e3edf7", "#8db7e0", "#004488"].map((c) => new THREE.Color(c)); // least to greatest thrust
const BAR = 0.12; // a gate's bars, of the opening's shorter side
const MAST = 0.35; // of a rotor's radius

function mixed(ramp, fraction) {
  const x = Math.min(Math.max(fraction, 0), 1) * (ramp.length - 1);
  const k = Math.min(Math.floor(x), ramp.length - 2);
  return ramp[k].clone().lerp(ramp[k + 1], x - k);
}

function vector(list) {
  return new THREE.Vector3(...list);
}

// A rod between two points.
function rod(from, to, radius) {
  const along = to.clone().sub(from);
  const shape = new THREE.CylinderGeometry(radius, radius, along.length(), 6, 1, true);
  const turn = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.normalize());
  return shape.applyQuaternion(turn).translate(...from.clone().add(to).multiplyScalar(0.5).toArray());
}

// The parts of a vehicle but for its discs: body, nose, arms, masts and, if asked, rims, as one shape with colours.
function airframe(accent, rims = true) {
  const s = SPAN;
  const parts = [
    [new THREE.BoxGeometry(0.3 * s, 0.16 * s, 0.075 * s), COLOUR.ink],
    [new THREE.BoxGeometry(0.16 * s, 0.1 * s, 0.05 * s).translate(-0.02 * s, 0, 0.055 * s), COLOUR.muted],
    [new THREE.ConeGeometry(0.05 * s, 0.1 * s, 12).rotateZ(-Math.PI / 2).translate(0.19 * s, 0, 0), accent],
  ];
  for (const rotor of HEADER.rotors) {
    const hub = vector(rotor.position);
    const top = hub.clone().add(vector([0, 0, MAST * rotor.radius]));
    parts.push([rod(vector([0, 0, 0]), hub, 0.018 * s), COLOUR.ink]);
    parts.push([rod(hub, top, 0.028 * s), COLOUR.ink]);
    if (!rims) continue;
    const front = rotor.position[0] > 1e-6; // rims of the front rotors tell where the nose is
    parts.push([
      new THREE.TorusGeometry(rotor.radius, 0.007 * s, 4, 28).translate(...top.toArray()),
      front ? accent : COLOUR.ink,
    ]);
  }
  return merged(parts);
}

function merged(parts) {
  return THREE.mergeGeometries(
    parts.map(([shape, colour]) => {
      const plain = shape.index ? shape.toNonIndexed() : shape;
      plain.deleteAttribute("uv");
      const c = new THREE.Color(colour);
      const count = plain.attributes.position.count;
      const rows = Float32Array.from({ length: 3 * count }, (_, k) => [c.r, c.g, c.b][k % 3]);
      return plain.setAttribute("color", new THREE.Float32BufferAttribute(rows, 3));
    }),
  );
}

function disc(rotor) {
  const shape = new THREE.CircleGeometry(rotor.radius, 24);
  return shape.translate(rotor.position[0], rotor.position[1], rotor.position[2] + MAST * rotor.radius);
}

// A vehicle whose discs show the thrusts of their rotors, with an arrow of them all and the ellipsoid by which its
// clearance is judged.
function vehicleModel() {
  const model = new THREE.Group();
  model.add(new THREE.Mesh(airframe(COLOUR.sky), new THREE.MeshLambertMaterial({ vertexColors: true })));
  model.discs = HEADER.rotors.map((rotor) => {
    const above = new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.85, depthWrite: false });
    const below = new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.85, depthWrite: false, side: 1 });
    model.add(new THREE.Mesh(disc(rotor), above), new THREE.Mesh(disc(rotor), below));
    return [above, below];
  });
  model.arrow = new THREE.Group();
  const paint = new THREE.MeshLambertMaterial({ color: COLOUR.blue });
  const shaft = new THREE.CylinderGeometry(0.014 * SPAN, 0.014 * SPAN, 1, 10).rotateX(Math.PI / 2).translate(0, 0, 0.5);
  model.shaft = new THREE.Mesh(shaft, paint);
  const head = new THREE.ConeGeometry(0.042 * SPAN, 0.13 * SPAN, 16).rotateX(Math.PI / 2);
  model.head = new THREE.Mesh(head, paint);
  model.arrow.add(model.shaft, model.head);
  model.add(model.arrow);
  const glass = new THREE.MeshBasicMaterial({ color: COLOUR.sky, transparent: true, opacity: 0.13, depthWrite: false });
  model.shell = new THREE.Mesh(new THREE.SphereGeometry(1, 32, 20), glass);
  model.shell.scale.set(...HEADER.body.semiAxes);
  model.shell.position.set(...HEADER.body.centre);
  model.add(model.shell);
  return model;
}

// Tint the discs and stretch the arrow for thrusts [N] at a time.
function showThrusts(model, track, time) {
  let total = 0;
  HEADER.rotors.forEach((rotor, i) => {
    const thrust = track.thrust(time, i);
    total += thrust;
    const range = rotor.max - rotor.min;
    const colour = mixed(DISC, range > 0 ? (thrust - rotor.min) / range : 0);
    model.discs[i][0].color.copy(colour);
    model.discs[i][1].color.copy(colour).lerp(new THREE.Color("white"), 0.6); // upright tells from inverted
  });
  const size = 0.42 * SPAN * (total / HEADER.weight); // in hover less than half the span
  model.arrow.visible = Math.abs(size) > 0.02 * SPAN;
  model.shaft.scale.z = size || 1e-9;
  model.head.position.z = size;
  model.head.rotation.x = size < 0 ? Math.PI : 0;
}

// Vehicles that stand still in pictures, or are many: one shape each.
function plainModel(accent, opacity, rims = true) {
  const discs = HEADER.rotors.map((rotor) => [disc(rotor), accent]);
  // in one pass: which side of what is so faint comes first is not seen
  const paint = { vertexColors: true, transparent: true, opacity, side: THREE.DoubleSide, forceSinglePass: true };
  const model = new THREE.Group();
  model.add(new THREE.Mesh(airframe(accent, rims), new THREE.MeshLambertMaterial(paint)));
  const pale = { ...paint, opacity: 0.45 * opacity, depthWrite: false };
  model.add(new THREE.Mesh(merged(discs), new THREE.MeshBasicMaterial(pale)));
  return model;
}

// The bar outside one side of an outline, anticlockwise in y and z, as far beyond its ends as it meets the next ones.
function bar(outline, k, thick) {
  const point = (i) => outline[(k + i + outline.length) % outline.length];
  const heading = (i) => Math.atan2(point(i + 1)[1] - point(i)[1], point(i + 1)[0] - point(i)[0]);
  const beyond = (i) => thick * Math.min(Math.abs(Math.tan((heading(i) - heading(i - 1)) / 2)), 4);
  const [[y, z], [nextY, nextZ], before, behind] = [point(0), point(1), beyond(0), beyond(1)];
  const shape = new THREE.BoxGeometry(thick, Math.hypot(nextY - y, nextZ - z) + before + behind, thick);
  shape.translate(0, (behind - before) / 2, -thick / 2).rotateX(heading(0));
  return shape.translate(0, (y + nextY) / 2, (z + nextZ) / 2);
}

function gateModel(gate) {
  const model = new THREE.Group();
  const thick = BAR * Math.min(gate.width, gate.height);
  const top = Math.max(...gate.outline.map(([, up]) => up));
  const bars = gate.outline.map((_, k) => [bar(gate.outline, k, thick), COLOUR.yellow]);
  const upright = new THREE.ConeGeometry(0.5 * thick, 0.9 * thick, 3).rotateX(Math.PI / 2);
  bars.push([upright.translate(0, 0, top + 1.5 * thick), COLOUR.yellow]); // on the side that is the gate's up
  model.add(new THREE.Mesh(merged(bars), new THREE.MeshLambertMaterial({ vertexColors: true })));
  const [x, z] = [vector(gate.normal), vector(gate.up)];
  model.matrix.makeBasis(x, z.clone().cross(x), z).setPosition(...gate.position);
  model.matrixAutoUpdate = false;
  return model;
}

// Obstacles as glass, with lines where their faces meet.
function obstacleModel({ triangles, edges }) {
  const glass = new THREE.BufferGeometry();
  glass.setAttribute("position", new THREE.Float32BufferAttribute(values(triangles), 3));
  glass.computeVertexNormals();
  const lines = new THREE.BufferGeometry();
  lines.setAttribute("position", new THREE.Float32BufferAttribute(values(edges), 3));
  const paint = { transparent: true, depthWrite: false };
  const model = new THREE.Group();
  model.add(new THREE.Mesh(glass, new THREE.MeshLambertMaterial({ ...paint, color: COLOUR.faint, opacity: 0.35 })));
  model.add(new THREE.LineSegments(lines, new THREE.LineBasicMaterial({ ...paint, color: COLOUR.muted, opacity: 0.6 })));
  return model;
}

// The rows of a series that are drawn.
function drawn(series) {
  return DRAWN_ROWS.flatMap((k) => [...series.subarray(3 * k, 3 * k + 3)]);
}

// A path as a wide line [px], with a colour for each row or one for all, drawn in an order among such lines.
function pathLine(position, width, colours, opacity, order) {
  const shape = new THREE.LineGeometry();
  shape.setPositions(position);
  const plain = typeof colours === "string";
  if (!plain) shape.setColors(colours);
  const paint = new THREE.LineMaterial({
    linewidth: width, vertexColors: !plain, transparent: true, opacity, depthWrite: false,
  });
  if (plain) paint.color.set(colours);
  const line = new THREE.Line2(shape, paint);
  line.frustumCulled = false;
  line.renderOrder = order; // of lines in one place the last is seen
  return line;
}

// Thin lines of many paths, as one shape.
function thinLines(tracks, colour, opacity) {
  const points = [];
  for (const track of tracks) {
    const last = place(track.end)[0];
    const rows = DRAWN_ROWS.filter((k) => k <= last);
    for (let i = 1; i < rows.length; i++)
      for (const k of [rows[i - 1], rows[i]]) points.push(...track.position.subarray(3 * k, 3 * k + 3));
  }
  const shape = new THREE.BufferGeometry();
  shape.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
  return new THREE.LineSegments(shape, new THREE.LineBasicMaterial({ color: colour, transparent: true, opacity }));
}
