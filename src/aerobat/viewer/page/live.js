// The sliders of a live page: wherever they stand, the server plans and flies anew, and the page shows what comes of it.

const PAGE = `${Date.now()}-${Math.random()}`; // by which the server knows which questions are superseded
const GONE = "Nothing answers any more; start aerobat view --live again and load the page anew.";
const AXES = ["x", "y", "z"];

class Live {
  constructor({ sliders, verdict }) {
    this.gates = HEADER.gates; // as they stand at first
    this.asked = this.answered = 0; // questions sent, answers shown
    this.moved = {};
    this.sliders = new Map(sliders.map((slider) => [slider.key, { ...slider, input: this.add(slider) }]));
    element("reset").onclick = () => this.reset();
    element("sliders").onsubmit = (event) => event.preventDefault();
    element("controls").onkeydown = (event) => event.target.tagName === "INPUT" || event.stopPropagation();
    this.tell(verdict);
  }

  // A slider in its group; of several gates, those after the first are folded, and all obstacles.
  add({ key, group, name, unit, low, high, step, value }) {
    let fold = document.querySelector(`#sliders [data-group="${CSS.escape(group)}"]`);
    if (!fold) {
      fold = document.createElement("details");
      fold.dataset.group = group;
      fold.open = !/^gates\[[1-9]|^environment/.test(key);
      fold.append(Object.assign(document.createElement("summary"), { textContent: group }));
      element("sliders").append(fold);
    }
    const row = document.createElement("label");
    row.innerHTML = "<span></span><output></output><input type='range'>";
    row.querySelector("span").textContent = name;
    const input = row.querySelector("input");
    Object.assign(input, { min: low, max: high, step: "any", name: key }); // steps would move values that lie between them
    fold.append(row);
    input.value = value;
    input.oninput = () => this.move(key, Math.min(Math.max(roundTo(+input.value, step), low), high));
    input.onkeydown = (event) => this.press(event, key);
    this.write(row, value, unit, step);
    return input;
  }

  write(row, value, unit, step) {
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    const number = +value.toFixed(Math.max(digits, Number.isInteger(value) ? 0 : 1));
    row.querySelector("output").textContent = `${label(number)} ${unit}`.trim();
  }

  // Keys that move a slider do not move time.
  press(event, key) {
    const { step, low, high, input } = this.sliders.get(key);
    const at = roundTo(+input.value, step);
    const to = {
      ArrowLeft: at - step, ArrowDown: at - step, ArrowRight: at + step, ArrowUp: at + step,
      PageDown: at - 5 * step, PageUp: at + 5 * step, Home: low, End: high,
    }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    input.value = Math.min(Math.max(to, low), high);
    input.oninput();
  }

  // A slider stands elsewhere.
  move(key, to) {
    const { value, unit, step, input } = this.sliders.get(key);
    if (to === value) delete this.moved[key];
    else this.moved[key] = to;
    input.parentElement.classList.toggle("moved", key in this.moved);
    this.write(input.parentElement, to, unit, step);
    element("reset").disabled = !Object.keys(this.moved).length;
    if (key.startsWith("gates")) this.preview();
    this.ask();
  }

  reset() {
    for (const { key, value, input } of this.sliders.values()) {
      if (!(key in this.moved)) continue;
      input.value = value;
      this.move(key, value);
    }
  }

  // Gates go with their sliders at once, before anything is planned.
  preview() {
    const gates = this.gates.map((gate, k) => {
      const at = (name) => this.moved[`gates[${k}].${name}`];
      const { value, axis } = this.sliders.get(`gates[${k}].tilt`);
      const angle = (((at("tilt") ?? value) - value) * Math.PI) / 180;
      const [normal, up] = [gate.normal, gate.up].map((v) => vector(v).applyAxisAngle(vector(axis), angle).toArray());
      return { ...gate, normal, up, position: AXES.map((name, i) => at(`position.${name}`) ?? gate.position[i]) };
    });
    this.player.world?.placeGates(gates);
    this.player.stale = true;
  }

  // Ask for the plan of where the sliders stand now, and for no other any more.
  async ask() {
    this.asking?.abort();
    const asking = (this.asking = new AbortController());
    element("verdict").classList.add("busy");
    try {
      const answer = await fetch("/plan", {
        method: "POST",
        headers: { "Content-Type": "application/json" },
        body: JSON.stringify({ page: PAGE, number: (this.asked += 1), values: this.moved }),
        signal: asking.signal,
      });
      if (!answer.ok) throw new Error(answer.statusText);
      const { verdict, scene } = await answer.json();
      if (asking !== this.asking) return;
      if (!verdict) throw new Error("no answer to the last question");
      this.show(verdict, scene);
    } catch (error) {
      if (asking !== this.asking) return;
      this.tell({ word: "No answer", sentence: GONE, is_well: false });
      this.outdate(true);
    }
  }

  // An answer; where it has no plan, the last one stays, faintly.
  show(verdict, scene) {
    this.tell(verdict);
    this.outdate(!scene);
    if (scene) {
      load(scene.header, scene.arrays);
      this.player.show();
    }
    this.answered += 1;
  }

  tell({ word, sentence, is_well: isWell }) {
    const root = element("verdict");
    root.className = isWell ? "well" : "ill";
    root.querySelector("h2").textContent = word;
    root.querySelector("p").textContent = sentence;
  }

  outdate(isOutdated) {
    document.body.classList.toggle("outdated", isOutdated);
  }

  get player() {
    return window.replay;
  }
}

function roundTo(value, step) {
  return +(step * Math.round(value / step)).toPrecision(12);
}

window.live = new Live(JSON.parse(element("settings").textContent));
replay.repeats = true;
replay.toggle();
