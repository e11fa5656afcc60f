"use strict";
const PAGE = 100; // rows of a table shown at a time
const logs = data.logs;
const count = logs.name.length;
const lowered = logs.log.map((text) => text.toLowerCase());
const STATUSES = ["ok", "failed", "crashed"];
const numbers = (list) => Float64Array.from(list, (value) => (value === null ? NaN : value));
for (const name of ["duration", "distance", "seconds", "warnings"]) logs[name] = numbers(logs[name]);
const pairs = new Map(data.metrics.map((m) => [m.estimator + " " + m.angle, {
  ...m, rmse_percent: numbers(m.rmse_percent), bias_percent: numbers(m.bias_percent),
  rmse: numbers(m.rmse), bias: numbers(m.bias), inside: numbers(m.inside), valid: numbers(m.valid),
}]));
const nothing = new Float64Array(count).fill(NaN);
const angles = ANGLES.filter((angle) => data.metrics.some((m) => m.angle === angle));
const names = [...new Set(data.metrics.map((m) => m.estimator))];
const state = { angle: angles[0] || "grade", estimator: "", sort: "rmse", down: true };

function quantile(sorted, share) {
  if (!sorted.length) return NaN;
  const at = share * (sorted.length - 1);
  const low = Math.floor(at);
  const high = Math.min(low + 1, sorted.length - 1);
  return sorted[low] + (at - low) * (sorted[high] - sorted[low]);
}

function mean(values, rows) {
  let sum = 0;
  let n = 0;
  for (const row of rows) if (!Number.isNaN(values[row])) { sum += values[row]; n += 1; }
  return n ? sum / n : NaN;
}

function chosenRows() {
  const vehicle = byId("vehicle").value;
  const road = byId("road").value;
  const status = byId("status").value;
  const text = byId("text").value.trim().toLowerCase();
  const rows = [];
  for (let row = 0; row < count; row += 1) {
    if (vehicle !== "" && logs.vehicle[row] !== +vehicle) continue;
    if (road !== "" && logs.road[row] !== +road) continue;
    if (status !== "" && logs.status[row] !== +status) continue;
    if (text && !lowered[row].includes(text)) continue;
    rows.push(row);
  }
  return rows;
}

function isFiltered() {
  return ["vehicle", "road", "status", "text"].some((id) => byId(id).value !== "");
}

// The figures of an estimator and an angle, errors in the unit that is chosen.
function pairOf(name) {
  const pair = pairs.get(name + " " + state.angle);
  return pair && inPercent(state.angle) ? { ...pair, rmse: pair.rmse_percent, bias: pair.bias_percent } : pair;
}

function rank(rows) {
  if (!isFiltered() && data.left_out) return (inPercent(state.angle) ? data.ranking_percent : data.ranking)[state.angle] || [];
  const ranked = [];
  for (const name of names) {
    const pair = pairOf(name);
    if (!pair) continue;
    const present = rows.filter((row) => !Number.isNaN(pair.valid[row]));
    if (!present.length) continue;
    const sorted = Float64Array.from(rows, (row) => pair.rmse[row]).filter((v) => !Number.isNaN(v)).sort();
    ranked.push({
      estimator: name, logs: present.length, rmse: [0.05, 0.25, 0.5, 0.75, 0.95].map((s) => quantile(sorted, s)),
      inside: mean(pair.inside, rows), valid: mean(pair.valid, rows),
    });
  }
  const last = (value) => (Number.isNaN(value) ? Infinity : value);
  return ranked.sort((a, b) => last(a.rmse[2]) - last(b.rmse[2]) || b.valid - a.valid);
}

function plainTable(columns, rows) {
  const table = element("table");
  const head = table.createTHead().insertRow();
  for (const [title, isText] of columns) head.append(heading(title, isText ? "text" : ""));
  const body = table.createTBody();
  for (const cells of rows) {
    const line = body.insertRow();
    cells.forEach((cell, k) => line.append(element("td", cell, columns[k][1] ? "text" : "")));
  }
  return table;
}

// Facts of the chosen drives; those of all where the page holds not all.
function showFacts(rows) {
  const sum = (values) => rows.reduce((total, row) => total + (values[row] || 0), 0);
  const with_ = (status) => rows.filter((row) => logs.status[row] === status).length;
  const counted = isFiltered() || !data.left_out ? [
    [rows.length, "logs", ""], ...STATUSES.map((name, k) => [with_(k), name, k && with_(k) ? "bad" : ""]),
    [(sum(logs.duration) / 3600).toFixed(1), "hours", ""], [sum(logs.distance).toFixed(1), "km", ""],
  ] : data.facts;
  byId("facts").replaceChildren(...counted.map(([value, name, kind]) => {
    const box = element("div", undefined, kind);
    box.append(element("b", String(value)), name);
    return box;
  }));
}

const RANKED = [["estimator", true], ["logs"], ["RMSE median"], ["5 %"], ["95 %"], ["in 2 sd"], ["valid"]];

function showRanking(ranked) {
  byId("ranking").replaceChildren(plainTable(RANKED, ranked.map((r) => [r.estimator, String(r.logs), figure(r.rmse[2]), figure(r.rmse[0]), figure(r.rmse[4]),
      percent(r.inside), percent(r.valid)])), glossary(RANKED.map(([title]) => title)));
  const shown = ranked.filter((r) => Number.isFinite(r.rmse[2])).reverse();
  draw("distribution", shown.map((r) => ({
    type: "box", orientation: "h", y: [plain(r.estimator)], q1: [r.rmse[1]], median: [r.rmse[2]], q3: [r.rmse[3]],
    lowerfence: [r.rmse[0]], upperfence: [r.rmse[4]], marker: { color: data.colors[r.estimator] }, hoverinfo: "x",
  })), {
    height: Math.max(320, 60 + 24 * shown.length), showlegend: false,
    xaxis: { title: { text: "RMSE of " + state.angle.replace("_", " ") + ", " + unitOf(state.angle) + "<br>box 25–75 %, whiskers 5–95 %" }, rangemode: "tozero" },
    yaxis: { type: "category" },
  });
}

function pager(rows, make) {
  const box = element("div");
  const pages = Math.max(1, Math.ceil(rows.length / PAGE));
  const show = (page) => {
    const bar = element("div", undefined, "pager");
    const step = (text, to) => {
      const button = element("button", text);
      button.type = "button";
      button.disabled = to < 0 || to >= pages;
      button.onclick = () => show(to);
      return button;
    };
    bar.append(step("Previous", page - 1), step("Next", page + 1), element("span",
      rows.length ? (page * PAGE + 1) + "–" + Math.min(rows.length, (page + 1) * PAGE) + " of " + rows.length : "none",
      "soft"));
    const scroll = element("div", undefined, "scroll");
    scroll.append(make(rows.slice(page * PAGE, (page + 1) * PAGE)));
    box.replaceChildren(scroll, bar);
  };
  show(0);
  return box;
}

function logCell(row) {
  const cell = element("td", undefined, "text");
  if (logs.detail[row]) {
    const link = element("a", logs.name[row]);
    link.href = logs.detail[row] + (byId("slope").value === "percent" ? "#percent" : "");
    cell.append(link);
  } else {
    cell.textContent = logs.name[row];
  }
  cell.title = logs.log[row];
  cell.classList.add("name");
  return cell;
}

function driveColumns(pair) {
  return [
    { key: "name", title: "log", text: true, value: (row) => logs.name[row], cell: logCell },
    { key: "status", title: "status", text: true, value: (row) => STATUSES[logs.status[row]] },
    { key: "vehicle", title: "vehicle", text: true, value: (row) => data.vehicles[logs.vehicle[row]] },
    { key: "road", title: "road", text: true, value: (row) => data.roads[logs.road[row]] },
    { key: "duration", title: "min:s", value: (row) => logs.duration[row], show: minutes },
    { key: "distance", title: "km", value: (row) => logs.distance[row], show: (v) => figure(v, 1) },
    { key: "rmse", title: "RMSE", unit: unitOf(state.angle), value: (row) => pair.rmse[row], show: figure },
    { key: "bias", title: "mean", unit: unitOf(state.angle), value: (row) => pair.bias[row], show: figure },
    { key: "inside", title: "in 2 sd", value: (row) => pair.inside[row], show: percent },
    { key: "valid", title: "valid", value: (row) => pair.valid[row], show: percent },
    { key: "warnings", title: "warnings", value: (row) => logs.warnings[row], show: (v) => figure(v, 0) },
    { key: "seconds", title: "took s", value: (row) => logs.seconds[row], show: (v) => figure(v, 1) },
  ];
}

function showDrives(rows, estimator) {
  const pair = pairOf(estimator) || { rmse: nothing, bias: nothing, inside: nothing, valid: nothing };
  const shown = state.estimator ? rows.filter((row) => !Number.isNaN(pair.valid[row])) : rows.slice();
  const columns = driveColumns(pair);
  const column = columns.find((c) => c.key === state.sort);
  const sign = state.down ? -1 : 1;
  const values = column.text ? Array.from({ length: count }, (_, row) => column.value(row)) : null;
  const collator = new Intl.Collator();
  shown.sort(values
    ? (a, b) => sign * collator.compare(values[a], values[b]) || a - b
    : (a, b) => {
      const [x, y] = [column.value(a), column.value(b)];
      if (Number.isNaN(x) || Number.isNaN(y)) return Number.isNaN(x) - Number.isNaN(y) || a - b;
      return sign * (x - y) || a - b;
    });
  byId("drives").replaceChildren(pager(shown, (page) => {
    const table = element("table");
    const head = table.createTHead().insertRow();
    for (const c of columns) {
      const th = element("th", undefined, c.text ? "text" : "");
      const button = element("button");
      button.append(term(c.title), c.unit ? ", " + c.unit : "");
      button.type = "button";
      button.onclick = () => {
        state.down = state.sort === c.key ? !state.down : !c.text;
        state.sort = c.key;
        update();
      };
      if (c.key === state.sort) th.setAttribute("aria-sort", state.down ? "descending" : "ascending");
      th.append(button);
      head.append(th);
    }
    const body = table.createTBody();
    for (const row of page) {
      const line = body.insertRow();
      for (const c of columns) {
        const value = c.value(row);
        line.append(c.cell ? c.cell(row) : element("td", c.show ? c.show(value) : value, c.text ? "text" : ""));
      }
      if (logs.status[row]) line.cells[1].classList.add("bad");
    }
    return table;
  }));
  byId("count").textContent = (shown.length === count ? "" : shown.length + " of ") + count + (count === 1 ? " log" : " logs");
}

function showFailures(rows) {
  const failed = rows.filter((row) => logs.status[row]);
  byId("failures").replaceChildren(failed.length ? pager(failed, (page) => {
    const table = plainTable([["log", true], ["status", true], ["message", true]],
      page.map((row) => ["", STATUSES[logs.status[row]], logs.message[row]]));
    page.forEach((row, k) => table.tBodies[0].rows[k].cells[0].replaceWith(logCell(row)));
    return table;
  }) : element("p", isFiltered() ? "none of the chosen drives" : "none", "soft"));
}

// Lines of the comparison of drives that are chosen; all where the page does not hold the drive.
function showComparison(rows) {
  if (!byId("comparison")) return;
  const present = new Set(logs.name);
  const chosen = new Set(rows.map((row) => logs.name[row]));
  const lines = [...byId("comparison").tBodies[0].rows];
  for (const line of lines) {
    const name = line.cells[0].textContent;
    line.hidden = isFiltered() && (present.has(name) ? !chosen.has(name) : true);
  }
  const left = lines.filter((line) => !line.hidden).length;
  byId("compared").textContent = isFiltered() ? left + " of " + lines.length + " changes are of the chosen drives." : "";
}

function update() {
  const rows = chosenRows();
  const ranked = rank(rows);
  const best = ranked.length ? ranked[0].estimator : "";
  fill(byId("estimator"), [["", "best ranked" + (best ? " (" + best + ")" : "")], ...names.filter(
    (name) => pairs.has(name + " " + state.angle)).map((name) => [name, name])], state.estimator);
  if (byId("estimator").value !== state.estimator) state.estimator = byId("estimator").value = "";
  showFacts(rows);
  showRanking(ranked);
  showDrives(rows, state.estimator || best);
  showFailures(rows);
  showRoads(rows);
  showComparison(rows);
}

fill(byId("angle"), angles.map((a) => [a, a.replace("_", " ")]), state.angle);
fill(byId("vehicle"), [["", "all"], ...data.vehicles.map((v, k) => [k, v || "(unknown)"])], "");
fill(byId("road"), [["", "all"], ...data.roads.map((v, k) => [k, v || "(unknown)"])], "");
fill(byId("status"), [["", "all"], ...STATUSES.map((v, k) => [k, v])], "");
byId("angle").onchange = () => { state.angle = byId("angle").value; update(); };
byId("estimator").onchange = () => { state.estimator = byId("estimator").value; update(); };
for (const id of ["vehicle", "road", "status"]) byId(id).onchange = update;
byId("text").oninput = update;
byId("reset").onclick = () => {
  for (const id of ["vehicle", "road", "status", "text"]) byId(id).value = "";
  Object.assign(state, { estimator: "", sort: "rmse", down: true });
  update();
};
dark.addEventListener("change", update);
chooseSlope(data.slope, update);
update();
performance.mark("rows"); // from here on a reader can work, while the plots are still to come
