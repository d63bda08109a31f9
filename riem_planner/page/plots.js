"use strict";
// Plots over time, linked by a cursor: each curve is told by its dash and label as well as colour.

const MARGIN = 0.1; // of the width, on either side

class Plot {
  constructor(parent, key, title, curves, lines, duration, onTime) {
    this.curves = curves;
    this.lines = lines;
    this.duration = duration;
    const root = document.createElement("figure");
    root.dataset.plot = key;
    const heading = document.createElement("h2");
    heading.textContent = title;
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `${title} over time`);
    this.keys = document.createElement("div");
    this.keys.className = "keys";
    root.append(heading, this.canvas, this.keys);
    parent.append(root);
    root.addEventListener("click", (event) => {
      const box = root.getBoundingClientRect();
      const share = ((event.clientX - box.left) / box.width - MARGIN) / (1 - 2 * MARGIN);
      onTime(Math.max(0, Math.min(1, share)) * duration);
    });
    this.describe();
  }

  describe() {
    this.keys.replaceChildren(...this.curves.map((curve, index) => key(curve.label, index)));
    for (const line of this.lines) {
      const words = document.createElement("span");
      words.textContent = `- - ${line.label}`;
      this.keys.append(words);
    }
  }

  // Least and greatest value shown: curves, limits that they come near, and zero.
  range() {
    const values = this.curves.flatMap((curve) => curve.values).filter((value) => value !== null);
    let [low, high] = [Math.min(0, ...values), Math.max(0, ...values)];
    for (const line of this.lines) if (line.value < 3 * high) high = Math.max(high, line.value);
    for (const line of this.lines) if (line.mirrored && -line.value > 3 * low) low = Math.min(low, -line.value);
    const pad = 0.06 * (high - low || 1);
    return [low - pad, high + pad];
  }

  draw(times, now) {
    const ratio = window.devicePixelRatio || 1;
    const width = this.canvas.clientWidth || 500, height = this.canvas.clientHeight || 150;
    if (this.canvas.width !== Math.round(width * ratio)) {
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
    }
    const g = this.canvas.getContext("2d");
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, width, height);
    const [low, high] = this.range(), left = MARGIN * width, right = width - left, foot = height - 20;
    const x = (t) => left + (right - left) * t / this.duration;
    const y = (value) => 6 + (foot - 6) * (high - value) / (high - low);
    this.scales(g, { left, right, foot, x, y, low, high });
    for (const line of this.lines) {
      for (const value of line.mirrored ? [line.value, -line.value] : [line.value]) {
        if (value > high || value < low) continue;
        stroke(g, [[left, y(value)], [right, y(value)]], style("--keep-out"), 1.2, [6, 4]);
      }
    }
    this.curves.forEach((curve, index) => {
      const points = curve.values.map((value, k) => (value === null ? null : [x(times[k]), y(value)]));
      stroke(g, points.filter(Boolean), style(CURVES[index % CURVES.length]), 1.6, DASHES[index % DASHES.length]);
    });
    stroke(g, [[x(now), 4], [x(now), foot]], style("--cursor"), 1, []);
  }

  scales(g, { left, right, foot, x, y, low, high }) {
    g.font = "11px system-ui, sans-serif";
    g.fillStyle = style("--soft");
    for (const value of ticks(low, high, 3)) {
      stroke(g, [[left, y(value)], [right, y(value)]], style("--line"), value === 0 ? 1.2 : 0.6, []);
      g.textAlign = "right";
      g.fillText(short(value), left - 4, y(value) + 4);
    }
    g.textAlign = "center";
    for (const time of ticks(0, this.duration, 5)) g.fillText(`${short(time)} s`, x(time), foot + 14);
    g.textAlign = "left";
  }
}

function stroke(g, points, colour, width, dash) {
  g.strokeStyle = colour; g.lineWidth = width; g.setLineDash(dash);
  g.beginPath();
  for (const [x, y] of points) g.lineTo(x, y);
  g.stroke();
  g.setLineDash([]);
}

function ticks(low, high, count) {
  const rough = (high - low) / count, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [5, 2, 1].find((factor) => factor * power <= rough);
  const values = [];
  for (let k = Math.ceil(low / step); k * step <= high; k += 1) values.push(k * step);
  return values;
}

const short = (value) => String(Number(value.toPrecision(3)));

// A label with a piece of its line.
function key(label, index) {
  const entry = document.createElement("span");
  const picture = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  picture.setAttribute("width", "30"); picture.setAttribute("height", "8");
  picture.setAttribute("aria-hidden", "true");
  const line = document.createElementNS("http://www.w3.org/2000/svg", "line");
  const look = { x1: 0, x2: 30, y1: 4, y2: 4, stroke: `var(${CURVES[index % CURVES.length]})`, "stroke-width": 2, "stroke-dasharray": DASHES[index % DASHES.length].join(" ") };
  for (const [name, value] of Object.entries(look)) line.setAttribute(name, value);
  picture.append(line);
  entry.append(picture, document.createTextNode(label));
  return entry;
}
