"use strict";
// The numbers of the scene that is shown, and a vehicle's pose between its rows.

const KINDS = { f4: Float32Array, i2: Int16Array };
const VERTICES = 220; // of a drawn path: what software renders is slow by the piece

// Of the scene that `load` took last.
let HEADER, BYTES, TIMES, DURATION, TRACKS;
let DRAWN_ROWS; // of all rows, those that paths are drawn of
let SPAN; // [m] of the vehicle, over its rotors

// Take a scene: its header, and its arrays as Base64.
function load(header, arrays) {
  HEADER = header;
  BYTES = decoded(arrays);
  TIMES = values(header.times);
  DURATION = TIMES[TIMES.length - 1];
  DRAWN_ROWS = [...new Set(Array.from({ length: VERTICES + 1 }, (_, k) => Math.round((k / VERTICES) * (TIMES.length - 1))))];
  SPAN = 2 * Math.max(...header.rotors.map((r) => Math.hypot(r.position[0], r.position[1]) + r.radius));
  TRACKS = header.tracks.map((track, index) => new Track(track, index));
}

function decoded(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
  return bytes.buffer;
}

// The values of an array of the header.
function values({ kind, offset, length, scale }) {
  const raw = new KINDS[kind](BYTES, offset, length);
  return kind === "f4" ? raw : Float32Array.from(raw, (x) => x * scale);
}

// The row at or before a time, and how far it is to the next, 0 to 1.
function place(time) {
  let low = 0;
  let high = TIMES.length - 1;
  if (time >= TIMES[high]) return [high - 1, 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (TIMES[middle] <= time) low = middle;
    else high = middle;
  }
  return [low, Math.max(0, (time - TIMES[low]) / (TIMES[low + 1] - TIMES[low]))];
}

// A number of some series of `width` to a row, between its rows.
function between(series, width, column, [row, part]) {
  const k = row * width + column;
  return series[k] + part * (series[k + width] - series[k]);
}

class Track {
  constructor(header, index) {
    Object.assign(this, header, { index });
    this.position = values(header.position);
    this.attitude = values(header.attitude);
    this.thrusts = values(header.thrusts);
    this.speeds = this.speed();
  }

  // Speed at each row [m/s], by differences.
  speed() {
    const p = this.position;
    const last = TIMES.length - 1;
    return Float32Array.from(TIMES, (_, k) => {
      const [a, b] = [Math.max(k - 1, 0), Math.min(k + 1, last)];
      const step = [0, 1, 2].map((i) => p[3 * b + i] - p[3 * a + i]);
      return Math.hypot(...step) / (TIMES[b] - TIMES[a]);
    });
  }

  // Put an object where the vehicle is at a time, in its attitude.
  pose(time, object) {
    const at = place(Math.min(time, this.end));
    object.position.set(...[0, 1, 2].map((i) => between(this.position, 3, i, at)));
    const k = 4 * at[0];
    const q = this.attitude;
    const side = q[k] * q[k + 4] + q[k + 1] * q[k + 5] + q[k + 2] * q[k + 6] + q[k + 3] * q[k + 7] < 0 ? -1 : 1;
    const [w, x, y, z] = [0, 1, 2, 3].map((i) => (1 - at[1]) * q[k + i] + at[1] * side * q[k + 4 + i]);
    object.quaternion.set(x, y, z, w).normalize();
  }

  // Thrust of a rotor [N] at a time.
  thrust(time, rotor) {
    return between(this.thrusts, HEADER.rotors.length, rotor, place(Math.min(time, this.end)));
  }
}
