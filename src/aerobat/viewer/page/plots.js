// Quantities over time, with a cursor that moves along; a press on one seeks.

const LENGTHS = [["m", 1], ["cm", 0.01]];
const LEAST = 0.01; // of an axis, in its unit: what is smaller is noise
const SPINS = { 1: ["#00315f", "#6fa3d4"], "-1": ["#1c2b39", "#9aa5b0"] }; // dark to light, by the sense of turning
const EDGE = { left: 44, right: 4, top: 5, bottom: 19 }; // [px] around a plot
const NS = "http://www.w3.org/2000/svg";

class Plot {
  constructor(name, unit, lines, { limits = [], legend = false } = {}) {
    Object.assign(this, { name, unit, lines, limits, legend });
    this.root = document.createElement("div");
    this.root.className = "plot";
    this.root.innerHTML = "<h2><span></span><b></b></h2><div><svg></svg><svg class='moving'></svg></div>";
    this.root.querySelector("span").textContent = `${name} [${unit}]`;
    this.readout = this.root.querySelector("b");
    [this.svg, this.moving] = this.root.querySelectorAll("svg");
    document.getElementById("plots").append(this.root);
    const every = lines.flatMap((line) => [least(line.values), greatest(line.values)]);
    this.low = Math.min(0, ...every, ...limits);
    this.high = Math.max(...every, ...limits, LEAST);
    const pad = 0.07 * (this.high - this.low);
    this.high += pad;
    if (this.low < 0 || limits.length) this.low -= pad;
  }

  x(time) {
    return EDGE.left + (time / DURATION) * (this.width - EDGE.left - EDGE.right);
  }

  y(value) {
    const part = (value - this.low) / (this.high - this.low);
    return this.height - EDGE.bottom - part * (this.height - EDGE.top - EDGE.bottom);
  }

  // Draw all but the cursor.
  draw(focus) {
    const box = this.svg.parentElement.getBoundingClientRect();
    [this.width, this.height] = [box.width, box.height];
    const [left, right, foot] = [this.x(0), this.x(DURATION), this.y(this.low)];
    const parts = [];
    for (const value of ticks(this.low, this.high, Math.max(2, Math.round(this.height / 38)))) {
      const y = this.y(value);
      parts.push(`<path d="M${left} ${y}H${right}" stroke="#e6ecf1"/>`);
      parts.push(`<text x="${left - 6}" y="${y + 4}" text-anchor="end">${label(value)}</text>`);
    }
    for (const time of ticks(0, DURATION, Math.max(3, Math.round(this.width / 60))))
      parts.push(`<text x="${this.x(time)}" y="${this.height - 4}" text-anchor="middle">${label(time)}${time ? "" : " s"}</text>`);
    for (const stage of HEADER.stages) {
      const [colour, width] = stage.gate === null ? [COLOUR.faint, 0.8] : [COLOUR.yellow, 2];
      parts.push(`<path d="M${this.x(stage.time)} ${this.y(this.high)}V${foot}" stroke="${colour}" stroke-width="${width}"/>`);
    }
    for (const limit of this.limits)
      parts.push(`<path d="M${left} ${this.y(limit)}H${right}" stroke="${COLOUR.ink}" stroke-dasharray="5 3"/>`);
    const behind = this.lines.length > 1 && !this.legend;
    this.lines.forEach((line, k) => {
      if (behind && k === focus) return;
      parts.push(this.path(line, behind ? 0.25 : 1, this.legend ? 1.4 : 1));
    });
    if (!this.legend) parts.push(this.path(this.lines[focus], 1, 1.7));
    this.svg.innerHTML = parts.join("");
    this.moving.innerHTML = `<path class="cursor" stroke="${COLOUR.ink}" stroke-width="1.2"/>`;
    this.cursor = this.moving.querySelector(".cursor");
    this.dots = this.shown(focus).map((line) => {
      const dot = document.createElementNS(NS, "circle");
      dot.setAttribute("r", 3.4);
      dot.setAttribute("fill", line.colour);
      dot.setAttribute("stroke", "white");
      this.moving.append(dot);
      return dot;
    });
  }

  path({ values: series, colour, end }, opacity, width) {
    const points = [];
    for (let k = 0; k < TIMES.length && TIMES[k] <= end + 1e-9; k++)
      points.push(`${this.x(TIMES[k]).toFixed(1)} ${this.y(series[k]).toFixed(1)}`);
    return `<path d="M${points.join("L")}" fill="none" stroke="${colour}" stroke-width="${width}" opacity="${opacity}" stroke-linejoin="round"/>`;
  }

  // The lines whose values are told: of one flight.
  shown(focus) {
    return this.legend ? this.lines : [this.lines[focus]];
  }

  // Move the cursor to a time.
  seek(time, focus) {
    const lines = this.shown(focus);
    const at = place(Math.min(time, lines[0].end));
    this.cursor.setAttribute("d", `M${this.x(time)} ${this.y(this.high)}V${this.y(this.low)}`);
    const now = lines.map((line) => between(line.values, 1, 0, at));
    this.dots.forEach((dot, k) => {
      dot.setAttribute("cx", this.x(Math.min(time, lines[k].end)));
      dot.setAttribute("cy", this.y(now[k]));
    });
    const digits = this.high >= 100 ? 0 : this.high >= 10 || (this.legend && this.high > 1) ? 1 : this.high >= 1 ? 2 : this.legend ? 3 : 4;
    if (!this.legend) this.readout.textContent = `${now[0].toFixed(digits)} ${this.unit}`;
    else if (lines.length > 4) this.readout.textContent = `${lines.length} rotors: ${Math.min(...now).toFixed(digits)} to ${Math.max(...now).toFixed(digits)} N`;
    else this.readout.innerHTML = lines.map((line, k) => `<i style="background:${line.colour}">${k}</i>${now[k].toFixed(digits)}`).join("");
  }
}

// The plots of the page, for the flight in focus.
class Plots {
  constructor(seek) {
    this.focus = 0;
    this.root = document.getElementById("plots");
    this.root.textContent = "";
    this.plots = HEADER.curves.map((curve) => curvePlot(curve));
    this.rotors = null;
    const press = (event) => {
      const plot = this.all().find((one) => one.root.contains(event.target));
      if (!plot || (event.type === "pointermove" && event.buttons !== 1)) return;
      const box = plot.svg.getBoundingClientRect();
      const part = (event.clientX - box.left - EDGE.left) / (box.width - EDGE.left - EDGE.right);
      seek(Math.min(Math.max(part, 0), 1) * DURATION);
    };
    this.root.onpointerdown = this.root.onpointermove = press;
    this.choose(0);
  }

  all() {
    return this.rotors ? [...this.plots, this.rotors] : this.plots;
  }

  choose(focus) {
    this.focus = focus;
    this.rotors?.root.remove();
    this.rotors = rotorPlot(TRACKS[focus]);
  }

  draw() {
    this.all().forEach((plot) => plot.draw(this.focus));
  }

  seek(time) {
    this.all().forEach((plot) => plot.seek(time, this.focus));
  }
}

function curvePlot({ name, unit, values: packed }) {
  const all = values(packed);
  const top = greatest(all);
  const [shownUnit, size] = unit === "m" ? LENGTHS.find(([, length]) => top >= length) ?? LENGTHS.at(-1) : [unit, 1];
  const lines = TRACKS.map((track, k) => ({
    values: all.subarray(k * TIMES.length, (k + 1) * TIMES.length).map((x) => x / size),
    colour: TRACKS.length > 1 && track.failed ? COLOUR.red : COLOUR.blue,
    end: track.end,
  }));
  return new Plot(name, shownUnit, lines);
}

function rotorPlot(track) {
  const colours = rotorColours();
  const rotors = HEADER.rotors.length;
  const lines = colours.map((colour, i) => ({
    values: Float32Array.from(TIMES, (_, k) => track.thrusts[k * rotors + i]),
    colour,
    end: track.end,
  }));
  const limits = [...new Set(HEADER.rotors.flatMap((rotor) => [rotor.min, rotor.max]))];
  return new Plot("rotor thrust", "N", lines, { limits, legend: true });
}

// Shades of blue for counter-clockwise rotors, of grey for clockwise ones.
function rotorColours() {
  const colours = [];
  for (const spin of [1, -1]) {
    const same = HEADER.rotors.flatMap((rotor, i) => (rotor.spin === spin ? [i] : []));
    const ramp = SPINS[spin].map((c) => new THREE.Color(c));
    same.forEach((i, k) => (colours[i] = `#${mixed(ramp, same.length > 1 ? k / (same.length - 1) : 0).getHexString()}`));
  }
  return colours;
}

function least(series) {
  return series.reduce((a, b) => Math.min(a, b), Infinity);
}

function greatest(series) {
  return series.reduce((a, b) => Math.max(a, b), -Infinity);
}

// Round numbers in a range, about so many.
function ticks(low, high, count) {
  const least = (high - low) / count;
  const step = [1, 2, 2.5, 5].map((m) => m * roundStep(least)).find((length) => length >= least);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return found;
}

function label(value) {
  return `${+value.toPrecision(6)}`.replace("-", "−");
}
