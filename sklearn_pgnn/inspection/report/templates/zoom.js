"use strict";
// Curves under the pointer told, a part of a plot made large; without this all is readable, too.
(() => {
const SIDE = 1000, SVG = "http://www.w3.org/2000/svg";
const tip = document.createElement("div");
tip.className = "tip";
tip.hidden = true;

const short = (value) => String(+value.toPrecision(4)).replaceAll("-", "−");
const make = (name, attributes) => {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
};

function steps(low, high, most) {
  const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough * (1 - 1e-9));
  const found = [];
  for (let k = Math.ceil(low / step); k <= Math.floor(high / step); k += 1) found.push(+(k * step).toPrecision(12));
  return found;
}

class Plot {
  constructor(area) {
    this.area = area;
    this.inner = area.querySelector("svg.inner");
    this.whole = { x: area.dataset.x.split(" ").map(Number), y: area.dataset.y.split(" ").map(Number) };
    this.view = { x: this.whole.x, y: this.whole.y };
    this.curves = null;
    this.cursor = make("line", { class: "cursor", y1: "0", y2: "100%", visibility: "hidden" });
    this.chosen = make("rect", { class: "chosen", visibility: "hidden" });
    area.append(this.cursor, this.chosen);
    area.tabIndex = 0;
    area.addEventListener("pointermove", (event) => this.hover(event));
    area.addEventListener("pointerleave", () => this.leave());
    area.addEventListener("pointerdown", (event) => this.begin(event));
    area.addEventListener("pointerup", (event) => this.end(event));
    area.addEventListener("dblclick", () => this.together({ x: this.whole.x }, this.whole.y));
    area.addEventListener("keydown", (event) => this.press(event));
  }

  // -- what is under the pointer ----------------------------------------------------------------

  place(event) {
    const box = this.area.getBoundingClientRect();
    const clamp = (share) => Math.min(Math.max(share, 0), 1);
    return { x: clamp((event.clientX - box.left) / box.width), y: clamp((event.clientY - box.top) / box.height), box };
  }

  at(share, axis) {
    const [low, high] = this.view[axis];
    return low + (axis === "y" ? 1 - share : share) * (high - low);
  }

  lines() {
    if (this.curves) return this.curves;
    const [x0, x1] = this.whole.x, [y0, y1] = this.whole.y;
    this.curves = [...this.inner.querySelectorAll("path.line")].map((path) => ({
      name: path.querySelector("title")?.textContent || "",
      points: [...path.getAttribute("d").matchAll(/([ML])(-?[\d.]+) (-?[\d.]+)/g)].map(([, pen, a, b]) => [
        x0 + (a / SIDE) * (x1 - x0), y1 - (b / SIDE) * (y1 - y0), pen]),
    })).filter(({ name, points }) => name && points.length > 1 && points.every((p, k) => !k || p[0] >= points[k - 1][0]));
    return this.curves;
  }

  told(x) {
    return this.lines().flatMap(({ name, points }) => {
      let low = 0, high = points.length - 1;
      if (x < points[0][0] || x > points[high][0]) return [];
      while (high - low > 1) { const mid = (low + high) >> 1; if (points[mid][0] <= x) low = mid; else high = mid; }
      const [a, b] = [points[low], points[high]];
      if (b[2] === "M") return [];
      const value = b[0] > a[0] ? a[1] + ((x - a[0]) / (b[0] - a[0])) * (b[1] - a[1]) : a[1];
      return [[name, value]];
    });
  }

  hover(event) {
    const { x, y, box } = this.place(event);
    if (this.from) this.mark(x, y);
    const at = `${100 * x}%`;
    for (const [key, value] of [["x1", at], ["x2", at], ["visibility", "visible"]]) this.cursor.setAttribute(key, value);
    const here = this.at(x, "x"), values = this.told(here);
    const rows = values.length ? values : [["", this.at(y, "y")]];
    const over = this.area.closest("figure")?.querySelector(".axis.below")?.textContent || "at";
    tip.replaceChildren(...[[over, here], ...rows].map(([name, value]) => {
      const row = document.createElement("p");
      row.textContent = name ? `${name}: ${short(value)}` : short(value);
      return row;
    }));
    tip.hidden = false;
    const left = event.clientX + 14 + tip.offsetWidth < window.innerWidth ? event.clientX + 14 : event.clientX - 14 - tip.offsetWidth;
    tip.style.left = `${Math.max(left, 0) + window.scrollX}px`;
    tip.style.top = `${box.top + window.scrollY + 6}px`;
  }

  leave() {
    tip.hidden = true;
    this.cursor.setAttribute("visibility", "hidden");
    if (!this.from) this.chosen.setAttribute("visibility", "hidden");
  }

  // -- a part made large ------------------------------------------------------------------------

  begin(event) {
    if (event.button) return;
    event.preventDefault();
    this.area.focus({ preventScroll: true });
    this.from = this.place(event);
    this.area.setPointerCapture(event.pointerId);
  }

  mark(x, y) {
    const high = this.isHigh(y);
    const box = { x: `${100 * Math.min(x, this.from.x)}%`, width: `${100 * Math.abs(x - this.from.x)}%`,
      y: high ? `${100 * Math.min(y, this.from.y)}%` : "0", height: high ? `${100 * Math.abs(y - this.from.y)}%` : "100%" };
    for (const [key, value] of Object.entries(box)) this.chosen.setAttribute(key, value);
    this.chosen.setAttribute("visibility", "visible");
  }

  isHigh(y) {
    return Math.abs(y - this.from.y) * this.area.clientHeight > 24;
  }

  end(event) {
    if (!this.from) return;
    const { x, y } = this.place(event), from = this.from, high = this.isHigh(y);
    this.from = null;
    this.chosen.setAttribute("visibility", "hidden");
    if (Math.abs(x - from.x) * this.area.clientWidth < 8) return;
    const sides = [this.at(from.x, "x"), this.at(x, "x")].sort((a, b) => a - b);
    const ends = [this.at(from.y, "y"), this.at(y, "y")].sort((a, b) => a - b);
    this.together({ x: sides }, high ? ends : this.view.y);
  }

  press(event) {
    const [low, high] = this.view.x, wide = high - low, middle = (low + high) / 2;
    const to = { "+": [middle - wide / 4, middle + wide / 4], "-": [middle - wide, middle + wide],
      ArrowLeft: [low - wide / 4, high - wide / 4], ArrowRight: [low + wide / 4, high + wide / 4],
      0: this.whole.x, Escape: this.whole.x }[event.key];
    if (!to || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    const [first, last] = this.whole.x, size = Math.min(to[1] - to[0], last - first);
    const start = Math.min(Math.max(to[0], first), last - size);
    this.together({ x: [start, start + size] }, event.key === "0" || event.key === "Escape" ? this.whole.y : this.view.y);
  }

  // all plots of a figure over the same abscissa go together
  together({ x }, y) {
    const figure = this.area.closest("figure");
    const beside = plots.filter((p) => p.area.closest("figure") === figure && p.area.dataset.x === this.area.dataset.x);
    for (const plot of figure ? beside : [this]) plot.show(x, plot === this || y === plot.whole.y ? y : plot.view.y);
    if (x === this.whole.x) for (const plot of beside) plot.show(x, plot.whole.y);
  }

  show(x, y) {
    if (!(x[1] > x[0] && y[1] > y[0])) return;
    this.view = { x, y };
    const [x0, x1] = this.whole.x, [y0, y1] = this.whole.y;
    const box = [SIDE * (x[0] - x0) / (x1 - x0), SIDE * (y1 - y[1]) / (y1 - y0),
      SIDE * (x[1] - x[0]) / (x1 - x0), SIDE * (y[1] - y[0]) / (y1 - y0)];
    this.inner.setAttribute("viewBox", box.map((side) => +side.toFixed(3)).join(" "));
    this.area.querySelectorAll(":scope > .grid, :scope > text").forEach((old) => old.remove());
    for (const value of steps(x[0], x[1], 6)) {
      const at = `${100 * (value - x[0]) / (x[1] - x[0])}%`;
      this.tick({ x1: at, x2: at, y1: 0, y2: "100%" }, { class: "below", x: at, y: "100%", dy: 15 }, value);
    }
    for (const value of steps(y[0], y[1], this.area.closest(".low") ? 4 : 6)) {
      const at = `${100 * (1 - (value - y[0]) / (y[1] - y[0]))}%`;
      this.tick({ x1: 0, x2: "100%", y1: at, y2: at }, { class: "beside", x: 0, y: at, dx: -6, dy: 4 }, value);
    }
  }

  tick(line, text, value) {
    const said = make("text", text);
    said.textContent = String(value).replaceAll("-", "−");
    this.area.insertBefore(make("line", { class: "grid", ...line }), this.inner);
    this.area.insertBefore(said, this.inner);
  }
}

let plots = [];
function find() {
  plots = plots.filter((plot) => plot.area.isConnected);
  const known = new Set(plots.map((plot) => plot.area));
  for (const area of document.querySelectorAll("svg.area[data-x]")) {
    if (known.has(area)) continue;
    plots.push(new Plot(area));
    area.classList.add("live");
  }
}
document.body.append(tip);
find();
new MutationObserver(find).observe(document.body, { childList: true, subtree: true });
})();
