"use strict";
const { row, time } = data;
const VISIBLE = 5; // estimators shown at first, the best ones
const angles = ANGLES.filter((angle) => data.curves[angle]);
const fields = Object.keys(data.fields); // of further channels, like tire forces
const unit = (angle) => data.fields[angle]?.unit ?? unitOf(angle);
const rmse = (name, angle) => row.angles[name]?.[angle]?.rmse_deg ?? row.details[name]?.[angle]?.rmse ?? Infinity;

function ranked(angle) {
  return Object.keys(data.curves[angle] || {}).filter((name) => name !== "truth")
    .sort((a, b) => rmse(a, angle) - rmse(b, angle));
}

function showFacts() {
  const facts = [
    [row.status, "status"], [row.vehicle || "–", "vehicle"], [row.road || "–", "road"],
    [minutes(row.duration_s), "min:s"],
    [row.distance_m === null ? "–" : (row.distance_m / 1000).toFixed(1), "km"],
    [String(data.stops.length), "stops"], [figure(row.seconds.total, 1), "s to work on"],
  ];
  byId("facts").replaceChildren(...facts.map(([value, name]) => {
    const box = element("div");
    box.append(element("b", value), name);
    return box;
  }));
  byId("message").textContent = row.message;
}

const colorOf = (name) => data.colors[name] || data.truth_color;
const overDistance = () => byId("over").value === "distance";

function along() {
  return overDistance() ? data.distance : time;
}

// An abscissa of a time in s.
function abscissa(at) {
  if (!overDistance()) return at;
  let k = 0;
  while (k < time.length - 1 && time[k] < at) k += 1;
  return data.distance[k];
}

// Spans over the whole height, or a strip at the foot of it.
function marks(spans, height, color) {
  return spans.map(([from, to]) => ({
    type: "rect", xref: "x", yref: "paper", x0: abscissa(from), x1: abscissa(to), y0: 0, y1: height,
    fillcolor: color, line: { width: 0 }, layer: "below",
  }));
}

const mapped = (of, change) => Object.fromEntries(Object.entries(of).map(([name, values]) => [name, change(values)]));

function showCurves(angle, chosen) {
  const names = ranked(angle);
  const x = along();
  const middles = x.filter((_, k) => k % 2 === 0);
  const curves = mapped(data.curves[angle] || {}, (values) => turned(angle, values));
  const bands = mapped(data.bands[angle] || {}, (edges) => edges.map((values) => turned(angle, values)));
  const errors = data.errors[angle] && mapped(data.errors[angle], (values) => sized(angle, values));
  const { truth } = curves;
  const shown = (k) => (k < VISIBLE ? true : "legendonly");
  const best = names.slice(0, VISIBLE);
  const room = reach([...best.map((name) => curves[name]), ...(truth ? [truth] : [])]);
  const errorRoom = errors ? reach(best.filter((name) => errors[name]).map((name) => errors[name])) : [0, 0];
  const traces = names.flatMap((name, k) => {
    const edges = bands[name];
    const about = { name: plain(name) + " ±2 sd", legendgroup: name, visible: shown(k) };
    if (!edges) return [];
    const made = [band(middles, within(edges[0], room), within(edges[1], room), colorOf(name), about)];
    if (errors?.[name]) {
      const half = edges[0].map((low, j) => (low === null ? null : (edges[1][j] - low) / 2));
      made.push(band(middles, within(half.map((v) => (v === null ? null : -v)), errorRoom), within(half, errorRoom),
        colorOf(name), { ...about, yaxis: "y2" }));
    }
    return made;
  });
  if (truth) {
    traces.push({ x, y: truth, name: "truth", mode: "lines", line: { width: 3, color: data.truth_color } });
  }
  names.slice().reverse().forEach((name) => { // the best lies on top
    const k = names.indexOf(name);
    const line = { x, name: plain(name), legendgroup: name, mode: "lines", line: { width: 1.3, color: colorOf(name) },
      visible: shown(k), legendrank: k };
    traces.push({ ...line, y: curves[name] });
    if (errors?.[name]) traces.push({ ...line, y: errors[name], yaxis: "y2", showlegend: false });
  });
  draw("curves", traces, {
    height: 560, hovermode: "x unified",
    shapes: [...marks(data.invalid[chosen] || [], 1, "rgba(128,128,128,.18)"),
      ...(overDistance() ? [] : marks(data.stops, 0.012, "#888888"))],
    xaxis: { title: { text: overDistance() ? "distance, m" : "time, s" }, anchor: errors ? "y2" : "y" },
    yaxis: { title: { text: plain(angle) + ", " + unit(angle) }, domain: errors ? [0.42, 1] : [0, 1] },
    yaxis2: errors ? { title: { text: "error, " + unit(angle) }, domain: [0, 0.36] } : undefined,
    legend: { orientation: "h", y: 1.02, yanchor: "bottom" },
  });
  const parts = [];
  if (Object.keys(bands).length) {
    parts.push("Bands: ±2 sd of each estimate, about 0 on the errors; cut where they would flatten the curves.");
  }
  if ((data.invalid[chosen] || []).length) parts.push("Gray: " + chosen + " does not vouch for its value.");
  if (data.stops.length && !overDistance()) parts.push("Bars at the foot: stops.");
  byId("reading").textContent = parts.join(" ");
}

function showHistogram(angle) {
  const { limit, step } = data.histogram;
  const found = data.histograms[angle] || {};
  const names = ranked(angle).filter((name) => found[name]);
  const traces = names.map((name, k) => {
    const total = found[name].reduce((sum, n) => sum + n, 0);
    return { x: sized(angle, found[name].map((_, bin) => -limit + (bin + 0.5) * step)), y: found[name].map((n) => n / total),
      name: plain(name), mode: "lines", line: { shape: "hvh", width: 1.3, color: colorOf(name) },
      visible: k < VISIBLE ? true : "legendonly" };
  });
  draw("histogram", traces, {
    height: 380, xaxis: { title: { text: "error, " + unitOf(angle) + " (beyond " + figure(sized(angle, [limit])[0], 1) + " in the last bins)" } },
    yaxis: { title: { text: "share" } }, legend: { orientation: "h", y: -0.25 },
  });
}

function showMap(angle, name) {
  if (!data.track) {
    byId("map").replaceChildren(element("p", "no positions in this log", "soft"));
    return;
  }
  const errors = data.errors[angle]?.[name];
  const color = errors ? sized(angle, errors).map((e) => (e === null ? null : Math.abs(e)))
    : turned(angle, data.curves[angle]?.[name] || []);
  const known = data.track.latitude.filter((v) => v !== null);
  const middle = known.length ? known[Math.floor(known.length / 2)] : 0;
  draw("map", [{
    x: data.track.longitude, y: data.track.latitude, type: "scatter", mode: "markers",
    text: color.map((v, k) => "t = " + time[k] + " s: " + figure(v) + " " + unit(angle)), hoverinfo: "text",
    marker: { size: 5, color, colorscale: errors ? "YlOrRd" : "RdBu", reversescale: Boolean(errors),
      colorbar: { title: { text: (errors ? "|error|, " : plain(angle) + ", ") + unit(angle) }, thickness: 12 } },
  }], {
    height: 380, showlegend: false, xaxis: { title: { text: "longitude, deg" } },
    yaxis: { title: { text: "latitude, deg" }, scaleanchor: "x", scaleratio: 1 / Math.cos((middle * Math.PI) / 180) },
  });
}

function table(columns, rows, textColumns) {
  const made = element("table");
  const head = made.createTHead().insertRow();
  columns.forEach((title, k) => head.append(heading(title, k < textColumns ? "text" : "")));
  const body = made.createTBody();
  for (const cells of rows) {
    const line = body.insertRow();
    cells.forEach((cell, k) => line.append(element("td", cell, k < textColumns ? "text" : "")));
  }
  return made;
}

function showFigures() {
  const rows = angles.flatMap((angle) => ranked(angle).map((name) => {
    const m = row.angles[name][angle];
    const sizes = ["rmse", "bias", "mae", "p95", "max"].map((of) => figure(inPercent(angle) ? m[of + "_percent"] : m[of + "_deg"]));
    return [angle.replace("_", " "), name, unitOf(angle), ...sizes, percent(m.within_2sd), figure(m.nees, 2), percent(m.valid_share), figure(row.run_time_s[name], 2)];
  }));
  const columns = ["angle", "estimator", "unit", "RMSE", "mean", "MAE", "95 %", "max", "in 2 sd", "NEES", "valid", "took s"];
  byId("figures").replaceChildren(table(columns, rows, 3), glossary(columns));
  const further = fields.flatMap((field) => ranked(field).map((name) => {
    const m = row.details[name][field];
    const shown = [m.rmse, m.bias, m.mae, m.p95, m.max, m.spread];
    return [field, name, unit(field), ...shown.map((v) => figure(v === null ? null : v * data.fields[field].factor)),
      percent(m.within_2sd)];
  }));
  if (further.length) byId("figures").append(table(
    ["further", "estimator", "unit", "RMSE", "mean", "MAE", "95 %", "max", "true sd", "in 2 sd"], further, 3));
}

function showEvents() {
  const parts = data.events.flatMap((events) => [
    element("p", events.estimator + ": " + events.rows.length + " events; SI units"
      + (events.left_out ? ", " + events.left_out + " more" : ""), "soft"),
    table(events.columns, events.rows.map((cells) => cells.map((v) => (v === null ? "–" : String(v)))), 0),
  ]);
  byId("events").replaceChildren(...(parts.length ? parts : [element("p", "none", "soft")]));
}

function showTexts() {
  const list = (id, texts) => byId(id).replaceChildren(
    ...(texts.length ? texts : ["none"]).map((text) => element("li", text, texts.length ? "" : "soft")));
  list("warnings", [...row.losses, ...row.warnings]);
  list("notes", [...row.notes, ...Object.entries(row.cannot_run).map(([name, why]) => name + " cannot run: " + why)]);
  if (row.traceback) byId("warnings").append(element("pre", row.traceback));
}

function update() {
  const angle = byId("angle").value;
  const names = ranked(angle);
  const before = byId("estimator").value;
  fill(byId("estimator"), names.map((name) => [name, name]), names.includes(before) ? before : names[0]);
  showHistogram(angle);
  showChosen();
}

function showChosen() {
  showCurves(byId("angle").value, byId("estimator").value);
  showMap(byId("angle").value, byId("estimator").value);
}

const names = [...angles.map((a) => [a, a.replace("_", " ")]), ...fields.map((f) => [f, f])];
fill(byId("angle"), names, names[0]?.[0]);
fill(byId("over"), [["time", "time"], ...(data.distance ? [["distance", "distance"]] : [])], "time");
byId("angle").onchange = update;
byId("estimator").onchange = showChosen;
byId("over").onchange = showChosen;
dark.addEventListener("change", update);
chooseSlope(location.hash === "#percent" ? "percent" : "deg", () => {
  showFigures();
  if (names.length) update();
});
showFacts();
showFigures();
showEvents();
showTexts();
if (names.length) update();
