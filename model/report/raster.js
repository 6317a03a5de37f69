// The raster of address events: one panel for each recording, on a canvas, with a window in time.
(function raster() {
  const canvas = byId("raster"), from = byId("raster-from"), wide = byId("raster-window"), choice = byId("raster-run");
  const LEFT = 56, TOP = 22, GAP = 34, BOTTOM = 38, SLIDER = 1000, LEAST_CLOCKS = 64;
  let run, start, span; // the window in clocks
  let places = []; // panels: {recording, top, row}

  DATA.raster.forEach((found, k) => {
    const what = `${found.name}: ${found.encoding} ${found.resolution} b, ${found.rows} x ${found.columns}`;
    node(choice, "option", { value: k }, `${what}${found.texture ? ", " + found.texture : ""}`);
  });

  const ms = (clocks) => (clocks * 1e3) / run.clock_hz;
  const eventsOf = (recording) => ("same_as" in recording ? run.recordings[recording.same_as] : recording);

  function firstAt(times, clock) { // the first event at a clock or later
    let [low, high] = [0, times.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (times[middle] < clock) low = middle + 1; else high = middle;
    }
    return low;
  }

  function setWindow(newStart, newSpan) {
    span = Math.min(run.shown_clocks, Math.max(LEAST_CLOCKS, newSpan));
    start = Math.min(run.shown_clocks - span, Math.max(0, newStart));
    draw();
  }

  function zoom(factor, share) {
    const next = Math.min(run.shown_clocks, Math.max(LEAST_CLOCKS, span * factor));
    setWindow(start + (span - next) * share, next);
  }

  function draw() {
    const ratio = devicePixelRatio || 1, width = canvas.clientWidth || 900;
    const taxels = run.rows * run.columns, row = Math.max(1, Math.min(8, Math.floor(200 / taxels)));
    const height = TOP + run.recordings.length * (row * taxels + GAP) - GAP + BOTTOM;
    canvas.style.height = `${height}px`;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    const style = getComputedStyle(document.documentElement), colour = (name) => style.getPropertyValue(`--${name}`).trim();
    const pen = canvas.getContext("2d");
    pen.scale(ratio, ratio);
    pen.font = "12px system-ui, sans-serif";
    const x = (clock) => LEFT + ((clock - start) / span) * (width - LEFT - 12);
    places = [];
    let marks = 0;
    run.recordings.forEach((recording, k) => {
      const top = TOP + k * (row * taxels + GAP), found = eventsOf(recording);
      places.push({ recording: found, label: recording.label, top, row });
      pen.fillStyle = colour("panel");
      pen.fillRect(LEFT, top, width - LEFT - 12, row * taxels);
      const begin = firstAt(found.t, start), end = firstAt(found.t, start + span);
      const tick = Math.max(1, Math.min(3, (width / Math.max(1, end - begin)) * 12));
      const colours = [colour("off"), colour("on")];
      for (let k = begin; k < end; k++) {
        pen.fillStyle = colours[found.on ? found.on[k] : 1];
        pen.fillRect(x(found.t[k]) - tick / 2, top + row * found.taxel[k], tick, row);
      }
      marks += end - begin;
      pen.strokeStyle = colour("alone");
      for (const k of recording.unmatched || []) {
        if (k < begin || k >= end) continue;
        pen.beginPath();
        pen.arc(x(found.t[k]), top + row * (found.taxel[k] + 0.5), 6, 0, 7);
        pen.stroke();
      }
      pen.fillStyle = colour("text");
      pen.fillText(`${recording.label}: ${(end - begin).toLocaleString("en")} events in the window`, LEFT, top - 7);
      pen.fillStyle = colour("soft");
      pen.textAlign = "right";
      pen.fillText("taxel 0", LEFT - 6, top + 10);
      pen.fillText(String(taxels - 1), LEFT - 6, top + row * taxels);
      pen.textAlign = "left";
    });
    const bottom = height - BOTTOM, step = niceStep(ms(span) / 7);
    pen.fillStyle = colour("soft");
    pen.textAlign = "center";
    for (let t = Math.ceil(ms(start) / step - 1e-9) * step; t <= ms(start + span) * 1.000001; t += step) {
      const at = x((t / 1e3) * run.clock_hz);
      pen.fillRect(at, bottom, 1, 5);
      pen.fillText(String(Number(t.toPrecision(6))), Math.min(at, width - 16), bottom + 18);
    }
    pen.fillText("time (ms)", LEFT + (width - LEFT) / 2, bottom + 34);
    pen.textAlign = "left";
    if (run.recordings[0].on) {
      ["on", "off"].forEach((name, k) => {
        pen.fillStyle = colour(name);
        pen.fillRect(width - 110 + 52 * k, height - 14, 10, 10);
        pen.fillStyle = colour("text");
        pen.fillText(name.toUpperCase(), width - 96 + 52 * k, height - 5);
      });
    }
    const free = run.shown_clocks - span;
    from.value = free > 0 ? Math.round((start / free) * SLIDER) : 0;
    wide.value = Math.round((Math.log(span / LEAST_CLOCKS) / Math.log(run.shown_clocks / LEAST_CLOCKS)) * SLIDER);
    byId("raster-from-value").textContent = si(ms(start) / 1e3, "s");
    byId("raster-window-value").textContent = si(ms(span) / 1e3, "s");
    from.setAttribute("aria-valuetext", byId("raster-from-value").textContent);
    wide.setAttribute("aria-valuetext", byId("raster-window-value").textContent);
    Object.assign(canvas.dataset, { marks, start: Math.round(start), span: Math.round(span) });
    canvas.setAttribute("aria-label", `Raster of address events, ${si(ms(start) / 1e3, "s")} to ${si(ms(start + span) / 1e3, "s")}: ` +
      `${marks} marks. ${run.verdict}`);
  }

  function niceStep(least) {
    const power = 10 ** Math.floor(Math.log10(least));
    return power * [1, 2, 5, 10].find((factor) => factor * power >= least);
  }

  function hover(event) {
    const box = canvas.getBoundingClientRect(), inner = box.width - LEFT - 12;
    const x = event.clientX - box.left, y = event.clientY - box.top, taxels = run.rows * run.columns;
    const panel = places.find((found) => y >= found.top - 4 && y <= found.top + found.row * taxels + 4);
    if (!panel) { hideTip(); return; }
    const clock = start + ((x - LEFT) / inner) * span, near = (6 / inner) * span, { recording } = panel;
    let best = -1, least = 64;
    for (let k = firstAt(recording.t, clock - near); k < recording.t.length && recording.t[k] <= clock + near; k++) {
      const dx = ((recording.t[k] - clock) / span) * inner, dy = panel.top + panel.row * (recording.taxel[k] + 0.5) - y;
      if (dx * dx + dy * dy < least) [best, least] = [k, dx * dx + dy * dy];
    }
    if (best < 0) { hideTip(); return; }
    const taxel = recording.taxel[best], sign = recording.on ? (recording.on[best] ? ", ON" : ", OFF") : "";
    showTip(`${panel.label}, event ${best}\nclock ${recording.t[best]} (${Number(ms(recording.t[best]).toPrecision(7))} ms)\n` +
      `row ${Math.floor(taxel / run.columns)}, column ${taxel % run.columns}${sign}`, event.clientX, event.clientY);
  }

  let held = null;
  canvas.addEventListener("pointerdown", (event) => {
    held = { x: event.clientX, start };
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!held) { hover(event); return; }
    hideTip();
    setWindow(held.start - ((event.clientX - held.x) / (canvas.clientWidth - LEFT - 12)) * span, span);
  });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { held = null; });
  canvas.addEventListener("pointerleave", hideTip);
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas) return; // the page scrolls until the picture is clicked
    event.preventDefault();
    const box = canvas.getBoundingClientRect();
    zoom(1.2 ** Math.sign(event.deltaY), Math.min(1, Math.max(0, (event.clientX - box.left - LEFT) / (box.width - LEFT - 12))));
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const act = {
      ArrowLeft: () => setWindow(start - span / 5, span), ArrowRight: () => setWindow(start + span / 5, span),
      "+": () => zoom(1 / 1.5, 0.5), "=": () => zoom(1 / 1.5, 0.5), "-": () => zoom(1.5, 0.5),
      0: () => setWindow(0, run.shown_clocks),
    }[event.key];
    if (!act || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    act();
  });
  from.addEventListener("input", () => setWindow((from.value / SLIDER) * (run.shown_clocks - span), span));
  wide.addEventListener("input", () => {
    const next = LEAST_CLOCKS * (run.shown_clocks / LEAST_CLOCKS) ** (wide.value / SLIDER);
    setWindow(start + (span - next) / 2, next);
  });
  byId("raster-reset").addEventListener("click", () => setWindow(0, run.shown_clocks));
  choice.addEventListener("change", pick);
  addEventListener("resize", draw);
  addEventListener("beforeprint", draw);
  addEventListener("afterprint", draw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);

  function pick() {
    run = DATA.raster[Number(choice.value)];
    const cut = run.shown_clocks < run.duration_clocks ? ` Shown are the first ${si(ms(run.shown_clocks) / 1e3, "s")}.` : "";
    byId("raster-verdict").textContent = `${run.verdict}.${cut}`;
    setWindow(0, run.shown_clocks);
  }
  const longest = Math.max(...DATA.raster.map((found) => found.duration_clocks / found.clock_hz));
  choice.value = DATA.raster.findIndex((found) => found.duration_clocks / found.clock_hz === longest);
  pick();
})();
