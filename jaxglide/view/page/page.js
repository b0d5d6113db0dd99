// The page: one clock for space, numbers and charts, and the controls that set it.
import { glidesOf, numbersOf, pose } from "./data.js";
import { Charts } from "./charts.js";
import { FORCES } from "./snake.js";
import { Stage } from "./stage.js";

const STEP = 1 / 60; // s, of the arrow keys
const TOGGLES = ["lift", "drag", "path", "axes", "labels"];
const find = (id) => document.getElementById(id);
const signed = (number, digits) => (
  number.toFixed(digits).replace(/^-(?=[0.]*$)/, "").replace("-", "\u2212")
);

function make(tag, text, className) {
  const element = document.createElement(tag);
  element.textContent = text;
  if (className) element.className = className;
  return element;
}

function swatch(colour) {
  const mark = make("i", "", "swatch");
  mark.style.backgroundColor = colour;
  return mark;
}

// A length that is drawn as a bar for a round force per length.
function lengthOf(metres) {
  return metres < 1 ? `${+(100 * metres).toPrecision(3)} cm` : `${+metres.toPrecision(3)} m`;
}

function legend(about) {
  const place = find("legend");
  for (const [name, colour] of Object.entries(FORCES)) {
    const row = make("div", "", name);
    row.append(swatch(colour), `${name} per length of body`);
    place.append(row);
  }
  place.append(make("div", `${lengthOf(about.forceScale)} of sheet = 1 N/m`, "scale"));
}

function names(glides) {
  for (const glide of glides.length > 1 ? glides : []) {
    const item = make("li", "");
    item.append(swatch(glide.colour), glide.label);
    find("names").append(item);
  }
}

class Readouts {
  constructor(glides) {
    this.rows = glides.map((glide) => {
      const row = make("tr", "");
      const head = make("th", "");
      head.scope = "row";
      const state = make("small", "");
      head.append(swatch(glide.colour), glide.label, state);
      head.title = glide.label;
      const cells = ["height", "speed", "glideAngle"].map((name) => {
        const cell = make("td", "");
        cell.dataset.name = name;
        return cell;
      });
      row.append(head, ...cells);
      document.querySelector("#readouts tbody").append(row);
      return { glide, row, cells, state };
    });
  }

  update(time) {
    for (const { glide, row, cells, state } of this.rows) {
      const now = numbersOf(glide);
      [now.height, now.speed, now.glideAngle].forEach((value, index) => {
        cells[index].textContent = signed(value, index === 2 ? 0 : 2);
      });
      row.classList.toggle("ended", time > glide.end);
      state.textContent = time >= glide.end ? glide.ended : "in flight";
    }
  }
}

class Player {
  constructor(about, numbers) {
    this.glides = glidesOf(about, numbers);
    this.end = Math.max(...this.glides.map((glide) => glide.end));
    this.time = 0;
    this.speed = Number(find("speed").value);
    this.playing = false;
    legend(about);
    names(this.glides);
    this.readouts = new Readouts(this.glides);
    this.charts = new Charts(find("charts"), this.glides, (time) => this.seek(time));
    this.stage = null;
    try {
      this.stage = new Stage(find("canvas"), this.glides, about);
    } catch (error) {
      find("problem").textContent = "This browser draws no WebGL: the charts work without it.";
      find("problem").hidden = false;
    }
  }

  seek(time) {
    this.time = Math.min(Math.max(time, 0), this.end);
    for (const glide of this.glides) pose(glide, this.time);
    this.stage?.update();
    this.readouts.update(this.time);
    this.charts.update(this.time);
    const words = `${this.time.toFixed(2)} s`;
    find("clock").textContent = words;
    find("readout").textContent = `${this.time.toFixed(2)} / ${this.end.toFixed(2)} s`;
    find("time").value = String(this.time);
    find("time").setAttribute("aria-valuetext", words);
  }

  play(playing) {
    if (playing && this.time >= this.end) this.seek(0);
    this.playing = playing;
    this.last = null;
    find("play").textContent = playing ? "❚❚ Pause" : "▶ Play";
    find("play").setAttribute("aria-pressed", String(playing));
  }

  frame(clock) {
    if (this.playing) {
      const passed = this.last === null ? 0 : Math.min((clock - this.last) / 1000, 0.25);
      this.last = clock;
      this.seek(this.time + this.speed * passed);
      if (this.time >= this.end) this.play(false);
    }
    this.stage?.draw();
  }
}

function cameras(player) {
  const choose = find("camera");
  const several = player.glides.length > 1;
  const options = [["all", several ? "Follow all" : "Follow"]];
  if (several) player.glides.forEach((glide, i) => options.push([i, `Follow ${glide.label}`]));
  options.push(["fixed", "Fixed"]);
  for (const [value, text] of options) {
    const option = make("option", text);
    option.value = value;
    choose.append(option);
  }
  choose.addEventListener("change", () => player.stage?.look(choose.value));
}

function controls(player) {
  const slider = find("time");
  slider.max = String(player.end);
  slider.addEventListener("input", () => player.seek(Number(slider.value)));
  find("play").addEventListener("click", () => player.play(!player.playing));
  find("speed").addEventListener("change", () => {
    player.speed = Number(find("speed").value);
  });
  find("reset").addEventListener("click", () => player.stage?.reset());
  for (const name of TOGGLES) {
    const box = find(`show-${name}`);
    box.addEventListener("change", () => {
      player.stage?.show(name, box.checked);
      find("legend").querySelector(`.${name}`)?.classList.toggle("off", !box.checked);
    });
  }
  find("apart").hidden = player.glides.length < 2;
  find("show-apart").addEventListener("change", () => {
    player.stage?.setApart(find("show-apart").checked);
    player.stage?.update();
  });
}

function keys(player) {
  const step = (direction) => (event) => {
    player.play(false);
    player.seek(player.time + direction * STEP * (event.shiftKey ? 10 : 1));
  };
  const actions = {
    " ": () => player.play(!player.playing),
    ArrowRight: step(1),
    ArrowLeft: step(-1),
    Home: () => player.seek(0),
    End: () => player.seek(player.end),
    r: () => player.stage?.reset(),
  };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const own = event.target.closest("button, select, input[type=checkbox]");
    if (own && (event.key === " " || event.target.tagName === "SELECT")) return;
    const action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    action(event);
  });
}

export function start(about, numbers) {
  const player = new Player(about, numbers);
  cameras(player);
  controls(player);
  keys(player);
  const place = find("stage");
  const fit = () => player.stage?.resize(place.clientWidth, place.clientHeight);
  fit();
  player.stage?.reset();
  new ResizeObserver(fit).observe(place);
  player.seek(0);
  const loop = (clock) => {
    player.frame(clock);
    requestAnimationFrame(loop);
  };
  requestAnimationFrame(loop);
  window.jaxglide = player;
  document.documentElement.dataset.ready = "true";
}
