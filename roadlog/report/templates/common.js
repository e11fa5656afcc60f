"use strict";
// Shared by the index and the detail pages. Texts of logs go into the page as text, never as HTML.
const data = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);
const dark = window.matchMedia("(prefers-color-scheme: dark)");
const ANGLES = ["grade", "bank", "pitch", "roll", "inclination", "roll_total"];
const COLORS = ["#0b7bd0", "#e07b00", "#2ca05a", "#c4384a", "#8a63c8", "#8c6d4f", "#d264a8",
  "#7f8890", "#a3a024", "#1fa7b5"];

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

function layout(more) {
  const style = getComputedStyle(document.documentElement);
  const [page, ink, line] = ["--page", "--ink", "--line"].map((n) => style.getPropertyValue(n).trim());
  const axis = { gridcolor: line, zerolinecolor: line, linecolor: line, automargin: true };
  const made = {
    paper_bgcolor: page, plot_bgcolor: page, font: { color: ink, size: 12 },
    margin: { l: 55, r: 15, t: 15, b: 40 }, colorway: COLORS, legend: { orientation: "h" },
    ...more,
  };
  for (const name of ["xaxis", "yaxis", "xaxis2", "yaxis2"]) {
    if (name.length === 5 || more[name]) made[name] = { ...axis, ...more[name] };
  }
  return made;
}

const CONFIG = {
  displaylogo: false, responsive: true,
  modeBarButtonsToRemove: ["sendChartToCloud", "downloadJson", "select2d", "lasso2d"], // nothing leaves this page
};

// Plotly is large: the page is there before it, and the plots come when it is.
const waiting = new Map();

function draw(id, traces, more) {
  if (typeof Plotly === "undefined") waiting.set(id, [traces, more]);
  else Plotly.react(id, traces, layout(more), CONFIG);
}

document.addEventListener("DOMContentLoaded", () => {
  for (const [id, [traces, more]] of waiting) draw(id, traces, more);
});
