"use strict";
// What all charts are drawn with: words, axes, marks, their hover text. A chart is drawn in the pixels that it has, so
// that its letters keep their size on a phone, and drawn again when these change.
const DATA = JSON.parse(document.getElementById("data").textContent);
const NAMES = { nlcs: "N-LCS", lcs: "LCS", frame: "frame" };
const SHAPES = {
  circle: "M-5 0a5 5 0 1 0 10 0a5 5 0 1 0 -10 0z", square: "M-4.5 -4.5h9v9h-9z",
  triangle: "M0 -6l5.6 10h-11.2z", diamond: "M0 -6.4l5 6.4l-5 6.4l-5 -6.4z",
  dash: "M-7 -1h14v2h-14z",
};
const SHAPE_OF = { nlcs: "triangle", lcs: "circle", frame: "square", "cw-lcs": "diamond" };
const byId = (id) => document.getElementById(id);

// -- words -------------------------------------------------------------------------------------------

function si(value, unit, digits = 3) {
  if (!value) return `0 ${unit}`;
  const prefixes = ["p", "n", "\u00b5", "m", "", "k", "M", "G"];
  const step = Math.max(-4, Math.min(3, Math.floor(Math.log10(Math.abs(value) * 1.0005) / 3)));
  return `${Number((value / 1000 ** step).toPrecision(digits))} ${prefixes[step + 4]}${unit}`;
}
const fine = (value, unit) => si(value, unit, 4);
const plain = (value, digits = 3) => (value >= 1000 ? Math.round(value).toLocaleString("en") : String(Number(Number(value).toPrecision(digits))));
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

let drawings = []; // {svg, paint, width}: paint(svg, width) draws in so many pixels and returns the height

// A figure with a heading and a drawing; the arrow keys go through its marks. drawAll() fills it.
function figure(parent, title, soft, basis, paint) {
  const box = node(parent, "figure", basis ? { style: `--width: ${basis}` } : {});
  const caption = node(box, "figcaption", {}, title);
  if (soft) node(caption, "span", {}, soft);
  const svg = node(box, "svg", { tabindex: 0, role: "group" });
  svg.setAttribute("aria-label", `${title}. ${soft || ""} Arrow keys read the values.`);
  drawings.push({ svg, paint, width: 0 });
  return svg;
}

function drawAll() {
  drawings = drawings.filter((drawing) => drawing.svg.isConnected);
  for (const drawing of drawings) {
    const width = Math.max(240, drawing.svg.parentNode.clientWidth);
    if (width === drawing.width) continue;
    drawing.width = width;
    drawing.svg.replaceChildren();
    drawing.svg.setAttribute("viewBox", `0 0 ${width} 100`); // letters are measured while they are placed
    drawing.svg.setAttribute("viewBox", `0 0 ${width} ${drawing.paint(drawing.svg, width)}`);
  }
}
addEventListener("resize", () => { hideTip(); drawAll(); });

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

// A mark that the pointer and the arrow keys read; the number that it stands for is kept whole beside the rounded words.
function mark(svg, tag, attributes, tip, value) {
  const made = node(svg, tag, { class: "mark", "data-tip": tip, role: "img", "aria-label": tip, ...attributes });
  if (value !== undefined) made.dataset.value = value;
  return made;
}

function point(svg, shape, x, y, colour, tip, value) {
  const look = { d: SHAPES[shape], transform: `translate(${x} ${y})`, fill: `var(--${colour})` };
  return mark(svg, "path", look, tip, value);
}

// Entries [name, colour, shape, further attributes of the mark].
function legend(parent, entries) {
  const box = node(parent, "div", { class: "legend" });
  for (const [name, colour, shape, look] of entries) {
    const item = node(box, "span");
    if (shape) {
      const svg = node(item, "svg", { viewBox: "-7 -7 14 14", "aria-hidden": true });
      node(svg, "path", { d: SHAPES[shape], fill: `var(--${colour})`, ...look });
    } else node(item, "i", { style: `background: var(--${colour})` });
    item.append(name);
  }
}

// Where labels go: boxes [left, top, right, bottom]. A label takes the first place on nothing and in the frame, or none.
const meet = (a, b) => a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];
const within = (a, b) => a[0] >= b[0] && a[1] >= b[1] && a[2] <= b[2] && a[3] <= b[3];

// The smallest step to the side after which boxes meet none that is taken.
function sideways(boxes, taken) {
  const moved = (step) => boxes.map(([left, top, right, bottom]) => [left + step, top, right + step, bottom]);
  for (let k = 0; k <= 80; k++) {
    const step = (k % 2 ? -1 : 1) * Math.ceil(k / 2);
    if (!moved(step).some((box) => taken.some((other) => meet(box, other)))) return step;
  }
  return 0;
}

function label(svg, words, [left, top, right, bottom], taken, frame, attributes = {}) {
  const text = node(svg, "text", { class: "soft label", ...attributes }, words);
  const [wide, high] = [text.getComputedTextLength() + 2, 13];
  const [x, y] = [(left + right) / 2, (top + bottom) / 2];
  for (const gap of [3, 7, 12, 18]) {
    const centres = [[x, top - gap - high / 2], [right + gap + wide / 2, y], [left - gap - wide / 2, y], [x, bottom + gap + high / 2]];
    for (const [cx, cy] of centres) {
      for (const slide of [0, -0.35, 0.35]) {
        const [at, up] = cx === x ? [cx + slide * wide, cy] : [cx, cy + slide * high];
        const box = [at - wide / 2, up - high / 2, at + wide / 2, up + high / 2];
        if (!within(box, frame) || taken.some((other) => meet(box, other))) continue;
        taken.push(box);
        for (const [name, value] of Object.entries({ x: at, y: up + 4, "text-anchor": "middle" })) text.setAttribute(name, value);
        return;
      }
    }
  }
  text.remove(); // no room: the mark's hover text and the table have it
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
