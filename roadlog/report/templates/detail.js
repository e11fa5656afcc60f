"use strict";
const { row, time } = data;
const VISIBLE = 5; // estimators shown at first, the best ones
const angles = ANGLES.filter((angle) => data.curves[angle]);
const fields = Object.keys(data.fields); // of further channels, like tire forces
const unit = (angle) => data.fields[angle]?.unit ?? "deg";
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
    [row.stops === null ? "–" : String(row.stops), "stops"], [figure(row.seconds.total, 1), "s to work on"],
  ];
  byId("facts").replaceChildren(...facts.map(([value, name]) => {
    const box = element("div");
    box.append(element("b", value), name);
    return box;
  }));
  byId("message").textContent = row.message;
}

function showCurves(angle) {
  const names = ranked(angle);
  const color = (k) => COLORS[k % COLORS.length];
  const traces = names.flatMap((name, k) => {
    const line = { x: time, name: plain(name), legendgroup: name, mode: "lines", line: { width: 1.3, color: color(k) },
      visible: k < VISIBLE ? true : "legendonly" };
    const made = [{ ...line, y: data.curves[angle][name] }];
    const errors = data.errors[angle]?.[name];
    if (errors) made.push({ ...line, y: errors, yaxis: "y2", showlegend: false });
    return made;
  });
  const truth = data.curves[angle]?.truth;
  if (truth) {
    traces.push({ x: time, y: truth, name: "truth", mode: "lines", line: { width: 2, color: "#8a929a" } });
  }
  const hasErrors = Boolean(data.errors[angle]);
  draw("curves", traces, {
    height: 560, hovermode: "x unified",
    xaxis: { title: { text: "time, s" }, anchor: hasErrors ? "y2" : "y" },
    yaxis: { title: { text: plain(angle) + ", " + unit(angle) }, domain: hasErrors ? [0.42, 1] : [0, 1] },
    yaxis2: hasErrors ? { title: { text: "error, " + unit(angle) }, domain: [0, 0.36] } : undefined,
    legend: { orientation: "h", y: 1.02, yanchor: "bottom" },
  });
}

function showHistogram(angle) {
  const { limit, step } = data.histogram;
  const found = data.histograms[angle] || {};
  const names = ranked(angle).filter((name) => found[name]);
  const traces = names.map((name, k) => {
    const total = found[name].reduce((sum, n) => sum + n, 0);
    return { x: found[name].map((_, bin) => -limit + (bin + 0.5) * step), y: found[name].map((n) => n / total),
      name: plain(name), mode: "lines", line: { shape: "hvh", width: 1.3, color: COLORS[k % COLORS.length] },
      visible: k < VISIBLE ? true : "legendonly" };
  });
  draw("histogram", traces, {
    height: 380, xaxis: { title: { text: "error, deg (beyond " + limit + " in the last bins)" } },
    yaxis: { title: { text: "share" } }, legend: { orientation: "h", y: -0.25 },
  });
}

function showMap(angle, name) {
  if (!data.track) {
    byId("map").replaceChildren(element("p", "no positions in this log", "soft"));
    return;
  }
  const errors = data.errors[angle]?.[name];
  const color = errors ? errors.map((e) => (e === null ? null : Math.abs(e))) : data.curves[angle]?.[name];
  const known = data.track.latitude.filter((v) => v !== null);
  const middle = known.length ? known[Math.floor(known.length / 2)] : 0;
  draw("map", [{
    x: data.track.longitude, y: data.track.latitude, type: "scatter", mode: "markers",
    text: (color || []).map((v, k) => "t = " + time[k] + " s: " + figure(v) + " deg"), hoverinfo: "text",
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
  columns.forEach((title, k) => head.append(element("th", title, k < textColumns ? "text" : "")));
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
    return [angle.replace("_", " "), name, figure(m.rmse_deg), figure(m.bias_deg), figure(m.mae_deg), figure(m.p95_deg),
      figure(m.max_deg), percent(m.within_2sd), figure(m.nees, 2), percent(m.valid_share), figure(row.run_time_s[name], 2)];
  }));
  byId("figures").replaceChildren(table(
    ["angle", "estimator", "RMSE", "mean", "MAE", "95 %", "max", "in 2 sd", "NEES", "valid", "took s"], rows, 2));
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

function showWarnings() {
  const texts = [...row.losses, ...row.warnings, ...Object.entries(row.cannot_run).map(([n, why]) => n + " cannot run: " + why)];
  byId("warnings").replaceChildren(...texts.map((text) => element("li", text)));
  if (row.traceback) byId("warnings").append(element("pre", row.traceback));
}

function update() {
  const angle = byId("angle").value;
  const names = ranked(angle);
  const before = byId("estimator").value;
  fill(byId("estimator"), names.map((name) => [name, name]), names.includes(before) ? before : names[0]);
  showCurves(angle);
  showHistogram(angle);
  showMap(angle, byId("estimator").value);
}

const names = [...angles.map((a) => [a, a.replace("_", " ")]), ...fields.map((f) => [f, f])];
fill(byId("angle"), names, names[0]?.[0]);
byId("angle").onchange = update;
byId("estimator").onchange = () => showMap(byId("angle").value, byId("estimator").value);
dark.addEventListener("change", update);
showFacts();
showFigures();
showEvents();
showWarnings();
if (angles.length) update();
