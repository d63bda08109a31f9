"use strict";
// The page: what is shown is one state, {time, alternative, playing}; every control changes it.

const data = JSON.parse(document.getElementById("data").textContent);
const element = (id) => document.getElementById(id);
const state = { time: 0, alternative: 0, playing: false };
const STEPS = 200;
const still = window.matchMedia("(prefers-reduced-motion: reduce)");
const duration = data.duration;
const view = new View(element("view"), data);
let plots = [];

const currentPlan = () => data.plans[state.alternative];
const currentAttitude = () => (currentPlan() ? attitudeAt(currentPlan(), state.time) : data.start);
const degrees = (value) => (value === null || value === undefined ? "not bounded" : `${value.toFixed(2)} deg`);

window.riemPage = Object.freeze({
  get time() { return state.time; },
  get attitude() { return currentAttitude(); },
  get alternative() { return state.alternative; },
  get playing() { return state.playing; },
});

function setTime(time) {
  state.time = Math.max(0, Math.min(duration, time));
  element("time").value = state.time;
  show();
}

function show() {
  const plan = currentPlan();
  element("clock").textContent = `${state.time.toFixed(2)} of ${Number(duration.toPrecision(6))} s`;
  view.draw(plan, state.time, currentAttitude());
  if (plan) for (const plot of plots) plot.draw(plan.times, state.time);
}

// --- plots ---
const norms = (rows) => rows.map((row) => Math.hypot(...row));
const axes = (rows) => ["norm", "x", "y", "z"].map((label, k) => ({ label, values: k ? rows.map((row) => row[k - 1]) : norms(rows) }));

function limitLines(key) {
  const limit = data.limits[key];
  if (limit === undefined) return [];
  if (typeof limit === "number") return [{ value: limit, mirrored: false, label: `limit ${limit}` }];
  return ["x", "y", "z"].map((axis, k) => ({ value: limit[k], mirrored: true, label: `limit ${axis} ${limit[k]}` }));
}

function makePlots() {
  const plan = currentPlan(), parent = element("plots");
  parent.replaceChildren();
  plots = [];
  if (!plan) return;
  const add = (key, title, curves, lines) => plots.push(new Plot(parent, key, title, curves, lines, duration, setTime));
  add("rate", "Rate [rad/s]", axes(plan.rates), limitLines("rate"));
  add("acceleration", "Acceleration [rad/s²]", axes(plan.accelerations), limitLines("acceleration"));
  if (plan.torque) add("torque", "Torque [N m]", axes(plan.torque), limitLines("torque"));
  if (plan.momentum) add("momentum", "Momentum [N m s]", axes(plan.momentum), limitLines("momentum"));
  const sets = Object.entries(plan.clearance);
  if (sets.length) {
    const bounds = Object.entries(plan.least).filter(([, value]) => Number.isFinite(value))
      .map(([name, value]) => ({ value, mirrored: false, label: `certified bound ${name}` }));
    add("clearance", "Clearance [deg]", sets.map(([label, values]) => ({ label, values })), bounds);
  }
}

// --- words and figures; text nodes only, since names come from files ---
function words(tag, text, className) {
  const node = document.createElement(tag);
  node.textContent = text;
  if (className) node.className = className;
  return node;
}

function table(headings, rows) {
  const node = document.createElement("table");
  const head = document.createElement("tr");
  head.append(...headings.map((heading) => words("th", heading)));
  node.append(head);
  for (const row of rows) {
    const line = document.createElement("tr");
    line.append(...row.map((cell) => words("td", cell)));
    node.append(line);
  }
  return node;
}

function describe() {
  const verdict = data.certificate, certified = verdict !== null && verdict.certified && data.plans.length > 0;
  element("name").textContent = data.name || "plan";
  element("verdict").textContent = certified ? "Certified" : `Refused: ${data.status}`;
  element("message").textContent = data.message;
  const figures = element("figures");
  if (data.wall.length) figures.append(words("p", `Sealed by the wall ${data.wall.join(", ")}: drawn thick.`));
  if (certified) figures.append(words("h2", "Certificate"), ...certificateTables(verdict));
  else for (const set of data.sets) figures.append(words("p", `${set.name}: ${set.kind.replace("_", " ")}`));
  for (const note of data.notes) figures.append(words("p", `Note: ${note}`, "note"));
  if (data.proof) figures.append(words("p", `Independent check: ${data.proof}`));
  const shown = data.shown < data.samples ? `; ${data.shown} of ${data.samples} samples are shown` : "";
  if (data.plans.length) figures.append(words("p", `riem_planner ${data.version}; ${data.samples} samples${shown}`, "note"));
  describeLegend();
}

function certificateTables(verdict) {
  const rows = Object.entries(verdict.clearance_deg).map(([name, value]) => {
    const time = verdict.clearance_times[name];
    return [name, degrees(value), time === null || time === undefined ? "" : `${time.toPrecision(5)} s`];
  });
  const others = Object.entries(verdict.limits_left).map(([name, part]) => [`limit of ${name}: part left`, part === null ? "" : part.toPrecision(4)]);
  others.push(["ends missed by at most", `${verdict.boundary_error[0].toExponential(1)} rad, ${verdict.boundary_error[1].toExponential(1)} rad/s`]);
  others.push(["rate bound", `${verdict.rate_bound.toPrecision(5)} rad/s`]);
  const parts = [table(["certified bound", "value"], others)];
  if (rows.length) parts.unshift(table(["clear of", "at least", "closest at"], rows));
  return parts;
}

function describeLegend() {
  const legend = element("legend");
  view.boresights.forEach((boresight, index) => {
    const axis = boresight.axis.map((x) => Number(x.toPrecision(3))).join(", ");
    const names = boresight.names.filter(Boolean).join(", ");
    legend.append(key(`boresight [${axis}]${names ? `: ${names}` : ""}`, index));
  });
  for (const zone of view.zones) {
    const entry = words("span", `${zone.kind === "keep_out" ? "▨ keep out of" : "◯ keep in"} ${zone.name}`);
    entry.style.color = `var(${zone.kind === "keep_out" ? "--keep-out" : "--keep-in"})`;
    legend.append(entry);
  }
  for (const set of data.sets) {
    if (!set.directions) legend.append(words("span", `orientation obstacle ${set.name} (radius ${degrees(set.radius_deg)}); see clearance`));
  }
}

// --- controls ---
function fillSelects() {
  const choices = element("alternative");
  data.plans.forEach((plan, index) => {
    const least = Object.values(plan.least).filter((value) => Number.isFinite(value));
    const clear = least.length ? `, least clearance ${degrees(Math.min(...least))}` : "";
    choices.append(new Option(`${plan.label}: cost ${plan.cost === null ? "unknown" : plan.cost.toPrecision(5)}${clear}`, index));
  });
  choices.disabled = data.plans.length < 2;
  choices.addEventListener("change", () => { state.alternative = Number(choices.value); makePlots(); show(); });
  const speeds = element("speed");
  for (const seconds of [40, 20, 10, 5]) {
    speeds.append(new Option(`${short(duration / seconds)} x`, duration / seconds, seconds === 10, seconds === 10));
  }
}

function play(on) {
  state.playing = on && !still.matches && data.plans.length > 0;
  element("play").textContent = state.playing ? "Pause" : "Play";
  if (on && still.matches) { setTime(state.time + duration / STEPS); return; }
  if (!state.playing) return;
  if (state.time >= duration) setTime(0);
  let before = null;
  const frame = (now) => {
    if (!state.playing) return;
    if (before !== null) setTime(state.time + (now - before) / 1000 * Number(element("speed").value));
    before = now;
    if (state.time >= duration) play(false); else requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
}

const KEYS = {
  " ": () => play(!state.playing),
  ArrowLeft: () => setTime(state.time - duration / STEPS),
  ArrowRight: () => setTime(state.time + duration / STEPS),
  ArrowDown: () => setTime(state.time - duration / STEPS),
  ArrowUp: () => setTime(state.time + duration / STEPS),
  Home: () => setTime(0),
  End: () => setTime(duration),
  r: () => { view.reset(); view.redraw(); },
  R: () => { view.reset(); view.redraw(); },
};

function listen() {
  element("time").max = duration;
  element("time").addEventListener("input", (event) => setTime(Number(event.target.value)));
  element("play").addEventListener("click", () => play(!state.playing));
  element("reset").addEventListener("click", KEYS.r);
  document.addEventListener("keydown", (event) => {
    const own = event.target.tagName === "SELECT" || (event.target.tagName === "BUTTON" && event.key === " ");
    if (own || event.ctrlKey || event.metaKey || event.altKey || !KEYS[event.key]) return;
    event.preventDefault();
    KEYS[event.key]();
  });
  window.addEventListener("resize", show);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", show);
  for (const id of ["play", "time", "alternative", "speed"]) {
    if (!data.plans.length) element(id).disabled = true;
  }
}

describe();
fillSelects();
listen();
makePlots();
setTime(0);
