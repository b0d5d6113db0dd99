// Yaw, pitch, roll and height against time, with a cursor at the time shown.
import uPlot from "./uPlot.esm.js";

const CHARTS = [["Yaw", "°", 0], ["Pitch", "°", 1], ["Roll", "°", 2], ["Height", "m", 3]];
const INK = "#4a5660";
const FONT = '11px system-ui, "Helvetica Neue", Arial, sans-serif';

function values(glide, column) {
  const { angles, centre } = glide.fields;
  return Array.from({ length: glide.frames }, (_, i) => (
    column < 3 ? angles[3 * i + column] : centre[3 * i + 2]
  ));
}

function range(low, high, column) {
  const pad = 0.08 * Math.max(high - low, 1);
  if (column === 3) return [0, high + pad];
  const least = Math.max(0, 20 - (high - low)) / 2;
  return [low - pad - least, high + pad + least];
}

function axis(side, more) {
  return {
    side, stroke: INK, font: FONT, grid: { stroke: "#e3e8ea", width: 1 },
    ticks: { show: false }, gap: 3, ...more,
  };
}

function options(glides, column, last) {
  return {
    width: 200, height: 100, padding: [8, 8, last ? 0 : 8, 0],
    cursor: { show: false }, legend: { show: false },
    scales: { x: { time: false }, y: { range: (_, low, high) => range(low, high, column) } },
    axes: [
      axis(2, { size: last ? 30 : 0, space: 40, labelSize: 14, labelFont: FONT,
        values: (_, ticks) => (last ? ticks.map((t) => `${+t.toFixed(2)} s`) : ticks.map(() => "")) }),
      axis(3, { size: 40, space: 17, values: (_, ticks) => ticks.map((t) => String(+t.toFixed(2)).replace("-", "\u2212")) }),
    ],
    series: [{}, ...glides.map((glide) => ({
      stroke: glide.colour, width: 1.8, spanGaps: true, points: { show: false },
    }))],
  };
}

class Chart {
  constructor(place, glides, [name, unit, column], last, seek) {
    this.glides = glides;
    this.column = column;
    this.box = document.createElement("figure");
    this.title = document.createElement("figcaption");
    this.title.textContent = `${name} (${unit})`;
    this.plot = document.createElement("div");
    this.plot.setAttribute("role", "img");
    this.plot.setAttribute("aria-label", `${name} against time; click to go to a time`);
    this.box.append(this.title, this.plot);
    place.append(this.box);
    const series = glides.map((glide) => [[...glide.fields.times], values(glide, column)]);
    const data = series.length > 1 ? uPlot.join(series) : series[0];
    this.chart = new uPlot(options(glides, column, last), data, this.plot);
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
      const now = this.column < 3 ? glide.now.angles[this.column] : glide.now.centre[2];
      const left = this.chart.valToPos(glide.now.times[0], "x");
      const top = this.chart.valToPos(now, "y");
      this.dots[index].style.transform = `translate(${left}px, ${top}px)`;
    });
  }
}

export class Charts {
  constructor(place, glides, seek) {
    this.charts = CHARTS.map((about, index) => (
      new Chart(place, glides, about, index === CHARTS.length - 1, seek)
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
