"use strict";
// Draws what report.py has put into the element "data"; all numbers are the model's, none is computed from equations.
const DATA = JSON.parse(document.getElementById("data").textContent);
const NAMES = { nlcs: "N-LCS", lcs: "LCS", frame: "frame" };
const PARTS = { afe: "AFE", converter: "converter", io: "I/O" };
const SHAPES = {
  circle: "M-5 0a5 5 0 1 0 10 0a5 5 0 1 0 -10 0z", square: "M-4.5 -4.5h9v9h-9z",
  triangle: "M0 -6l5.6 10h-11.2z", diamond: "M0 -6.4l5 6.4l-5 6.4l-5 -6.4z",
};
const SHAPE_OF = { nlcs: "triangle", lcs: "circle", frame: "square" };
const byId = (id) => document.getElementById(id);

// -- words -------------------------------------------------------------------------------------------

function si(value, unit) {
  if (!value) return `0 ${unit}`;
  const prefixes = ["p", "n", "\u00b5", "m", "", "k", "M", "G"];
  const step = Math.max(-4, Math.min(3, Math.floor(Math.log10(Math.abs(value) * 1.0005) / 3)));
  return `${Number((value / 1000 ** step).toPrecision(3))} ${prefixes[step + 4]}${unit}`;
}
const exact = (value, unit) => `${si(value, unit)} (${value} ${unit})`;
const plain = (value) => (value >= 1000 ? Math.round(value).toLocaleString("en") : String(Number(Number(value).toPrecision(3))));
const tauName = (tau) => `N-LCS, ${si(tau, "s")}`;

// -- SVG ---------------------------------------------------------------------------------------------

function node(parent, tag, attributes = {}, text = "") {
  const svg = ["svg", "g", "path", "rect", "line", "text", "polyline"].includes(tag);
  const made = svg ? document.createElementNS("http://www.w3.org/2000/svg", tag) : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  if (text !== "") made.textContent = text;
  parent.append(made);
  return made;
}

// A figure with a heading and an empty drawing; the arrow keys go through its marks.
function figure(parent, title, soft, width, height, basis) {
  const box = node(parent, "figure", basis ? { style: `--width: ${basis}` } : {});
  const caption = node(box, "figcaption", {}, title);
  if (soft) node(caption, "span", {}, soft);
  const svg = node(box, "svg", { viewBox: `0 0 ${width} ${height}`, style: `--drawn: ${width}px`, tabindex: 0, role: "group" });
  svg.setAttribute("aria-label", `${title}. ${soft || ""} Arrow keys read the values.`);
  return svg;
}

function decades(low, high) {
  const found = [];
  for (let k = Math.ceil(Math.log10(low) - 1e-9); 10 ** k <= high * 1.0001; k++) found.push(10 ** k);
  return found;
}

const logScale = (low, high, from, to) => (value) =>
  from + ((Math.log10(value) - Math.log10(low)) / (Math.log10(high) - Math.log10(low))) * (to - from);
const ends = (values) => [10 ** Math.floor(Math.log10(Math.min(...values))), 10 ** Math.ceil(Math.log10(Math.max(...values)))];

function logAxis(svg, ticks, scale, left, right, label, unit) {
  const skip = Math.ceil(ticks.length / 9);
  ticks.forEach((tick, k) => {
    node(svg, "line", { class: "grid", x1: left, x2: right, y1: scale(tick), y2: scale(tick) });
    if (k % skip === 0) {
      const text = unit ? si(tick, unit) : plain(tick);
      node(svg, "text", { class: "soft", x: left - 6, y: scale(tick) + 4, "text-anchor": "end" }, text);
    }
  });
  node(svg, "text", { class: "soft", x: 0, y: 12 }, label);
}

function mark(svg, tag, attributes, tip) {
  return node(svg, tag, { class: "mark", "data-tip": tip, role: "img", "aria-label": tip, ...attributes });
}

function point(svg, shape, x, y, colour, tip) {
  return mark(svg, "path", { d: SHAPES[shape], transform: `translate(${x} ${y})`, fill: `var(--${colour})` }, tip);
}

function legend(parent, entries) {
  const box = node(parent, "div", { class: "legend" });
  for (const [name, colour, shape] of entries) {
    const item = node(box, "span");
    if (shape) {
      const svg = node(item, "svg", { viewBox: "-7 -7 14 14", "aria-hidden": true });
      node(svg, "path", { d: SHAPES[shape], fill: `var(--${colour})` });
    } else node(item, "i", { style: `background: var(--${colour})` });
    item.append(name);
  }
}

// -- the hover text ----------------------------------------------------------------------------------

function showTip(text, x, y) {
  const tip = byId("tip");
  tip.textContent = text;
  tip.hidden = false;
  const box = tip.getBoundingClientRect();
  tip.style.left = `${Math.max(4, Math.min(x + 14, innerWidth - box.width - 8))}px`;
  tip.style.top = `${y + 18 + box.height > innerHeight ? y - box.height - 10 : y + 18}px`;
}
const hideTip = () => { byId("tip").hidden = true; };

document.addEventListener("pointermove", (event) => {
  if (event.target.id === "raster") return;
  const found = event.target.closest && event.target.closest(".mark");
  if (found) showTip(found.dataset.tip, event.clientX, event.clientY);
  else hideTip();
});

function leaveMarks() {
  document.querySelectorAll(".mark.here").forEach((found) => found.classList.remove("here"));
  hideTip();
}
document.addEventListener("focusout", leaveMarks);
document.addEventListener("keydown", (event) => {
  const svg = event.target.closest && event.target.closest(".chart svg");
  if (event.key === "Escape") leaveMarks();
  const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
  if (!svg || !step) return;
  const marks = [...svg.querySelectorAll(".mark")];
  const here = marks.findIndex((found) => found.classList.contains("here"));
  const next = marks[here < 0 ? (step > 0 ? 0 : marks.length - 1) : (here + step + marks.length) % marks.length];
  if (!next) return;
  event.preventDefault();
  leaveMarks();
  next.classList.add("here");
  const box = next.getBoundingClientRect();
  showTip(next.dataset.tip, box.left + box.width / 2, box.top + box.height / 2);
});

// -- charts ------------------------------------------------------------------------------------------

// Stacked bars: groups of {title, bars: [{name, afe, converter, io, total, more}]} on a logarithmic axis in watts.
function stackedBars(svg, groups, low, high, where) {
  const [width, height, left, bottom] = [520, 300, 62, 46];
  const y = logScale(low, high, height - bottom, 24);
  logAxis(svg, decades(low, high), y, left, width, "power", "W");
  const count = groups.reduce((sum, group) => sum + group.bars.length, 0);
  const step = (width - left) / (count + 0.6 * groups.length);
  let x = left + 0.3 * step;
  for (const group of groups) {
    const start = x;
    for (const bar of group.bars) {
      let sum = 0;
      for (const part of ["afe", "converter", "io"]) {
        const [from, to] = [Math.max(sum, low), Math.max(sum + bar[part], low)];
        sum += bar[part];
        const tip = `${bar.name}, ${where}${group.title ? ", " + group.title : ""}\n${PARTS[part]} ${exact(bar[part], "W")}\n` +
          `total ${exact(bar.total, "W")}${part === "converter" && bar.more ? "\n" + bar.more : ""}`;
        const box = { x: x + 0.08 * step, width: 0.84 * step, y: y(to), height: Math.max(0, y(from) - y(to)) };
        const made = mark(svg, "rect", { ...box, fill: `var(--${part})` }, tip);
        made.dataset.watts = bar[part];
        made.dataset.bar = bar.name;
        made.dataset.part = part;
      }
      const middle = { x: x + step / 2, "text-anchor": "middle" };
      const size = step < 45 ? "font-size: 9px" : "";
      node(svg, "text", { ...middle, class: "soft", style: size, y: y(bar.total) - 5 }, si(bar.total, "W"));
      const [short, detail] = bar.name.split(", ");
      node(svg, "text", { ...middle, y: height - bottom + 15 }, short);
      if (detail && !group.title) node(svg, "text", { ...middle, class: "soft", y: height - bottom + 30 }, detail);
      x += step;
    }
    const centre = { x: (start + x) / 2, y: height - 12, "text-anchor": "middle" };
    if (group.title) node(svg, "text", centre, group.title);
    x += 0.6 * step;
  }
  node(svg, "line", { class: "axis", x1: left, x2: width, y1: height - bottom, y2: height - bottom });
}

function lines(svg, xs, series, low, high, label, unit, even) {
  const [width, height, left, bottom] = [360, 290, 56, 40];
  const y = logScale(low, high, height - bottom, 24);
  const x = (value) => left + 16 + ((value - xs[0]) / (xs[xs.length - 1] - xs[0])) * (width - left - 30);
  logAxis(svg, decades(low, high), y, left, width, label, unit);
  if (even) node(svg, "line", { class: "even", x1: left, x2: width, y1: y(1), y2: y(1) });
  for (const n of xs) node(svg, "text", { x: x(n), y: height - bottom + 16, "text-anchor": "middle" }, n);
  node(svg, "text", { class: "soft", x: (left + width) / 2, y: height - 8, "text-anchor": "middle" }, "resolution N (bit)");
  for (const line of series) {
    const drawn = xs.map((n, k) => [n, line.values[k], line.tips[k]]).filter((found) => found[1] !== null);
    const path = drawn.map(([n, value]) => `${x(n)},${y(value)}`).join(" ");
    node(svg, "polyline", { points: path, fill: "none", stroke: `var(--${line.colour})`, "stroke-width": 1.8 });
    for (const [n, value, tip] of drawn) point(svg, line.shape, x(n), y(value), line.colour, tip);
  }
  node(svg, "line", { class: "axis", x1: left, x2: width, y1: height - bottom, y2: height - bottom });
}

// Rows of {name, items: [{value, tip, colour, shape, least, most}]} along a logarithmic axis; even marks 1.
function rows(svg, entries, low, high, left, label, bars) {
  const [width, step, top] = [860, 19, 24];
  const x = logScale(low, high, left, width - 30);
  const bottom = top + step * entries.length;
  for (const tick of decades(low, high)) {
    node(svg, "line", { class: tick === 1 ? "even" : "grid", x1: x(tick), x2: x(tick), y1: top - 6, y2: bottom });
    node(svg, "text", { class: "soft", x: x(tick), y: top - 11, "text-anchor": "middle" }, plain(tick));
  }
  node(svg, "text", { class: "soft", x: 0, y: top - 11 }, label);
  entries.forEach((entry, k) => {
    const y = top + step * (k + 0.5);
    if (entry.rule) node(svg, "line", { class: "grid", x1: 0, x2: width - 30, y1: y - step / 2, y2: y - step / 2 });
    node(svg, "text", { x: 0, y: y + 4 }, entry.name);
    for (const item of entry.items) {
      if (!bars) { point(svg, item.shape, x(item.value), y, item.colour, item.tip); continue; }
      const [from, to] = [x(1), x(item.value)].sort((a, b) => a - b);
      const box = { x: from - 1, width: Math.max(2, to - from + 1), y: y - 6, height: 12, fill: "var(--lcs)" };
      mark(svg, "rect", box, item.tip);
      if (item.least) node(svg, "line", { class: "even", x1: x(item.least), x2: x(item.most), y1: y, y2: y });
    }
  });
}
const rowsHeight = (entries) => 24 + 19 * entries.length + 4;

// -- the power figures -------------------------------------------------------------------------------

function fig6() {
  const chart = byId("chart-fig6"), data = DATA.fig6;
  const totals = Object.values(data.modes).flat().flatMap((entry) => Object.values(entry).map((found) => found.total));
  const [low, high] = ends(totals);
  for (const [mode, entries] of Object.entries(data.modes)) {
    const svg = figure(chart, `${mode} mode`, "", 520, 300, "26rem");
    const groups = entries.map((entry, k) => ({
      title: `${plain(data.noise_v_rms[k] * 1e3)} mV rms`,
      bars: Object.keys(NAMES).map((readout) => ({ name: NAMES[readout], ...entry[readout] })),
    }));
    stackedBars(svg, groups, low / 10, high, `${mode} mode`);
  }
  legend(chart, Object.entries(PARTS).map(([part, name]) => [name, part]));
}

function seriesOf(entry, xs, unit, where) {
  const tip = (name, n, value) => `${name}, N = ${n}, ${where}\n` + (unit ? exact(value, unit) : `${plain(value)} times (${value})`);
  const taus = Object.keys(entry.nlcs).map((tau, k) => [tauName(Number(tau)), entry.nlcs[tau], `tau${k}`, ["triangle", "square", "diamond"][k]]);
  return [...taus, ["LCS", entry.lcs, "lcs", "circle"]].map(([name, values, colour, shape]) => (
    { name, values, colour, shape, tips: xs.map((n, k) => (values[k] === null ? "" : tip(name, n, values[k]))) }));
}

function fig7() {
  const chart = byId("chart-fig7"), data = DATA.fig7, xs = data.resolution;
  const modes = Object.entries(data.modes);
  const all = modes.map(([mode, entry]) => [mode, seriesOf(entry.crossover, xs, "V", `${mode} mode, AFE noise`)]);
  const sides = ({ spikes_win: won }) => [...Object.values(won.nlcs).flat(), ...won.lcs].filter((side) => side === "above" || side === "below");
  const found = all.flatMap(([, series]) => series.flatMap((line) => line.values)).filter((value) => value !== null);
  for (const [mode, series] of all) {
    const none = series.every((line) => line.values.every((value) => value === null));
    const won = [...new Set(sides(data.modes[mode]))];
    const soft = none ? "none at any resolution" : `spikes cost less ${won.join(" or ")} ${won.length > 1 ? "(see the table)" : "the line"}`;
    const svg = figure(chart, `${mode} mode: crossover`, soft, 360, 290);
    if (!none) { lines(svg, xs, series, ...ends(found), "AFE noise, rms", "V"); continue; }
    node(svg, "text", { x: 10, y: 40 }, "At any noise less power is drawn by");
    DATA.fig7_notes[mode].forEach((text, k) => text.split(": ").forEach((half, line) => (
      node(svg, "text", { x: 10 + 14 * line, y: 70 + 50 * k + 18 * line, class: line ? "" : "soft" }, half))));
  }
  const [mode, last] = modes[modes.length - 1];
  const ratios = seriesOf(last.ratio, xs, "", `${mode} mode, ${si(data.ratio_noise_v_rms, "V")}, spiking / frame`);
  const svg = figure(chart, `${mode} mode: spiking / frame`, `power at ${si(data.ratio_noise_v_rms, "V")}`, 360, 290);
  lines(svg, xs, ratios, ...ends(ratios.flatMap((line) => line.values).concat(1)), "times the frame readout", "", true);
  legend(chart, ratios.map((line) => [line.name, line.colour, line.shape]));
}

function sensitivity() {
  const chart = byId("chart-sensitivity"), data = DATA.sensitivity, choice = byId("sensitivity-noise");
  data.noise_v_rms.forEach((noise, k) => node(choice, "option", { value: k }, `${plain(noise * 1e3)} mV rms`));
  choice.value = 1;
  const [low, high] = ends(data.rows.flatMap((row) => Object.values(row.ratio).flat()));
  const draw = () => {
    const k = Number(choice.value);
    const side = (found) => found.spikes_win + (found.noise_v_rms === null ? "" : ` ${exact(found.noise_v_rms, "V")}`);
    const entries = data.rows.map((row, number) => ({
      name: row.case, rule: number > 0 && row.group !== data.rows[number - 1].group,
      items: Object.keys(row.ratio).map((readout) => ({
        value: row.ratio[readout][k], colour: readout, shape: SHAPE_OF[readout],
        tip: `${NAMES[readout]}, ${row.case}\n${plain(row.ratio[readout][k])} times frames (${row.ratio[readout][k]})\n` +
          `spikes win: ${side(row.crossover[readout])}`,
      })),
    }));
    chart.replaceChildren();
    const svg = figure(chart, "Spiking / frame power", `at ${exact(data.noise_v_rms[k], "V")} rms`, 860, rowsHeight(entries), "100%");
    rows(svg, entries, low, high, 240, "corrections made", false);
    legend(chart, Object.keys(data.rows[0].ratio).map((readout) => [NAMES[readout], readout, SHAPE_OF[readout]]));
  };
  choice.addEventListener("change", draw);
  draw();
}

function explore() {
  const grid = DATA.grid, chart = byId("chart-explore");
  const n = byId("explore-n"), noise = byId("explore-noise"), tau = byId("explore-tau");
  const last = (slider, values, start) => Object.assign(slider, { min: 0, max: values.length - 1, step: 1, value: start });
  last(n, grid.resolution, grid.resolution.indexOf(6));
  last(noise, grid.noise_v_rms, grid.noise_v_rms.indexOf(0.001));
  for (const key of Object.keys(grid.modes.paper.nlcs)) node(tau, "option", { value: key }, si(Number(key), "s"));
  tau.value = "0.2";
  const entryOf = (mode, readout, key) => (readout === "nlcs" ? grid.modes[mode].nlcs[key] : grid.modes[mode][readout]);
  const all = Object.values(grid.modes).flatMap((mode) => [...Object.values(mode.nlcs), mode.lcs, mode.frame]);
  const [low, high] = ends(all.flatMap((entry) => entry.total.flat()));
  const draw = () => {
    const [bits, level] = [Number(n.value), Number(noise.value)];
    byId("explore-n-value").textContent = `${grid.resolution[bits]} bit`;
    byId("explore-noise-value").textContent = si(grid.noise_v_rms[level], "V");
    n.setAttribute("aria-valuetext", byId("explore-n-value").textContent);
    noise.setAttribute("aria-valuetext", byId("explore-noise-value").textContent);
    const key = tau.value, words = [];
    chart.replaceChildren();
    for (const mode of Object.keys(grid.modes)) {
      const bars = Object.keys(NAMES).map((readout) => {
        const entry = entryOf(mode, readout, key);
        const parts = Object.entries(entry.converter_parts).map(([name, part]) => `${name.replace(/_/g, " ")} ${si(part[bits], "W")}`);
        const name = readout === "nlcs" ? tauName(Number(key)) : NAMES[readout];
        return { name, afe: entry.afe[bits][level], converter: entry.converter[bits], io: entry.io[bits],
          total: entry.total[bits][level], more: `converter: ${parts.join(", ")}` };
      });
      const svg = figure(chart, `${mode} mode`, "", 520, 300, "26rem");
      svg.dataset.mode = mode;
      stackedBars(svg, [{ title: "", bars }], low, high, `${mode} mode, ${grid.resolution[bits]} bit, ${si(grid.noise_v_rms[level], "V")}`);
      const least = bars.reduce((best, bar) => (bar.total < best.total ? bar : best));
      const frames = bars[bars.length - 1].total;
      words.push(`${mode} mode: ${least.name.split(",")[0]} draws least; N-LCS ${plain(bars[0].total / frames)} and LCS ${plain(bars[1].total / frames)} times frames.`);
    }
    legend(chart, Object.entries(PARTS).map(([part, name]) => [name, part]));
    byId("explore-words").textContent = words.join(" ");
  };
  for (const control of [n, noise, tau]) control.addEventListener("input", draw);
  draw();
}

// -- accuracy, benchmarks, synthesis, downloads ------------------------------------------------------

function fig9() {
  if (!DATA.fig9) return;
  const points = DATA.fig9.points, chart = byId("chart-fig9");
  const svg = figure(chart, "Accuracy against data rate", DATA.fig9.source, 860, 320, "100%");
  const [low, high] = ends(points.map((found) => found.data_rate_bps).flatMap((rate) => [rate * 0.99, rate * 1.01]));
  const x = logScale(low, high, 62, 830);
  const least = Math.floor(10 * Math.min(...points.map((found) => (found.interval || [found.accuracy])[0])) - 1e-9) / 10;
  const y = (value) => 280 - ((value - least) / (1 - least)) * 256;
  for (const tick of decades(low, high)) {
    node(svg, "line", { class: "grid", x1: x(tick), x2: x(tick), y1: 24, y2: 280 });
    node(svg, "text", { class: "soft", x: x(tick), y: 296, "text-anchor": "middle" }, si(tick, "bit/s"));
  }
  for (let k = 0; k <= 5; k++) {
    const tick = least + ((1 - least) * k) / 5;
    node(svg, "line", { class: "grid", x1: 62, x2: 830, y1: y(tick), y2: y(tick) });
    node(svg, "text", { class: "soft", x: 56, y: y(tick) + 4, "text-anchor": "end" }, `${plain(tick * 100)} %`);
  }
  const taken = [];  // a label that would lie on another is left to the mark's tip and the table
  for (const found of [...points].sort((a, b) => Boolean(b.interval) - Boolean(a.interval))) {
    const known = NAMES[found.readout] ? found.readout : "tau2", place = [x(found.data_rate_bps), y(found.accuracy)];
    const span = found.interval ? `\ninterval ${found.interval.map((end) => `${plain(end * 100)} %`).join(" to ")}` : "";
    if (found.interval) node(svg, "line", { class: "axis", x1: place[0], x2: place[0], y1: y(found.interval[0]), y2: y(found.interval[1]) });
    point(svg, SHAPE_OF[found.readout] || "diamond", ...place, known, `${found.label}\naccuracy ${plain(found.accuracy * 100)} % (${found.accuracy})\n${exact(found.data_rate_bps, "bit/s")}${span}`);
    const box = [place[0] + 9, place[1] - 7, place[0] + 9 + 6.4 * found.label.length, place[1] + 7];
    if (taken.some((other) => box[0] < other[2] && other[0] < box[2] && box[1] < other[3] && other[1] < box[3])) continue;
    taken.push(box);
    node(svg, "text", { class: "soft", x: box[0], y: place[1] + 4 }, found.label);
  }
}

function benchmarks() {
  for (const bench of DATA.benchmarks) {
    const entries = bench.bars.map((bar) => {
      const spread = bar.least ? `\n${plain(bar.least)} to ${plain(bar.most)} over all rounds` : "";
      return { name: bar.name, items: [{ value: bar.median, least: bar.least, most: bar.most, tip: `${bar.name}\n${plain(bar.median)} times (${bar.median})${spread}` }] };
    });
    const [low, high] = ends(bench.bars.flatMap((bar) => [bar.least || bar.median, bar.most || bar.median, 1.2]));
    const settings = Object.entries(bench.settings).map(([name, value]) => `${plain(value)} ${name.replace(/_/g, " ")}`).join(", ");
    const svg = figure(byId("chart-benchmarks"), `${bench.name}: ${bench.meaning}`, settings, 860, rowsHeight(entries), "100%");
    rows(svg, entries, low, high, 240, "times", true);
  }
}

function synthesis() {
  if (!DATA.synthesis.length) return;
  const entries = DATA.synthesis.map((found) => {
    const perTaxel = found.area_um2 / (found.rows * found.columns);
    return { name: `${NAMES[found.readout]}, ${found.rows} x ${found.columns}`, items: [{ value: Math.max(perTaxel, 1e-3),
      tip: `${NAMES[found.readout]} ${found.process}\n${exact(found.area_um2, "um^2")}, ${plain(perTaxel)} um^2 a taxel` }] };
  });
  const svg = figure(byId("chart-synthesis"), "Area of the cells, um^2 a taxel", "", 860, rowsHeight(entries), "100%");
  rows(svg, entries, ...ends(entries.map((entry) => entry.items[0].value).concat(1.2)), 240, "", true);
}

function downloads() {
  const named = (name, value) => {
    const button = node(byId("downloads"), "button", { type: "button" }, `${name}.json`);
    button.addEventListener("click", () => {
      const url = URL.createObjectURL(new Blob([JSON.stringify(value, null, 1) + "\n"], { type: "application/json" }));
      Object.assign(document.createElement("a"), { href: url, download: `${name}.json` }).click();
      setTimeout(() => URL.revokeObjectURL(url), 1000);
    });
  };
  named("report", DATA);
  for (const key of ["raster", "grid", "fig6", "fig7", "sensitivity", "fig9", "benchmarks", "synthesis"]) {
    if (DATA[key] && DATA[key].length !== 0) named(key, DATA[key]);
  }
}

for (const draw of [fig6, fig7, sensitivity, explore, fig9, benchmarks, synthesis, downloads]) draw();
