// Yaw, pitch, roll and height against time, and the inputs of a glide that is steered, with a
// cursor at the time shown.
import uPlot from "./uPlot.esm.js";

const ANGLES = ["Yaw", "Pitch", "Roll"];
const UNITS = { "deg/SVL": "° per SVL", deg: "°" };
const INK = "#4a5660";
const FONT = '11px system-ui, "Helvetica Neue", Arial, sans-serif';

// A column of a field: its values frame by frame, and now; null where a glide has none.
function column(field, width, at) {
  const all = (glide, name) => Array.from({ length: glide.frames }, (_, i) => (
    glide.fields[name][width(glide) * i + at(glide)] ?? null
  ));
  return {
    values: (glide) => (at(glide) < 0 ? Array(glide.frames).fill(null) : all(glide, field)),
    now: (glide) => (at(glide) < 0 ? null : glide.now[field][at(glide)]),
  };
}

// What the charts show: value and, where there is one, what was wanted.
function subjects(glides) {
  const none = (glide) => Array(glide.frames).fill(null);
  const angles = ANGLES.map((name, k) => ({
    name, unit: "°", least: 20, wanted: none, ...column("angles", () => 3, () => k),
  }));
  angles[0].wanted = (glide) => Array(glide.frames).fill(glide.heading);
  const inputs = new Map(glides.flatMap((glide) => glide.steered.map((one) => [one.name, one])));
  const steered = [...inputs.values()].map(({ name, unit }) => {
    const place = (glide) => glide.steered.findIndex((one) => one.name === name);
    const width = (glide) => glide.steered.length;
    return {
      name: name[0].toUpperCase() + name.slice(1), unit: UNITS[unit] ?? unit, least: 0,
      wanted: column("told", width, place).values, ...column("inputs", width, place),
    };
  });
  const height = { name: "Height", unit: "m", wanted: none, ...column("centre", () => 3, () => 2) };
  return [...angles, ...steered, height];
}

function range(low, high, least) {
  const pad = 0.08 * Math.max(high - low, 1);
  if (least === undefined) return [0, high + pad];
  const more = Math.max(0, least - (high - low)) / 2;
  return [low - pad - more, high + pad + more];
}

function axis(side, more) {
  return {
    side, stroke: INK, font: FONT, grid: { stroke: "#e3e8ea", width: 1 },
    ticks: { show: false }, gap: 3, ...more,
  };
}

function options(glides, subject, last) {
  return {
    width: 200, height: 100, padding: [8, 8, last ? 0 : 8, 0],
    cursor: { show: false }, legend: { show: false },
    scales: { x: { time: false }, y: { range: (_, low, high) => range(low, high, subject.least) } },
    axes: [
      axis(2, { size: last ? 30 : 0, space: 40, labelSize: 14, labelFont: FONT,
        values: (_, ticks) => (last ? ticks.map((t) => `${+t.toFixed(2)} s`) : ticks.map(() => "")) }),
      axis(3, { size: 40, space: 17, values: (_, ticks) => ticks.map((t) => String(+t.toFixed(2)).replace("-", "\u2212")) }),
    ],
    series: [{}, ...glides.flatMap((glide) => [
      { stroke: glide.colour, width: 1.8, spanGaps: true, points: { show: false } },
      {
        stroke: glide.colour, width: 1, dash: [4, 3], alpha: 0.75, spanGaps: true,
        points: { show: false },
      },
    ])],
  };
}

class Chart {
  constructor(place, glides, subject, last, seek) {
    this.glides = glides;
    this.subject = subject;
    this.box = document.createElement("figure");
    this.title = document.createElement("figcaption");
    this.title.textContent = `${subject.name} (${subject.unit})`;
    this.plot = document.createElement("div");
    this.plot.setAttribute("role", "img");
    this.plot.setAttribute("aria-label", `${subject.name} against time; click to go to a time`);
    this.box.append(this.title, this.plot);
    place.append(this.box);
    const series = glides.map((glide) => (
      [[...glide.fields.times], subject.values(glide), subject.wanted(glide)]
    ));
    const data = series.length > 1 ? uPlot.join(series) : series[0];
    this.chart = new uPlot(options(glides, subject, last), data, this.plot);
    this.cursor = document.createElement("div");
    this.cursor.className = "cursor";
    this.dots = glides.map((glide) => {
      const dot = document.createElement("div");
      dot.className = "dot";
      dot.style.backgroundColor = glide.colour;
      return dot;
    });
    this.chart.over.append(this.cursor, ...this.dots);
    const go = (event) => {
      const left = event.clientX - this.chart.over.getBoundingClientRect().left;
      seek(this.chart.posToVal(left, "x"));
    };
    this.chart.over.addEventListener("pointerdown", (event) => {
      this.chart.over.setPointerCapture(event.pointerId);
      go(event);
    });
    this.chart.over.addEventListener("pointermove", (event) => {
      if (event.buttons & 1) go(event);
    });
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.plot;
    if (width > 60 && height > 30) this.chart.setSize({ width, height });
  }

  update(time) {
    const x = this.chart.valToPos(time, "x");
    this.cursor.style.transform = `translateX(${x}px)`;
    this.glides.forEach((glide, index) => {
      const now = this.subject.now(glide);
      this.dots[index].hidden = now === null;
      if (now === null) return;
      const left = this.chart.valToPos(glide.now.times[0], "x");
      const top = this.chart.valToPos(now, "y");
      this.dots[index].style.transform = `translate(${left}px, ${top}px)`;
    });
  }
}

export class Charts {
  constructor(place, glides, seek) {
    const shown = subjects(glides);
    this.charts = shown.map((subject, index) => (
      new Chart(place, glides, subject, index === shown.length - 1, seek)
    ));
    this.time = 0;
    new ResizeObserver(() => {
      for (const chart of this.charts) chart.resize();
      this.update(this.time);
    }).observe(place);
  }

  update(time) {
    this.time = time;
    for (const chart of this.charts) chart.update(time);
  }
}
