// The charts of the page, from what model/report/data.py has put into the element "data"; all numbers are the model's, none
// is computed from equations.
const PARTS = { afe: "AFE", converter: "converter", io: "I/O" };

// -- charts ------------------------------------------------------------------------------------------

// Parts side by side, and their sum: groups of {title, bars: [{name, afe, converter, io, total, more}]} on a logarithmic
// axis in watts; as many groups in a row as have room.
function partBars(svg, width, groups, low, high, where) {
  const [left, tall, top, under] = [52, 230, 30, groups[0].title ? 46 : 40];
  const most = Math.max(...groups.map((group) => group.bars.length));
  const inRow = Math.max(1, Math.min(groups.length, Math.floor((width - left) / (43 * (most + 0.3)))));
  const cell = (width - left) / inRow, step = cell / (most + 0.3);
  const taken = []; // by the numbers of the sums
  groups.forEach((group, number) => {
    const [row, column] = [Math.floor(number / inRow), number % inRow];
    const above = row * (tall + top + under), bottom = above + top + tall;
    const y = logScale(low, high, bottom, above + top);
    if (column === 0) {
      const axis = node(svg, "g", {});
      logAxis(axis, decades(low, high), y, left, width, row ? "" : "power", "W");
      node(svg, "line", { class: "axis", x1: left, x2: width, y1: bottom, y2: bottom });
    }
    group.bars.forEach((bar, k) => {
      const start = left + column * cell + (0.15 + k) * step, middle = { x: start + step / 2, "text-anchor": "middle" };
      Object.keys(PARTS).forEach((part, place) => {
        const tip = `${bar.name}, ${where}${group.title ? ", " + group.title : ""}\n${PARTS[part]} ${fine(bar[part], "W")}\n` +
          `sum ${fine(bar.total, "W")}${part === "converter" && bar.more ? "\n" + bar.more : ""}`;
        const end = y(Math.max(bar[part], low));
        const box = { x: start + (0.09 + 0.28 * place) * step, width: 0.26 * step, y: end, height: bottom - end };
        const made = mark(svg, "rect", { ...box, fill: `var(--${part})` }, tip, bar[part]);
        Object.assign(made.dataset, { watts: bar[part], bar: bar.name, part });
      });
      const sum = y(bar.total);
      node(svg, "line", { class: "even", x1: start + 0.07 * step, x2: start + 0.93 * step, y1: sum, y2: sum });
      const said = node(svg, "text", { ...middle, class: "soft" }, si(bar.total, "W")), half = said.getComputedTextLength() / 2 + 2;
      let box = [middle.x - half, sum - 16, middle.x + half, sum - 4];
      while (taken.some((other) => meet(box, other))) box = [box[0], box[1] - 1, box[2], box[3] - 1];
      taken.push(box);
      said.setAttribute("y", box[3] - 1);
      const [short, detail] = bar.name.split(", ");
      node(svg, "text", { ...middle, y: bottom + 15 }, short);
      if (detail && !group.title) node(svg, "text", { ...middle, class: "soft", y: bottom + 30 }, detail);
    });
    const centre = { x: left + (column + 0.5) * cell, y: bottom + 33, "text-anchor": "middle", class: "soft" };
    if (group.title) node(svg, "text", centre, group.title);
  });
  return Math.ceil(groups.length / inRow) * (tall + top + under);
}
const partKeys = () => [...Object.entries(PARTS).map(([part, name]) => [name, part]), ["sum", "text", "dash"]];

function lines(svg, width, xs, series, low, high, label, unit, even) {
  const [height, left, bottom] = [290, 56, 40];
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
    for (const [n, value, tip] of drawn) point(svg, line.shape, x(n), y(value), line.colour, tip, value);
  }
  node(svg, "line", { class: "axis", x1: left, x2: width, y1: height - bottom, y2: height - bottom });
  return height;
}

// Rows of {name, items: [{value, tip, colour, shape, least, most}]} along a logarithmic axis; even marks 1. Names stand
// before the rows, or above them where there is no room.
function rows(svg, width, entries, low, high, label, bars) {
  const names = entries.map((entry) => node(svg, "text", { x: 0 }, entry.name));
  const longest = Math.max(...names.map((name) => name.getComputedTextLength()));
  const above = longest > 0.4 * width, right = width - 24;
  const [left, step, top] = [above ? 14 : longest + 24, above ? 38 : 19, label ? 40 : 24];
  const x = logScale(low, high, left, right), bottom = top + step * entries.length;
  const ticks = decades(low, high), skip = Math.ceil((38 * ticks.length) / (right - left));
  ticks.forEach((tick, k) => {
    node(svg, "line", { class: tick === 1 ? "even" : "grid", x1: x(tick), x2: x(tick), y1: top - 6, y2: bottom });
    if (k % skip) return;
    node(svg, "text", { class: "soft", x: x(tick), y: top - 11, "text-anchor": "middle" }, plain(tick));
  });
  if (label) node(svg, "text", { class: "soft", x: 0, y: 12 }, label);
  entries.forEach((entry, k) => {
    const start = top + step * k, y = above ? start + 28 : start + step / 2;
    if (entry.rule) node(svg, "line", { class: "grid", x1: 0, x2: right, y1: start, y2: start });
    names[k].setAttribute("y", above ? start + 15 : y + 4);
    svg.append(names[k]);
    for (const item of entry.items) {
      if (!bars) { point(svg, item.shape, x(item.value), y, item.colour, item.tip, item.value); continue; }
      const [from, to] = [x(1), x(item.value)].sort((a, b) => a - b);
      const box = { x: from - 1, width: Math.max(2, to - from + 1), y: y - 6, height: 12, fill: "var(--lcs)" };
      mark(svg, "rect", box, item.tip, item.value);
      if (item.least) node(svg, "line", { class: "even", x1: x(item.least), x2: x(item.most), y1: y, y2: y });
    }
  });
  return bottom + 4;
}

// -- the power figures -------------------------------------------------------------------------------

function fig6() {
  const chart = byId("chart-fig6"), data = DATA.fig6;
  const bars = Object.values(data.modes).flat().flatMap((entry) => Object.values(entry));
  const [low] = ends(bars.flatMap((bar) => Object.keys(PARTS).map((part) => bar[part])).filter((power) => power > 0));
  const [, high] = ends(bars.map((bar) => bar.total));
  for (const [mode, entries] of Object.entries(data.modes)) {
    const groups = entries.map((entry, k) => ({
      title: `${plain(data.noise_v_rms[k] * 1e3)} mV rms`,
      bars: Object.keys(NAMES).map((readout) => ({ name: NAMES[readout], ...entry[readout] })),
    }));
    figure(chart, `${mode} mode`, "", "26rem", (svg, width) => partBars(svg, width, groups, low, high, `${mode} mode`));
  }
  legend(chart, partKeys());
}

function seriesOf(entry, xs, unit, where) {
  const tip = (name, n, value) => `${name}, N = ${n}, ${where}\n` + (unit ? fine(value, unit) : `${plain(value, 4)} times`);
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
    const soft = `spikes cost less ${won.join(" or ")} ${won.length > 1 ? "(see the table)" : "the line"}`;
    if (!none) {
      figure(chart, `${mode} mode: crossover`, soft, "", (svg, width) => (
        lines(svg, width, xs, series, ...ends(found), "AFE noise, rms", "V")));
      continue;
    }
    const box = node(chart, "div", { class: "words" });
    node(box, "p", {}, `In ${mode} mode there is no crossover; at any noise less power is drawn by`);
    const list = node(box, "ul");
    for (const text of DATA.fig7_notes[mode]) node(list, "li", {}, text);
  }
  const [mode, last] = modes[modes.length - 1];
  const ratios = seriesOf(last.ratio, xs, "", `${mode} mode, ${si(data.ratio_noise_v_rms, "V")}, spiking / frame`);
  const range = ends(ratios.flatMap((line) => line.values).concat(1));
  figure(chart, `${mode} mode: spiking / frame`, `power at ${si(data.ratio_noise_v_rms, "V")}`, "", (svg, width) => (
    lines(svg, width, xs, ratios, ...range, "times the frame readout", "", true)));
  legend(chart, ratios.map((line) => [line.name, line.colour, line.shape]));
}

function sensitivity() {
  const chart = byId("chart-sensitivity"), data = DATA.sensitivity, choice = byId("sensitivity-noise");
  data.noise_v_rms.forEach((noise, k) => node(choice, "option", { value: k }, `${plain(noise * 1e3)} mV rms`));
  choice.value = 1;
  const [low, high] = ends(data.rows.flatMap((row) => Object.values(row.ratio).flat()));
  const draw = () => {
    const k = Number(choice.value);
    const side = (found) => found.spikes_win + (found.noise_v_rms === null ? "" : ` ${fine(found.noise_v_rms, "V")}`);
    const entries = data.rows.map((row, number) => ({
      name: row.case, rule: number > 0 && row.group !== data.rows[number - 1].group,
      items: Object.keys(row.ratio).map((readout) => ({
        value: row.ratio[readout][k], colour: readout, shape: SHAPE_OF[readout],
        tip: `${NAMES[readout]}, ${row.case}\n${plain(row.ratio[readout][k], 4)} times frames\n` +
          `spikes win: ${side(row.crossover[readout])}`,
      })),
    }));
    chart.replaceChildren();
    figure(chart, "Spiking / frame power", `at ${si(data.noise_v_rms[k], "V")} rms`, "100%", (svg, width) => (
      rows(svg, width, entries, low, high, "corrections made", false)));
    drawAll();
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
      const where = `${mode} mode, ${grid.resolution[bits]} bit, ${si(grid.noise_v_rms[level], "V")}`;
      figure(chart, `${mode} mode`, "", "26rem", (svg, width) => (
        partBars(svg, width, [{ title: "", bars }], low / 1e3, high, where))).dataset.mode = mode;
      const least = bars.reduce((best, bar) => (bar.total < best.total ? bar : best));
      const frames = bars[bars.length - 1].total;
      words.push(`${mode} mode: ${least.name.split(",")[0]} draws least; N-LCS ${plain(bars[0].total / frames)} and LCS ${plain(bars[1].total / frames)} times frames.`);
    }
    legend(chart, partKeys());
    drawAll();
    byId("explore-words").textContent = words.join(" ");
  };
  for (const control of [n, noise, tau]) control.addEventListener("input", draw);
  draw();
}

// -- accuracy, benchmarks, synthesis, downloads ------------------------------------------------------

// One panel for each scan; series of one sweep and readout, of frames of one network. Points of one rate stand side by side.
function fig9() {
  if (!DATA.fig9) return;
  const points = DATA.fig9.points, chart = byId("chart-fig9");
  const sweeps = [...new Set(points.map((found) => found.title || ""))];
  const [low, high] = ends(points.map((found) => found.data_rate_bps).flatMap((rate) => [rate * 0.99, rate * 1.01]));
  const least = Math.floor(10 * Math.min(...points.map((found) => (found.interval || [found.accuracy])[0])) - 1e-9) / 10;
  const frames = points.filter((found) => readoutOf(found) === "frame").map((found) => found.data_rate_bps);
  for (const preset of new Set(points.map((found) => found.preset || ""))) {
    const drawn = points.filter((found) => (found.preset || "") === preset);
    const bare = frames.length && !drawn.some((found) => readoutOf(found) === "frame") ? Math.max(...frames) : 0;
    figure(chart, preset ? `${preset} scan` : "Accuracy against data rate", "", "26rem", (svg, width) => (
      accuracyPanel(svg, width, drawn, sweeps, [low, high], least, bare)));
  }
  const readouts = [...new Set(points.map(readoutOf))];
  legend(chart, readouts.map((readout) => [{ ...NAMES, "cw-lcs": "CW-LCS" }[readout] || readout, colourOf(readout), SHAPE_OF[readout] || "diamond"]));
  if (sweeps.some(Boolean)) legend(chart, sweeps.map((sweep) => [sweep, "soft", "circle", lookOf("soft", sweep, sweeps)]));
  node(chart, "p", { class: "note" }, DATA.fig9.source);
}
const readoutOf = (found) => found.readout.split(",")[0];
const colourOf = (readout) => (SHAPE_OF[readout] ? readout : "tau2");

// Marks of a sweep: published ones are hollow, those of the others full, light, dotted at the edge.
function lookOf(colour, sweep, sweeps) {
  const k = sweeps.filter((name) => name !== "published").indexOf(sweep);
  const [fill, dash] = k < 0 ? [0, ""] : [[1, ""], [0.35, ""], [0, "2 2"]][k % 3];
  return { "fill-opacity": fill, stroke: `var(--${colour})`, "stroke-width": 1.4, "stroke-dasharray": dash };
}

function accuracyPanel(svg, width, points, sweeps, [low, high], least, bare) {
  const [left, right, top, bottom] = [46, width - 8, 16, 290];
  const x = logScale(low, high, left, right), y = (value) => bottom - ((value - least) / (1 - least)) * (bottom - top - 12);
  const ticks = decades(low, high);
  for (const tick of ticks) {
    node(svg, "line", { class: "grid", x1: x(tick), x2: x(tick), y1: top, y2: bottom });
    const anchor = tick === ticks[ticks.length - 1] ? "end" : "middle";
    node(svg, "text", { class: "soft", x: anchor === "end" ? width : x(tick), y: bottom + 16, "text-anchor": anchor }, si(tick, "bit/s"));
  }
  for (let k = 0; k <= 5; k++) {
    const tick = least + ((1 - least) * k) / 5;
    node(svg, "line", { class: "grid", x1: left, x2: right, y1: y(tick), y2: y(tick) });
    node(svg, "text", { class: "soft", x: left - 6, y: y(tick) + 4, "text-anchor": "end" }, `${plain(tick * 100)} %`);
  }
  const frame = [left, 0, width, bottom], taken = [], series = {}, named = {};
  for (const found of [...points].sort((a, b) => a.data_rate_bps - b.data_rate_bps)) {
    const [at, middle] = [x(found.data_rate_bps), y(found.accuracy)];
    const [down, up] = (found.interval || [found.accuracy, found.accuracy]).map(y);
    const boxes = [[at - 6, middle - 6, at + 6, middle + 6], [at - 2, up, at + 2, down]];
    const move = sideways(boxes, taken);
    const covered = boxes.map((box) => [box[0] + move, box[1], box[2] + move, box[3]]);
    taken.push(...covered);
    const readout = readoutOf(found), network = readout === "frame" ? found.detail : "";
    const item = { found, at: at + move, middle, down, up, box: [covered[0][0], Math.min(covered[0][1], up), covered[0][2], Math.max(covered[0][3], down)] };
    (series[[found.title, readout, network]] ||= []).push(item);
    (named[[readout, found.detail || found.label, readout === "frame" && found.title]] ||= []).push(item);
  }
  if (bare) {
    node(svg, "line", { class: "frames", x1: x(bare), x2: x(bare), y1: top, y2: bottom });
    taken.push([x(bare) - 1, top, x(bare) + 1, bottom]);
    const here = [x(bare) - 1, bottom - 40, x(bare) + 1, bottom - 20];
    label(svg, "rate of frames; none trained here", here, taken, frame, {});
  }
  for (const items of Object.values(series)) accuracySeries(svg, items, sweeps);
  for (const items of Object.values(named)) {
    const { found, box } = items.reduce((best, item) => (item.box[1] < best.box[1] ? item : best));
    label(svg, found.detail || found.label, box, taken, frame, { style: `fill: var(--${colourOf(readoutOf(found))})` });
  }
  return bottom + 24;
}

function accuracySeries(svg, items, sweeps) {
  const { readout, title } = items[0].found, name = readout.split(",")[0], colour = colourOf(name);
  const look = title === undefined ? {} : lookOf(colour, title, sweeps);
  const path = items.map((item) => `${item.at},${item.middle}`).join(" ");
  const thin = title === "published" ? 0.8 : 1.5;
  if (title !== undefined) node(svg, "polyline", { points: path, fill: "none", stroke: `var(--${colour})`, "stroke-width": thin });
  for (const { found, at, middle, down, up } of items) {
    const span = found.interval ? `\ninterval ${found.interval.map((end) => `${plain(end * 100)} %`).join(" to ")}` : "";
    if (found.interval) node(svg, "line", { x1: at, x2: at, y1: down, y2: up, stroke: `var(--${colour})`, "stroke-width": thin });
    const tip = `${found.label}\naccuracy ${plain(found.accuracy * 100)} %\n${fine(found.data_rate_bps, "bit/s")}${span}`;
    const made = point(svg, SHAPE_OF[name] || "diamond", at, middle, colour, tip, found.accuracy);
    for (const [key, value] of Object.entries(look)) made.setAttribute(key, value);
  }
}

function benchmarks() {
  for (const bench of DATA.benchmarks) {
    const entries = bench.bars.map((bar) => {
      const spread = bar.least ? `\n${plain(bar.least)} to ${plain(bar.most)} over all rounds` : "";
      return { name: bar.name, items: [{ value: bar.median, least: bar.least, most: bar.most, tip: `${bar.name}\n${plain(bar.median, 4)} times${spread}` }] };
    });
    const [low, high] = ends(bench.bars.flatMap((bar) => [bar.least || bar.median, bar.most || bar.median, 1.2]));
    const settings = Object.entries(bench.settings).map(([name, value]) => `${plain(value)} ${name.replace(/_/g, " ")}`).join(", ");
    figure(byId("chart-benchmarks"), `${bench.name}: ${bench.meaning}`, settings, "100%", (svg, width) => (
      rows(svg, width, entries, low, high, "times", true)));
  }
}

function synthesis() {
  if (!DATA.synthesis.length) return;
  const entries = DATA.synthesis.map((found) => {
    const perTaxel = found.area_um2 / (found.rows * found.columns);
    return { name: `${NAMES[found.readout]}, ${found.rows} x ${found.columns}`, items: [{ value: Math.max(perTaxel, 1e-3),
      tip: `${NAMES[found.readout]} ${found.process}\n${plain(found.area_um2, 4)} um^2, ${plain(perTaxel)} um^2 a taxel` }] };
  });
  const range = ends(entries.map((entry) => entry.items[0].value).concat(1.2));
  figure(byId("chart-synthesis"), "Area of the cells, um^2 a taxel", "", "100%", (svg, width) => (
    rows(svg, width, entries, ...range, "", true)));
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
drawAll();
