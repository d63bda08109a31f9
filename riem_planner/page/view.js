"use strict";
// The celestial sphere, in orthographic projection on a 2D canvas: what lies behind the limb is
// drawn thin and pale before the sphere's front, so no depth buffer is needed.

const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const CURVES = [0, 1, 2, 3, 4, 5].map((k) => `--curve-${k}`);
const DASHES = [[], [7, 4], [2, 3], [9, 3, 2, 3], [4, 4], [12, 4]];

// --- vectors and quaternions (x, y, z, w; body to reference) ---
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const combine = (...terms) => [0, 1, 2].map((i) => terms.reduce((sum, [c, v]) => sum + c * v[i], 0));
const unit = (a) => { const n = Math.hypot(...a); return a.map((x) => x / n); };
const multiply = (p, q) => {
  const v = combine([p[3], q], [q[3], p], [1, cross(p, q)]);
  return [...v, p[3] * q[3] - dot(p, q)];
};
const conjugate = (q) => [-q[0], -q[1], -q[2], q[3]];
const rotate = (q, b) => {
  const t = combine([2, cross(q, b)]);
  return combine([1, b], [q[3], t], [1, cross(q, t)]);
};
const mix = (a, b, s) => a.map((x, i) => (1 - s) * x + s * b[i]);

// --- the meaning of a plan between its samples: a quintic in the rotation vector ---
// phi_n(z) = sum_j (-z)^j / (2j + n)!; near 0 by its series, else by sine and cosine.
const FACTORIALS = [1];
for (let n = 1; n < 30; n += 1) FACTORIALS.push(FACTORIALS[n - 1] * n);
function phi(n, z) {
  if (z < 1) {
    let sum = 0;
    for (let j = 8; j >= 0; j -= 1) sum += (j % 2 ? -1 : 1) * z ** j / FACTORIALS[2 * j + n];
    return sum;
  }
  const x = Math.sqrt(z);
  if (n === 0) return Math.cos(x);
  if (n === 1) return Math.sin(x) / x;
  return (1 / FACTORIALS[n - 2] - phi(n - 2, z)) / z;
}

// Covariant acceleration of exp(xi(u)): body acceleration from xi and its two derivatives.
function acceleration(xi, xi1, xi2) {
  const z = dot(xi, xi), i = dot(xi, xi1), c = cross(xi, xi1);
  const p = [0, 1, 2, 3, 4, 5].map((n) => phi(n, z));
  const inner = combine([1, cross(xi1, c)], [1, cross(xi, cross(xi, xi2))]);
  return combine([1, xi2], [-p[2], cross(xi, xi2)], [-i * (2 * p[4] - p[3]), c],
    [i * (3 * p[5] - p[4]), cross(xi, c)], [p[3], inner]);
}

// Quintic of interval k as in the plan file's definition: coefficients of u^1 .. u^5.
function quintic(plan, k) {
  const h = plan.times[k + 1] - plan.times[k];
  const r = multiply(conjugate(plan.orientations[k]), plan.orientations[k + 1]);
  const size = Math.hypot(r[0], r[1], r[2]);
  const D = size > 0 ? combine([2 * Math.atan2(size, r[3]) / size, r]) : [0, 0, 0];
  const z = dot(D, D), C = (phi(3, z) - 2 * phi(4, z)) / (2 * phi(2, z));
  const G = (w) => combine([1, w], [0.5, cross(D, w)], [C, cross(D, cross(D, w))]);
  const V0 = combine([h, plan.rates[k]]), A0 = combine([h * h, plan.accelerations[k]]);
  const V1 = G(combine([h, plan.rates[k + 1]]));
  const A1 = G(combine([h * h, plan.accelerations[k + 1]], [-1, acceleration(D, V1, [0, 0, 0])]));
  return [
    V0, combine([0.5, A0]),
    combine([10, D], [-6, V0], [-4, V1], [-1.5, A0], [0.5, A1]),
    combine([-15, D], [8, V0], [7, V1], [1.5, A0], [-1, A1]),
    combine([6, D], [-3, V0], [-3, V1], [-0.5, A0], [0.5, A1]),
  ];
}

function interval(times, t) {
  let low = 0, high = times.length - 2;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= t) low = middle; else high = middle - 1;
  }
  return Math.max(low, 0);
}

function attitudeAt(plan, t) {
  const k = interval(plan.times, t);
  const u = (t - plan.times[k]) / (plan.times[k + 1] - plan.times[k]);
  const xi = combine(...quintic(plan, k).map((c, n) => [u ** (n + 1), c]));
  const z = dot(xi, xi) / 4;
  return unit(multiply(plan.orientations[k], [...combine([phi(1, z) / 2, xi]), phi(0, z)]));
}

// Where a zone is at a time, and how large: told at some times, carried on between them.
function placeAt(zone, t) {
  if (zone.active && !zone.active.some(([from, to]) => from <= t && t <= to)) return null;
  const half = zone.half_angles, places = zone.directions;
  if (places.length === 1 && half.length === 1) return { direction: places[0], half: half[0] };
  const k = interval(zone.times, t), s = (t - zone.times[k]) / (zone.times[k + 1] - zone.times[k]);
  const share = Math.min(Math.max(s, 0), 1);
  return {
    direction: places.length > 1 ? unit(mix(places[k], places[k + 1], share)) : places[0],
    half: half.length > 1 ? (1 - share) * half[k] + share * half[k + 1] : half[0],
  };
}

class View {
  constructor(canvas, data) {
    this.canvas = canvas;
    this.data = data;
    this.zones = data.sets.filter((set) => set.directions);
    this.boresights = distinctBoresights(data, this.zones);
    this.reset();
    this.listen();
  }

  reset() {
    // Look from where the first path is seen in its middle, with the reference's z up.
    const plan = this.data.plans[0];
    const q = plan ? plan.orientations[plan.orientations.length >> 1] : this.data.start;
    const to = rotate(q, this.boresights[0].axis);
    this.azimuth = Math.atan2(to[1], to[0]) + 0.5;
    this.elevation = Math.max(-1.2, Math.min(1.2, Math.asin(Math.max(-1, Math.min(1, to[2]))) + 0.25));
    this.zoom = 1;
  }

  listen() {
    const pointers = new Map();
    let spread = 0;
    this.canvas.addEventListener("pointerdown", (event) => {
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      this.canvas.setPointerCapture(event.pointerId);
    });
    const drop = (event) => { pointers.delete(event.pointerId); spread = 0; };
    this.canvas.addEventListener("pointerup", drop);
    this.canvas.addEventListener("pointercancel", drop);
    this.canvas.addEventListener("pointermove", (event) => {
      const before = pointers.get(event.pointerId);
      if (!before) return;
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      if (pointers.size === 2) {
        const [a, b] = [...pointers.values()];
        const now = Math.hypot(a[0] - b[0], a[1] - b[1]);
        if (spread) this.scale(now / spread);
        spread = now;
      } else {
        const pixels = this.canvas.clientWidth * 0.45 * this.zoom;
        this.azimuth -= (event.clientX - before[0]) / pixels;
        this.elevation += (event.clientY - before[1]) / pixels;
        this.elevation = Math.max(-1.57, Math.min(1.57, this.elevation));
      }
      this.redraw();
    });
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.scale(Math.exp(-0.0015 * event.deltaY));
      this.redraw();
    }, { passive: false });
  }

  scale(factor) { this.zoom = Math.max(0.5, Math.min(8, this.zoom * factor)); }

  // Axes of the view in the reference frame: to the right, up, towards the eye.
  axes() {
    const [ca, sa, ce, se] = [Math.cos(this.azimuth), Math.sin(this.azimuth), Math.cos(this.elevation), Math.sin(this.elevation)];
    return { right: [-sa, ca, 0], up: [-se * ca, -se * sa, ce], eye: [ce * ca, ce * sa, se] };
  }

  redraw() { if (this.last) this.draw(...this.last); }

  draw(plan, time, attitude) {
    this.last = [plan, time, attitude];
    const ratio = window.devicePixelRatio || 1;
    const size = Math.max(300, Math.round(this.canvas.clientWidth || 640));
    if (this.canvas.width !== Math.round(size * ratio)) {
      this.canvas.width = this.canvas.height = Math.round(size * ratio);
    }
    const g = this.canvas.getContext("2d");
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, size, size);
    const frame = this.axes(), radius = 0.46 * size * this.zoom, centre = size / 2;
    const project = (p) => [centre + radius * dot(p, frame.right), centre - radius * dot(p, frame.up), dot(p, frame.eye)];
    this.g = g; this.project = project; this.frame = frame; this.radius = radius; this.centre = centre; this.size = size;
    this.lines = this.prepared(plan, time, attitude);
    this.layer(false);
    g.globalAlpha = 0.88;
    g.fillStyle = style("--sphere");
    g.beginPath(); g.arc(centre, centre, radius, 0, 2 * Math.PI); g.fill();
    g.globalAlpha = 1;
    this.hatch(time);
    this.layer(true);
    g.strokeStyle = style("--soft"); g.lineWidth = 1; g.setLineDash([]);
    g.beginPath(); g.arc(centre, centre, radius, 0, 2 * Math.PI); g.stroke();
    this.body(attitude);
    this.labels(time, attitude);
  }

  // Everything on the sphere that is a line: points, colour, width, dash.
  prepared(plan, time, attitude) {
    const lines = [];
    const circle = (axis, half, look) => lines.push({ points: smallCircle(axis, half), ...look });
    const grid = { colour: style("--line"), width: 0.7, dash: [] };
    for (let k = -2; k <= 2; k += 1) circle([0, 0, 1], Math.PI / 2 - k * Math.PI / 6, grid);
    for (let k = 0; k < 6; k += 1) circle([Math.sin(k * Math.PI / 6), -Math.cos(k * Math.PI / 6), 0], Math.PI / 2, grid);
    for (const zone of this.zones) {
      const place = placeAt(zone, time);
      if (!place) continue;
      const out = zone.kind === "keep_out";
      const wall = this.data.wall.includes(zone.name);
      circle(place.direction, place.half, {
        colour: style(out ? "--keep-out" : "--keep-in"), width: wall ? 4 : 2, dash: out ? [] : [8, 3],
      });
    }
    if (plan) {
      this.boresights.forEach((boresight, index) => {
        const points = plan.orientations.map((q) => rotate(q, boresight.axis));
        const k = interval(plan.times, time), here = rotate(attitude, boresight.axis);
        const look = { colour: style(CURVES[index % CURVES.length]), width: 2.4 };
        lines.push({ points: [...points.slice(0, k + 1), here], dash: [], ...look });
        lines.push({ points: [here, ...points.slice(k + 1)], dash: [5, 4], ...look });
      });
    }
    return lines;
  }

  // The lines before the limb, or those behind it.
  layer(front) {
    const g = this.g;
    for (const { points, colour, width, dash } of this.lines) {
      g.strokeStyle = colour;
      g.lineWidth = front ? width : 0.5 * width;
      g.globalAlpha = front ? 1 : 0.35;
      g.setLineDash(dash);
      g.beginPath();
      let drawing = false;
      for (const point of points) {
        const [x, y, depth] = this.project(point);
        const visible = (depth >= 0) === front;
        if (visible && drawing) g.lineTo(x, y); else if (visible) g.moveTo(x, y);
        drawing = visible;
      }
      g.stroke();
    }
    g.globalAlpha = 1;
    g.setLineDash([]);
  }

  // Keep-out zones on the front of the sphere, hatched, pixel by pixel: exact for caps of any size.
  hatch(time) {
    const caps = this.zones.filter((zone) => zone.kind === "keep_out").map((zone) => placeAt(zone, time)).filter(Boolean)
      .map((place) => ({ at: [dot(place.direction, this.frame.right), dot(place.direction, this.frame.up), dot(place.direction, this.frame.eye)], cosine: Math.cos(place.half) }));
    if (caps.length === 0) return;
    const size = this.size, layer = document.createElement("canvas");
    layer.width = layer.height = size;
    const g = layer.getContext("2d"), image = g.createImageData(size, size);
    const [red, green, blue] = rgb(style("--keep-out"));
    for (let row = 0; row < size; row += 1) {
      const y = (this.centre - row - 0.5) / this.radius;
      for (let column = 0; column < size; column += 1) {
        const x = (column + 0.5 - this.centre) / this.radius, rest = 1 - x * x - y * y;
        if (rest < 0) continue;
        const z = Math.sqrt(rest);
        if (!caps.some(({ at, cosine }) => at[0] * x + at[1] * y + at[2] * z > cosine)) continue;
        const k = 4 * (row * size + column);
        image.data[k] = red; image.data[k + 1] = green; image.data[k + 2] = blue;
        image.data[k + 3] = (row + column) % 9 < 2 ? 200 : 45;
      }
    }
    g.putImageData(image, 0, 0);
    this.g.drawImage(layer, 0, 0, size, size);
  }

  // A box with the body's axes, in the middle of the sphere; what faces the eye is drawn.
  body(attitude) {
    const g = this.g, half = [0.1, 0.075, 0.055];
    const corner = (signs) => this.project(rotate(attitude, half.map((h, i) => h * signs[i])));
    g.lineWidth = 1; g.strokeStyle = style("--ink");
    for (let axis = 0; axis < 3; axis += 1) {
      for (const side of [-1, 1]) {
        const normal = [0, 0, 0]; normal[axis] = side;
        if (dot(rotate(attitude, normal), this.frame.eye) <= 0) continue;
        const [i, j] = [(axis + 1) % 3, (axis + 2) % 3];
        g.beginPath();
        for (const [a, b] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
          const signs = [0, 0, 0]; signs[axis] = side; signs[i] = a; signs[j] = b;
          const [x, y] = corner(signs); g.lineTo(x, y);
        }
        g.closePath(); g.globalAlpha = 0.75; g.fillStyle = style("--line"); g.fill(); g.globalAlpha = 1; g.stroke();
      }
    }
    ["x", "y", "z"].forEach((name, axis) => {
      const along = [0, 0, 0]; along[axis] = 0.24;
      const [x, y] = this.project(rotate(attitude, along)), [x0, y0] = this.project([0, 0, 0]);
      g.strokeStyle = style(CURVES[1 + axis]); g.lineWidth = 2;
      g.beginPath(); g.moveTo(x0, y0); g.lineTo(x, y); g.stroke();
      this.text(name, x + 4, y - 4, style("--ink"));
    });
  }

  labels(time, attitude) {
    const g = this.g;
    [["X", [1, 0, 0]], ["Y", [0, 1, 0]], ["Z", [0, 0, 1]]].forEach(([name, axis]) => {
      const [x, y, depth] = this.project(axis);
      g.globalAlpha = depth >= 0 ? 1 : 0.5;
      this.text(name, x + 4, y - 4, style("--soft"));
      g.globalAlpha = 1;
    });
    const written = []; // zones about one body share a place: their names stand below each other
    for (const zone of this.zones) {
      const place = placeAt(zone, time);
      if (!place) continue;
      const [x, y, depth] = this.project(place.direction);
      if (depth < 0) continue;
      const colour = style(zone.kind === "keep_out" ? "--keep-out" : "--keep-in");
      g.fillStyle = colour; g.beginPath(); g.arc(x, y, 2.5, 0, 2 * Math.PI); g.fill();
      const above = written.filter((other) => Math.hypot(other[0] - x, other[1] - y) < 12).length;
      written.push([x, y]);
      this.text(zone.name, x + 6, y + 4 + 14 * above, style("--ink"));
    }
    this.boresights.forEach((boresight, index) => {
      const [x, y, depth] = this.project(rotate(attitude, boresight.axis));
      g.globalAlpha = depth >= 0 ? 1 : 0.4;
      g.fillStyle = style(CURVES[index % CURVES.length]);
      g.beginPath(); g.arc(x, y, 5, 0, 2 * Math.PI); g.fill();
      g.globalAlpha = 1;
    });
  }

  text(words, x, y, colour) {
    const g = this.g;
    g.font = "12px system-ui, sans-serif";
    g.lineWidth = 3; g.strokeStyle = style("--paper"); g.lineJoin = "round";
    g.strokeText(words, x, y);
    g.fillStyle = colour; g.fillText(words, x, y);
  }
}

function distinctBoresights(data, zones) {
  const kept = [];
  const add = (axis, name) => {
    const known = kept.find((other) => Math.hypot(...combine([1, other.axis], [-1, axis])) < 1e-9);
    if (known) known.names.push(name); else kept.push({ axis, names: [name] });
  };
  for (const zone of zones) add(zone.boresight, zone.name);
  if (kept.length === 0) add(data.boresight, "");
  return kept;
}

function smallCircle(axis, half) {
  const other = Math.abs(axis[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
  const first = unit(cross(axis, other)), second = cross(axis, first);
  const points = [];
  for (let k = 0; k <= 120; k += 1) {
    const angle = k * Math.PI / 60;
    points.push(combine([Math.cos(half), axis], [Math.sin(half) * Math.cos(angle), first], [Math.sin(half) * Math.sin(angle), second]));
  }
  return points;
}

function rgb(colour) {
  return [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16));
}
