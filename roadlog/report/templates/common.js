"use strict";
// Shared by the index and the detail pages. Texts of logs go into the page as text, never as HTML.
const data = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);
const dark = window.matchMedia("(prefers-color-scheme: dark)");
const ANGLES = ["grade", "bank", "pitch", "roll", "inclination", "roll_total"];
const SLOPES = ["grade", "bank"]; // of the road, also shown in percent
const PERCENT = 100 * (Math.PI / 180); // of a small angle in deg
const TERMS = { // heading -> what it means
  RMSE: "root mean square of estimate minus truth, the lower the better",
  "RMSE median": "half of the drives have a smaller RMSE",
  "5 %": "one drive in twenty has a smaller RMSE",
  "95 %": "19 in 20 are smaller: drives in a ranking, absolute errors in a drive",
  mean: "mean of estimate minus truth: an offset that does not average away",
  MAE: "mean of the absolute error",
  max: "largest absolute error",
  "in 2 sd": "share of the truth within two of the estimate's own standard deviations; 95 % is honest, "
    + "less is overconfident, more is too careful",
  NEES: "mean of (error / sd) squared; 1 is honest, 4 means that the sd is half of what it should be",
  valid: "share of the truth's samples (without truth: of the estimator's own) at which it vouches for its "
    + "value; the rest is not compared",
  warnings: "faults of the log and losses while reading it; remarks of estimators do not count",
  "took s": "seconds of work",
  passes: "how often drives went over this point",
};

// The unit of grade and bank: chosen on the page, first what the report was made for.
const inPercent = (angle) => byId("slope").value === "percent" && SLOPES.includes(angle);
const unitOf = (angle) => (inPercent(angle) ? "%" : "deg");
const tangent = (degrees) => (degrees === null ? null : 100 * Math.tan((degrees * Math.PI) / 180));
// An angle, an error or an sd in deg, in the unit of its angle.
const turned = (angle, values) => (inPercent(angle) ? values.map(tangent) : values);
const sized = (angle, values) => (inPercent(angle) ? values.map((v) => (v === null ? null : PERCENT * v)) : values);

function chooseSlope(first, redraw) {
  fill(byId("slope"), [["deg", "degrees"], ["percent", "percent"]], first);
  byId("slope").onchange = redraw;
}

function element(tag, text, className) {
  const made = document.createElement(tag);
  if (text !== undefined) made.textContent = text;
  if (className) made.className = className;
  return made;
}

function fill(select, options, chosen) {
  select.replaceChildren(...options.map(([value, text]) => {
    const option = element("option", text);
    option.value = value;
    return option;
  }));
  select.value = chosen;
}

function figure(value, digits = 3) {
  return value === null || value === undefined || Number.isNaN(value) ? "–" : value.toFixed(digits);
}

function percent(value) {
  return value === null || value === undefined || Number.isNaN(value)
    ? "–" : (100 * value).toFixed(1) + " %";
}

function minutes(seconds) {
  if (seconds === null || Number.isNaN(seconds)) return "–";
  const whole = Math.round(seconds);
  return Math.floor(whole / 60) + ":" + String(whole % 60).padStart(2, "0");
}

// Plotly reads a little HTML in names: take its brackets away.
const plain = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;");

function heading(title, className) {
  const made = element("th", undefined, className);
  made.append(term(title));
  return made;
}

function term(title) {
  const made = element(TERMS[title] ? "abbr" : "span", title);
  if (TERMS[title]) made.title = TERMS[title];
  return made;
}

// What a pointer shows over a heading, in words for those who have none.
function glossary(titles) {
  const list = element("dl");
  for (const title of titles) if (TERMS[title]) list.append(element("dt", title), element("dd", TERMS[title]));
  const made = element("details", undefined, "soft");
  made.append(element("summary", "What the columns mean"), list);
  return made;
}

function faded(color, share) {
  const [r, g, b] = [1, 3, 5].map((k) => parseInt(color.slice(k, k + 2), 16));
  return "rgba(" + r + "," + g + "," + b + "," + share + ")";
}

// An area between two curves, beneath every line; a polygon for each part without a gap.
function band(x, low, high, color, more) {
  const [xs, ys] = [[], []];
  for (let k = 0; k < x.length;) {
    const known = (j) => j < x.length && low[j] !== null && high[j] !== null && x[j] !== null;
    if (!known(k)) { k += 1; continue; }
    let end = k;
    while (known(end)) end += 1;
    for (let j = k; j < end; j += 1) { xs.push(x[j]); ys.push(high[j]); }
    for (let j = end - 1; j >= k; j -= 1) { xs.push(x[j]); ys.push(low[j]); }
    xs.push(null);
    ys.push(null);
    k = end;
  }
  return { type: "scatter", x: xs, y: ys, fill: "toself", mode: "lines", line: { width: 0 }, hoverinfo: "skip",
    fillcolor: faded(color, 0.18), showlegend: false, ...more };
}

// Smallest and largest value of some curves, with room: what a band may reach without flattening them.
function reach(curves, room = 0.4) {
  let [low, high] = [Infinity, -Infinity];
  for (const values of curves) {
    for (const v of values) if (v !== null) { low = Math.min(low, v); high = Math.max(high, v); }
  }
  const more = room * Math.max(high - low, 0.1);
  return low <= high ? [low - more, high + more] : [-1, 1];
}

const within = (values, [low, high]) => values.map((v) => (v === null ? null : Math.min(Math.max(v, low), high)));

function layout(more) {
  const style = getComputedStyle(document.documentElement);
  const [page, ink, line] = ["--page", "--ink", "--line"].map((n) => style.getPropertyValue(n).trim());
  const axis = { gridcolor: line, zerolinecolor: line, linecolor: line, automargin: true };
  const made = {
    paper_bgcolor: page, plot_bgcolor: page, font: { color: ink, size: 12 },
    margin: { l: 55, r: 15, t: 15, b: 40 }, legend: { orientation: "h" },
    ...more,
  };
  for (const name of ["xaxis", "yaxis", "xaxis2", "yaxis2", "yaxis3"]) {
    if (name.length === 5 || more[name]) made[name] = { ...axis, ...more[name] };
  }
  return made;
}

const CONFIG = {
  displaylogo: false, responsive: true, ...(window.innerWidth < 700 && { displayModeBar: false }), // it hides legends
  modeBarButtonsToRemove: ["sendChartToCloud", "downloadJson", "select2d", "lasso2d"], // nothing leaves this page
};

// Plotly is large: the page is there before it, and the plots come when it is.
const plots = new Map();

function draw(id, traces, more) {
  plots.set(id, [traces, more]);
  if (typeof Plotly !== "undefined") Plotly.react(id, traces, layout(more), CONFIG);
}

function drawAll() {
  for (const [id, [traces, more]] of plots) draw(id, traces, more);
}

document.addEventListener("DOMContentLoaded", drawAll);

// Paper is light and narrower than most windows.
const PAPER = 700; // px
function paper(on) {
  document.documentElement.classList.toggle("paper", on);
  for (const [id, [traces, more]] of plots) {
    const width = Math.min(PAPER, byId(id).clientWidth);
    Plotly.react(id, traces, layout(on ? { ...more, width } : more), CONFIG);
  }
}
window.addEventListener("beforeprint", () => paper(true));
window.addEventListener("afterprint", () => paper(false));
