"use strict";
// The roads of the drives: a map of all, and grade, bank and elevation of one over its length.
const stretches = data.stretches || [];
const ROAD_PANELS = [
  ["grade", "grade, deg", "#1f6f8b", 3], ["bank", "bank, deg", "#b5533c", 3], ["z", "elevation, m", "#4a7a3a", 1],
];
const slopeText = (degrees) => (degrees === null ? "–" : tangent(degrees).toFixed(1) + " %");
const labelOf = (name, label) => label.replace("deg", unitOf(name));

function drivenBy(chosen) {
  const rows = new Set(chosen);
  return stretches.flatMap((road, k) => (!road.drives.length || road.drives.some((row) => rows.has(row)) ? [k] : []));
}

function roadLine(road) {
  return (road.length / 1000).toFixed(road.length < 10000 ? 2 : 1) + " km, " + road.count
    + (road.count === 1 ? " drive, " : " drives, ") + road.ways;
}

function showRoads(chosen) {
  if (!stretches.length) return;
  const shown = drivenBy(chosen);
  byId("no-roads").hidden = shown.length > 0;
  byId("road-panel").hidden = shown.length === 0;
  if (!shown.length) return;
  const before = +byId("stretch").value;
  const current = shown.includes(before) ? before : shown[0];
  fill(byId("stretch"), shown.map((k) => [k, (k + 1) + ": " + roadLine(stretches[k])]), current);
  showRoadMap(shown, current);
  showRoad(stretches[current]);
}

function showRoadMap(shown, current) {
  const what = byId("colored").value;
  const [, label] = ROAD_PANELS.find(([name]) => name === what);
  const all = { x: [], y: [], color: [], text: [], k: [] };
  for (const k of shown) {
    const road = stretches[k];
    road.s.forEach((s, j) => {
      all.x.push(road.longitude[j]);
      all.y.push(road.latitude[j]);
      all.color.push(what === "z" ? road.z[j] : turned(what, [road[what][j]])[0]);
      all.text.push("stretch " + (k + 1) + ", " + s + " m: grade " + figure(road.grade[j], 2) + " deg (" + slopeText(road.grade[j])
        + "), bank " + figure(road.bank[j], 2) + " deg, " + road.passes[j] + " passes");
      all.k.push(k);
    });
  }
  const known = all.color.filter((v) => v !== null).map(Math.abs);
  const most = Math.max(0.1, known.length ? quantile(Float64Array.from(known).sort(), 0.98) : 0.1);
  const chosen = stretches[current];
  const middle = all.y[Math.floor(all.y.length / 2)];
  draw("roads", [{
    type: "scatter", mode: "lines", x: chosen.longitude, y: chosen.latitude, hoverinfo: "skip",
    line: { width: 11, color: "rgba(128,128,128,.35)" },
  }, {
    type: "scatter", mode: "markers", x: all.x, y: all.y, text: all.text, hoverinfo: "text", customdata: all.k,
    marker: { size: 5, color: all.color,
      ...(what === "z" ? { colorscale: "Viridis" } : { colorscale: [[0, "#0072b2"], [0.5, "#9a9a9a"], [1, "#e66100"]],
        cmin: -most, cmax: most }),
      colorbar: { title: { text: labelOf(what, label) }, thickness: 12 } },
  }], {
    height: 420, showlegend: false, xaxis: { title: { text: "longitude, deg" }, nticks: 5 },
    yaxis: { title: { text: "latitude, deg" }, scaleanchor: "x", scaleratio: 1 / Math.cos((middle * Math.PI) / 180) },
  });
}

function showRoad(road) {
  const axes = { yaxis: [0.7, 1], yaxis2: [0.36, 0.66], yaxis3: [0, 0.3] };
  const traces = [];
  const layouts = {};
  ROAD_PANELS.forEach(([name, label, color, digits], k) => {
    const axis = Object.keys(axes)[k];
    const yaxis = axis.replace("axis", "");
    const sd = road[name + "_sd"];
    const known = road[name].some((v) => v !== null);
    const edge = (sign) => turned(name, road[name].map((v, j) => (v === null || sd[j] === null ? null : v + sign * 2 * sd[j])));
    const text = road[name].map((v, j) => figure(v, digits) + (name === "z" ? " m" : " deg")
      + (sd[j] === null ? "" : " ± " + figure(sd[j], digits)) + (name === "grade" ? " (" + slopeText(v) + ")" : ""));
    if (known) {
      traces.push(band(road.s, edge(-1), edge(1), color, { yaxis }));
      traces.push({ x: road.s, y: turned(name, road[name]), yaxis, mode: "lines", line: { width: 1.6, color }, text,
        hovertemplate: label.split(",")[0] + " %{text}<extra></extra>" });
    }
    layouts[axis] = { title: { text: known ? labelOf(name, label) : name + ": not known" }, domain: axes[axis] };
  });
  draw("road-curves", traces, {
    height: 560, showlegend: false, hovermode: "x", ...layouts,
    xaxis: { title: { text: "distance along the road, m" }, anchor: "y3" },
  });
  byId("road-notes").replaceChildren(...road.notes.map((text) => element("li", text)));
}

if (stretches.length) {
  fill(byId("colored"), [["grade", "grade"], ["bank", "bank"], ["z", "elevation"]], "grade");
  for (const id of ["stretch", "colored"]) byId(id).onchange = () => showRoads(chosenRows());
  document.addEventListener("DOMContentLoaded", () => byId("roads").on("plotly_click", (event) => {
    byId("stretch").value = event.points[0].customdata;
    showRoads(chosenRows());
  }));
}
