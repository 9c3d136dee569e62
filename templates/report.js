"use strict";
// The report is whole without this: it adds the replay, marks in the contents what is being read,
// opens what a link points at, and nothing else. It reads the page's own data and loads nothing from elsewhere.
(() => {
  const SVG = "http://www.w3.org/2000/svg";
  const DIGITS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
  const NOTHING = 64 * 64 - 1;
  const calm = matchMedia("(prefers-reduced-motion: reduce)");

  const make = (parent, tag, attributes = {}, text = "") => {
    const svg = tag === "svg" || parent.namespaceURI === SVG;
    const made = svg ? document.createElementNS(SVG, tag) : document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    if (text) made.textContent = text;
    parent.append(made);
    return made;
  };
  const summed = (differences) => {
    let sum = 0;
    return differences.map((difference) => (sum += difference) / 1000);
  };
  const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

  // One run: what it holds, and what of it is to be seen at a time since its launch.
  class Run {
    constructor(data) {
      this.data = data;
      for (const name of ["x", "y", "yaw", "v", "w", "cv", "cw"]) this[name] = summed(data[name]);
      this.goals = data.goals.map(([x, y, yaw, radius, within]) => (
        { x: x / 1000, y: y / 1000, yaw: yaw / 1000, radius: radius / 1000, within }));
      this.begin = data.began;
      this.end = data.began + (this.x.length - 1) * data.step;
    }
    at(time) {
      const position = clamp((time - this.begin) / this.data.step, 0, this.x.length - 1);
      const index = Math.min(Math.floor(position), this.x.length - 2);
      const share = position - index;
      const between = (values) => values[index] + share * (values[index + 1] - values[index]);
      return {
        index: Math.round(position),
        x: between(this.x), y: between(this.y), yaw: between(this.yaw),
        v: between(this.v), w: between(this.w), cv: this.cv[Math.round(position)], cw: this.cw[Math.round(position)],
      };
    }
    scan(time) {
      const scans = this.data.scans;
      if (!scans || scans.times[0] > time) return [];
      let index = scans.times.findIndex((stamp) => stamp > time) - 1;
      if (index < 0) index = scans.times.length - 1;
      const ranges = [];
      for (let beam = 0; beam < scans.beams; beam++) {
        const at = 2 * (index * scans.beams + beam);
        const range = 64 * DIGITS.indexOf(scans.ranges[at]) + DIGITS.indexOf(scans.ranges[at + 1]);
        if (range !== NOTHING) ranges.push([(scans.from + beam * scans.by) / 1000, range / 100]);
      }
      return ranges;
    }
    touches(time) {
      return this.data.touches.some(([from, to]) => time >= from && time <= to + 0.05);
    }
    box() {
      const reach = this.data.radius / 1000 + 0.2;
      let [left, right] = [Math.min(...this.x) - reach, Math.max(...this.x) + reach];
      let [bottom, top] = [Math.min(...this.y) - reach, Math.max(...this.y) + reach];
      for (const { x, y, radius } of this.goals) {
        [left, right] = [Math.min(left, x - radius - 0.1), Math.max(right, x + radius + 0.1)];
        [bottom, top] = [Math.min(bottom, y - radius - 0.1), Math.max(top, y + radius + 0.25)];
      }
      const thin = (this.data.lines || []).flatMap((points) => points.slice(1).map((point, i) => [...points[i], ...point]));
      const far = { left: left - 0.35, right: right + 0.35, bottom: bottom - 0.35, top: top + 0.35 };
      for (const [x1, y1, x2, y2] of [...this.data.walls, ...thin].map((wall) => wall.map((value) => value / 1000))) {
        if (Math.max(x1, x2) < far.left || Math.min(x1, x2) > far.right) continue;
        if (Math.max(y1, y2) < far.bottom || Math.min(y1, y2) > far.top) continue;
        for (const [x, y] of [[x1, y1], [x2, y2]]) {
          const [nearX, nearY] = [clamp(x, far.left, far.right), clamp(y, far.bottom, far.top)];
          [left, right] = [Math.min(left, nearX - 0.05), Math.max(right, nearX + 0.05)];
          [bottom, top] = [Math.min(bottom, nearY - 0.05), Math.max(top, nearY + 0.05)];
        }
      }
      for (const { radius, size, places, robot } of this.data.moving) {
        const half = (radius ?? Math.hypot(...size) / 2) / 1000 + 0.05;
        for (const [x, y] of places.filter(Boolean).map((place) => [place[0] / 1000, place[1] / 1000])) {
          // Another robot is what the run is about; an obstacle may be far away.
          if (!robot && (x < far.left || x > far.right || y < far.bottom || y > far.top)) continue;
          [left, right] = [Math.min(left, x - half), Math.max(right, x + half)];
          [bottom, top] = [Math.min(bottom, y - half), Math.max(top, y + half)];
        }
      }
      return { left, right, bottom, top };
    }
  }

  // Each robot's name, and the class of its marks in the one map.
  const ROLES = {
    student: { name: "This submission", class: "of-student" },
    reference: { name: "Reference", class: "of-reference" },
    before: { name: "Last attempt", class: "of-before" },
  };

  // A robot in the map: its way, what it has gone of it, itself.
  class Robot {
    constructor(world, run, role) {
      this.run = run;
      this.group = make(world, "g", { class: role.class });
      make(this.group, "path", { d: this.way(run.x.length), class: "way to-come" });
      this.gone = make(this.group, "path", { class: "way" });
      this.body = make(this.group, "g");
      const radius = run.data.radius / 1000;
      make(this.body, "circle", { r: radius, class: "robot" });
      make(this.body, "line", { x1: 0, y1: 0, x2: radius, y2: 0, class: "robot nose" });
    }
    way(count) {
      let path = "";
      for (let i = 0; i < count; i++) path += `${i ? "L" : "M"}${this.run.x[i].toFixed(3)} ${this.run.y[i].toFixed(3)}`;
      return path;
    }
    show(time) {
      const now = this.run.at(time);
      this.body.setAttribute("transform", `translate(${now.x} ${now.y}) rotate(${now.yaw * 180 / Math.PI})`);
      this.gone.setAttribute("d", this.way(now.index + 1));
      return now;
    }
  }

  // The map with all robots.
  class Plan {
    constructor(parent, runs, box) {
      const figure = make(parent, "figure", { class: "side" });
      const [width, height] = [box.right - box.left, box.top - box.bottom];
      const svg = make(figure, "svg", {
        viewBox: `${box.left} ${-box.top} ${width} ${height}`, class: "plan", role: "img",
      });
      this.svg = svg;
      this.run = runs.student;
      const world = make(svg, "g", { transform: "scale(1 -1)" });
      for (const [key, run] of Object.entries(runs)) this.walls(world, run, ROLES[key].class);
      this.movers = this.run.data.moving.map((thing) => thing.radius === null
        ? make(world, "rect", {
            x: -thing.size[0] / 2000, y: -thing.size[1] / 2000,
            width: thing.size[0] / 1000, height: thing.size[1] / 1000, class: "mover",
          })
        : make(world, "circle", { r: thing.radius / 1000, class: "mover" }));
      for (const [key, run] of Object.entries(runs)) {
        if (!this.differs(run, "goals")) continue;
        for (const goal of run.goals) this.goal(world, goal, Math.max(width, height), ROLES[key].class);
      }
      this.beams = make(world, "path", { class: "beams" });
      // The student's own robot lies above the others.
      this.robots = Object.fromEntries(
        Object.keys(runs).reverse().map((key) => [key, new Robot(world, runs[key], ROLES[key])]));
      const radius = this.run.data.radius / 1000;
      this.cross = make(world, "path", {
        d: `M${-radius} ${-radius}L${radius} ${radius}M${-radius} ${radius}L${radius} ${-radius}`, class: "out",
      });
    }
    // Whether another run has other things in its world than the student's own, as random values make.
    differs(run, what) {
      return run === this.run || JSON.stringify(run.data[what]) !== JSON.stringify(this.run.data[what]);
    }
    walls(world, run, role) {
      if (!this.differs(run, "walls")) return;
      for (const points of run.data.lines || []) {
        make(world, "path", { d: `M${points.map(([x, y]) => `${x / 1000} ${y / 1000}`).join("L")}`, class: `floor-line ${role}` });
      }
      for (const wall of run.data.walls) {
        const [x1, y1, x2, y2, radius] = wall.map((value) => value / 1000);
        make(world, "line", radius
          ? { x1, y1, x2: x2 + 1e-4, y2, class: `thing ${role}`, "stroke-width": 2 * radius }
          : { x1, y1, x2, y2, class: `wall ${role}` });
      }
    }
    goal(world, { x, y, yaw, radius }, size, role) {
      make(world, "circle", { cx: x, cy: y, r: radius, class: `target ${role}` });
      const [dx, dy] = [1.5 * radius * Math.cos(yaw), 1.5 * radius * Math.sin(yaw)];
      make(world, "line", { x1: x, y1: y, x2: x + dx, y2: y + dy, class: `target-heading ${role}` });
      if (role !== ROLES.student.class) return;
      const text = make(this.svg, "text", { x, y: -(y + 1.2 * radius), "text-anchor": "middle", class: "lane" }, "goal");
      // In metres, as all of the picture is.
      text.style.fontSize = `${0.04 * size}px`;
      text.style.strokeWidth = `${0.012 * size}px`;
      text.style.vectorEffect = "none";
    }
    show(time, times) {
      const { run } = this;
      for (const [key, robot] of Object.entries(this.robots)) robot.show(times[key]);
      const now = run.at(time);
      this.cross.setAttribute("transform", `translate(${now.x} ${now.y})`);
      this.cross.setAttribute("visibility", run.touches(time) ? "visible" : "hidden");
      const [lx, ly, turned] = run.data.lidar.map((value) => value / 1000);
      const [cos, sin] = [Math.cos(now.yaw), Math.sin(now.yaw)];
      const [ex, ey] = [now.x + cos * lx - sin * ly, now.y + sin * lx + cos * ly];
      this.beams.setAttribute("d", run.scan(time).map(([angle, range]) => {
        const direction = now.yaw + turned + angle;
        return `M${ex.toFixed(3)} ${ey.toFixed(3)}L${(ex + range * Math.cos(direction)).toFixed(3)} ${(ey + range * Math.sin(direction)).toFixed(3)}`;
      }).join(""));
      run.data.moving.forEach((thing, i) => {
        const place = thing.places[clamp(Math.round((time - run.begin) * 10), 0, thing.places.length - 1)];
        this.movers[i].setAttribute("visibility", place ? "visible" : "hidden");
        if (place) this.movers[i].setAttribute("transform", `translate(${place[0] / 1000} ${place[1] / 1000}) rotate(${place[2] * 0.18 / Math.PI})`);
      });
      this.svg.setAttribute("aria-label", `Robot at x ${now.x.toFixed(2)} m, y ${now.y.toFixed(2)} m, heading ${Math.round(now.yaw * 180 / Math.PI)}°`);
    }
  }

  // What the camera of the student's robot saw: pictures that lie below each other in one.
  class Film {
    constructor(parent, film, begin) {
      [this.film, this.begin, this.time] = [film, begin, begin];
      const figure = make(parent, "figure");
      this.canvas = make(figure, "canvas", { class: "film", role: "img", width: film.width, height: film.height });
      make(figure, "figcaption", { class: "soft hint" }, "What its camera sees, without its noise.");
      const bytes = Uint8Array.from(atob(film.png), (letter) => letter.charCodeAt(0));
      createImageBitmap(new Blob([bytes], { type: "image/png" })).then((strip) => { this.strip = strip; this.show(this.time); });
    }
    show(time) {
      this.time = time;
      const { count, every, width, height } = this.film;
      const number = clamp(Math.floor((time - this.begin) / every + 1e-6), 0, count - 1);
      this.canvas.setAttribute("aria-label", `Picture ${number + 1} of ${count} of the camera`);
      if (this.strip) this.canvas.getContext("2d").drawImage(this.strip, 0, number * height, width, height, 0, 0, width, height);
    }
  }

  // A speed over time: with its axes, the limit of the robot, and the same of the other runs.
  const [LEFT, TOP, HIGH, BELOW] = [44, 24, 64, 20];
  class Chart {
    constructor(parent, title, names, limit, runs, shifts, begin, end) {
      const width = clamp(parent.clientWidth, 280, 720), bottom = TOP + HIGH;
      const svg = make(parent, "svg", { viewBox: `0 0 ${width} ${bottom + BELOW}`, class: "chart", "aria-hidden": "true" });
      const all = Object.values(runs).flatMap((run) => names.flatMap((name) => run[name])).filter((value) => Math.abs(value) < 1e3);
      const [low, high] = [Math.min(0, ...all), Math.max(0, ...all)];
      const limits = [limit, -limit].filter((value) => value > 0 ? high > 0.3 * limit : low < -0.3 * limit);
      const most = Math.max(high, ...limits, 0.02), least = Math.min(low, ...limits);
      this.x = (time) => LEFT + (width - LEFT - 8) * clamp((time - begin) / (end - begin), 0, 1);
      const y = (value) => TOP + HIGH * (most - clamp(value, least, most)) / (most - least);
      make(svg, "text", { x: 0, y: 10 }, title);
      for (const value of new Set([0, ...limits.length ? limits : [most]])) {
        make(svg, "line", { x1: LEFT, x2: width - 8, y1: y(value), y2: y(value), class: limits.includes(value) ? "limit" : "grid" });
        make(svg, "text", { x: LEFT - 5, y: y(value) + 4, "text-anchor": "end" }, `${Number(value.toPrecision(2))}`);
      }
      const every = [0.5, 1, 2, 5, 10, 20, 60].find((step) => (end - begin) / step <= width / 60) || 120;
      make(svg, "line", { x1: LEFT, x2: width - 8, y1: bottom, y2: bottom, class: "axis" });
      for (let time = Math.ceil(begin / every) * every; time <= end; time += every) {
        make(svg, "line", { x1: this.x(time), x2: this.x(time), y1: bottom, y2: bottom + 4, class: "axis" });
        make(svg, "text", { x: this.x(time), y: bottom + 15, "text-anchor": "middle" }, `${time} s`);
      }
      this.curves = Object.entries(runs).reverse().flatMap(([key, run]) => names.filter((_, i) => i || key === "student").map((name) => {
        const points = run[name].map((value, i) => `${this.x(run.begin + i * run.data.step - shifts[key]).toFixed(1)} ${y(value).toFixed(1)}`);
        return [key, make(svg, "path", { d: `M${points.join("L")}`, class: `${name === names[0] ? "command" : "true"} ${ROLES[key].class}` })];
      }));
      this.cursor = make(svg, "line", { y1: TOP, y2: bottom, class: "cursor" });
    }
    show(time) {
      for (const name of ["x1", "x2"]) this.cursor.setAttribute(name, this.x(time));
    }
  }

  class Player {
    constructor(root) {
      this.root = root;
      root.hidden = false;
      const data = JSON.parse(document.getElementById(`data-${root.dataset.scenario}`).textContent);
      this.runs = Object.fromEntries(Object.keys(ROLES).filter((key) => data[key]).map((key) => [key, new Run(data[key])]));
      const { student } = this.runs;
      // All clocks start with the simulation: the later launch of one is not a later drive.
      this.shifts = Object.fromEntries(Object.entries(this.runs).map(([key, run]) => [key, run.begin - student.begin]));
      const boxes = Object.values(this.runs).map((run) => run.box());
      const box = {
        left: Math.min(...boxes.map((b) => b.left)), right: Math.max(...boxes.map((b) => b.right)),
        bottom: Math.min(...boxes.map((b) => b.bottom)), top: Math.max(...boxes.map((b) => b.top)),
      };
      this.begin = student.begin;
      this.end = Math.max(...Object.entries(this.runs).map(([key, run]) => run.end - this.shifts[key]));
      const sides = make(root, "div", { class: "sides" });
      const left = make(sides, "div", { class: "side" });
      this.plan = new Plan(left, this.runs, box);
      this.legend(left);
      this.film = data.film && new Film(left, data.film, this.begin);
      const charts = make(sides, "div", { class: "side" });
      const [linear, angular] = student.data.limits.map((value) => value / 1000);
      const chart = (...args) => new Chart(charts, ...args, this.runs, this.shifts, this.begin, this.end);
      this.charts = [
        chart("forward speed (m/s)", ["cv", "v"], linear), chart("rate of turn (rad/s)", ["cw", "w"], angular)];
      make(charts, "p", { class: "soft hint" }, "Solid: true speed. Dashed: commanded. Dotted: limit of the robot.");
      this.readout = make(charts, "p", { class: "readout" });
      this.log = make(charts, "ol", { class: "log said-so-far" });
      this.slider = root.querySelector("input[type=range]");
      this.output = root.querySelector("output");
      this.button = root.querySelector(".play");
      this.speed = root.querySelector(".speed");
      this.slider.min = this.begin.toFixed(1);
      this.slider.max = this.end.toFixed(1);
      this.slider.addEventListener("input", () => { this.stop(); this.show(Number(this.slider.value)); });
      this.button.addEventListener("click", () => this.toggle());
      for (const button of root.querySelectorAll(".step")) {
        button.addEventListener("click", () => this.step(Number(button.dataset.frames)));
      }
      root.querySelector(".save").addEventListener("click", () => this.save());
      this.show(this.begin);
    }
    async save() {
      const time = this.time;
      this.stop();
      const link = document.createElement("a");
      link.href = URL.createObjectURL(await animated(this));
      link.download = `${this.root.dataset.scenario}.png`;
      link.click();
      URL.revokeObjectURL(link.href);
      this.show(time);
    }
    // What the robots in the map are, and switches for those of other runs.
    legend(parent) {
      const list = make(parent, "ul", { class: "legend" });
      for (const [key, run] of Object.entries(this.runs)) {
        const { name, class: role } = ROLES[key];
        const item = make(make(list, "li"), key === "student" ? "span" : "label");
        if (key !== "student") {
          const box = make(item, "input", { type: "checkbox" });
          box.checked = true;
          box.addEventListener("change", () => {
            const shown = box.checked ? "visible" : "hidden";
            for (const mark of this.root.querySelectorAll(`.plan .${role}, .chart .${role}`)) mark.setAttribute("visibility", shown);
          });
        }
        const sample = make(item, "svg", { viewBox: "0 0 28 8", width: 28, height: 8, "aria-hidden": "true" });
        make(sample, "line", { x1: 0, x2: 28, y1: 4, y2: 4, class: "way" });
        sample.setAttribute("class", role);
        const values = run.data.values.join(", ");
        item.append(values ? ` ${name} (${values})` : ` ${name}`);
      }
    }
    show(time) {
      this.time = clamp(time, this.begin, this.end);
      this.slider.value = this.time.toFixed(1);
      this.slider.setAttribute("aria-valuetext", `${this.time.toFixed(1)} s after launch`);
      this.output.textContent = `${this.time.toFixed(1)} s`;
      this.plan.show(this.time, Object.fromEntries(Object.keys(this.runs).map((key) => [key, this.time + this.shifts[key]])));
      for (const chart of this.charts) chart.show(this.time);
      if (this.film) this.film.show(this.time);
      const { student } = this.runs;
      const now = student.at(this.time);
      const away = student.goals.map((goal) =>
        ` ${Math.hypot(now.x - goal.x, now.y - goal.y).toFixed(2)} m from the goal (dashed: within ${goal.within}).`).join("");
      this.readout.textContent =
        `Commanded ${now.cv.toFixed(2)} m/s, ${now.cw.toFixed(2)} rad/s; true ${now.v.toFixed(2)} m/s, ${now.w.toFixed(2)} rad/s.` +
        (student.touches(this.time) ? " It touches something." : "") + away +
        (this.time > student.end + 0.05 ? " The run has ended." : "");
      const lines = student.data.log.filter(([stamp]) => stamp <= this.time).slice(-4);
      this.log.replaceChildren();
      for (const [stamp, text] of lines) make(this.log, "li", {}, `${stamp.toFixed(2)} s  ${text}`);
      this.log.hidden = !lines.length;
    }
    step(frames) {
      this.stop();
      this.show(this.time + frames * this.runs.student.data.step);
    }
    toggle() {
      if (this.playing) this.stop(); else this.play();
    }
    play() {
      if (this.time >= this.end - 0.05) this.show(this.begin);
      this.playing = true;
      this.button.textContent = "Pause";
      let last = performance.now(), due = 0;
      const frame = (now) => {
        due += (now - last) / 1000;
        last = now;
        // Who asked for less motion gets stills, two a second.
        if (due >= (calm.matches ? 0.5 : 0)) { this.show(this.time + due * Number(this.speed.value)); due = 0; }
        if (this.time >= this.end) this.stop();
        else this.frame = requestAnimationFrame(frame);
      };
      this.frame = requestAnimationFrame(frame);
    }
    stop() {
      this.playing = false;
      cancelAnimationFrame(this.frame);
      this.button.textContent = "Play";
    }
  }

  // A picture of the map at a time, as an APNG has it: https://www.w3.org/TR/png-3/
  const WIDTH = 480, MOST_FRAMES = 150;
  const paint = (svg, canvas) => {
    const context = canvas.getContext("2d", { alpha: false });
    const scale = canvas.width / svg.clientWidth;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.fillStyle = getComputedStyle(svg).backgroundColor;
    context.fillRect(0, 0, canvas.width, canvas.height);
    for (const mark of svg.querySelectorAll("line, circle, rect, path, text")) {
      const style = getComputedStyle(mark);
      if (style.visibility === "hidden") continue;
      const number = (name) => Number(mark.getAttribute(name) || 0);
      const matrix = new DOMMatrix().scale(scale).multiply(mark.getCTM());
      context.globalAlpha = Number(style.opacity);
      if (mark.tagName === "text") {
        context.setTransform(matrix);
        context.font = `600 ${style.fontSize} sans-serif`;
        context.textAlign = "center";
        context.fillStyle = style.fill;
        context.fillText(mark.textContent, number("x"), number("y"));
        context.setTransform(1, 0, 0, 1, 0, 0);
        continue;
      }
      const shape = new Path2D(mark.tagName === "path" ? mark.getAttribute("d") || "" : "");
      if (mark.tagName === "circle") shape.arc(number("cx"), number("cy"), number("r"), 0, 7);
      if (mark.tagName === "rect") shape.rect(number("x"), number("y"), number("width"), number("height"));
      if (mark.tagName === "line") { shape.moveTo(number("x1"), number("y1")); shape.lineTo(number("x2"), number("y2")); }
      const placed = new Path2D();
      placed.addPath(shape, matrix);
      if (style.fill !== "none") {
        context.globalAlpha = Number(style.opacity) * Number(style.fillOpacity);
        context.fillStyle = style.fill;
        context.fill(placed);
        context.globalAlpha = Number(style.opacity);
      }
      if (style.stroke === "none") continue;
      const wide = style.vectorEffect === "non-scaling-stroke" ? scale : Math.hypot(matrix.a, matrix.b);
      context.strokeStyle = style.stroke;
      context.lineWidth = parseFloat(style.strokeWidth) * wide;
      [context.lineCap, context.lineJoin] = [style.strokeLinecap, style.strokeLinejoin];
      context.setLineDash(style.strokeDasharray === "none" ? [] : style.strokeDasharray.split(",").map((dash) => parseFloat(dash) * wide));
      context.stroke(placed);
    }
  };
  const CRC = Uint32Array.from({ length: 256 }, (_, n) => {
    for (let bit = 0; bit < 8; bit++) n = n & 1 ? 0xedb88320 ^ (n >>> 1) : n >>> 1;
    return n;
  });
  const chunk = (type, ...parts) => {
    const data = new Uint8Array(parts.reduce((size, part) => size + part.length, 12));
    const view = new DataView(data.buffer);
    view.setUint32(0, data.length - 12);
    data.set([...type].map((letter) => letter.charCodeAt(0)), 4);
    let at = 8;
    for (const part of parts) { data.set(part, at); at += part.length; }
    let crc = 0xffffffff;
    for (let i = 4; i < at; i++) crc = CRC[(crc ^ data[i]) & 255] ^ (crc >>> 8);
    view.setUint32(at, ~crc >>> 0);
    return data;
  };
  const words = (...values) => {
    const data = new DataView(new ArrayBuffer(4 * values.length));
    values.forEach((value, i) => data.setUint32(4 * i, value));
    return new Uint8Array(data.buffer);
  };
  // The chunks of a PNG of a canvas: its header, and the parts of its picture.
  const encoded = async (canvas) => {
    const blob = await new Promise((done) => canvas.toBlob(done, "image/png"));
    const data = new Uint8Array(await blob.arrayBuffer());
    const found = { IHDR: [], IDAT: [] };
    for (let at = 8; at < data.length;) {
      const size = new DataView(data.buffer).getUint32(at);
      const type = String.fromCharCode(...data.subarray(at + 4, at + 8));
      if (found[type]) found[type].push(data.subarray(at + 8, at + 8 + size));
      at += size + 12;
    }
    return found;
  };
  const animated = async (player) => {
    const svg = player.plan.svg, canvas = document.createElement("canvas");
    canvas.width = WIDTH;
    canvas.height = Math.round(WIDTH * svg.clientHeight / svg.clientWidth);
    const count = Math.min(MOST_FRAMES, Math.ceil((player.end - player.begin) / player.runs.student.data.step) + 1);
    const step = (player.end - player.begin) / Math.max(1, count - 1), parts = [];
    let header, number = 0;
    for (let i = 0; i < count; i++) {
      player.show(player.begin + i * step);
      paint(svg, canvas);
      const png = await encoded(canvas);
      header = header || png.IHDR[0];
      const last = i === count - 1 ? 1500 : Math.round(1000 * step);
      const shown = new Uint8Array([last >> 8, last & 255, 1000 >> 8, 1000 & 255, 0, 0]);
      parts.push(chunk("fcTL", words(number++, canvas.width, canvas.height, 0, 0), shown));
      for (const data of png.IDAT) parts.push(i ? chunk("fdAT", words(number++), data) : chunk("IDAT", data));
    }
    const begin = new Uint8Array([137, 80, 78, 71, 13, 10, 26, 10]);
    return new Blob([begin, chunk("IHDR", header), chunk("acTL", words(count, 0)), ...parts, chunk("IEND")], { type: "image/apng" });
  };

  const players = new Map([...document.querySelectorAll(".replay")].map((root) => [root.dataset.scenario, new Player(root)]));
  // The replay that keys are for: the one with the focus, or else one in sight.
  const inSight = () => {
    const focused = document.activeElement && document.activeElement.closest(".replay");
    const seen = [...players.values()].filter(({ root }) => {
      const { top, bottom } = root.getBoundingClientRect();
      return Math.min(bottom, innerHeight) - Math.max(top, 0) > 0.5 * Math.min(bottom - top, innerHeight);
    });
    return focused ? players.get(focused.dataset.scenario) : seen.find((one) => one.playing) || seen[0];
  };
  addEventListener("keydown", (event) => {
    const own = { " ": (player) => player.toggle(), ",": (player) => player.step(-1), ".": (player) => player.step(1) }[event.key];
    if (!own || event.ctrlKey || event.metaKey || event.altKey) return;
    // What Space operates by itself keeps it.
    if (event.key === " " && event.target.closest("button:not(.step), summary, input[type=checkbox], select")) return;
    const player = inSight();
    if (!player) return;
    event.preventDefault();
    own(player);
  });

  const reveal = () => {
    const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (!target) return;
    for (let node = target; node; node = node.parentElement) if (node.tagName === "DETAILS") node.open = true;
    target.scrollIntoView();
  };
  addEventListener("hashchange", reveal);
  reveal();

  document.addEventListener("click", (event) => {
    const link = event.target.closest("a[data-time]");
    const player = link && players.get(link.hash.slice("#what-".length));
    if (!player) return;
    event.preventDefault();
    player.stop();
    player.show(Number(link.dataset.time));
    player.root.scrollIntoView({ block: "center" });
    player.slider.focus({ preventScroll: true });
  });

  // The contents name the section, and the check, that is being read.
  const nav = document.querySelector(".contents");
  const links = [...nav.querySelectorAll("a")].map((link) => [link, document.getElementById(link.hash.slice(1))]);
  const follow = () => {
    const above = links.filter(([, place]) => place.offsetParent && place.getBoundingClientRect().top < 0.3 * innerHeight);
    for (const group of [true, false]) {
      const ofKind = (all) => all.filter(([link]) => link.classList.contains("contents-group") === group);
      const current = ofKind(above).pop();
      for (const [link] of ofKind(links)) {
        const is = Boolean(current) && link === current[0];
        if (is && !link.ariaCurrent && link.offsetParent) nav.scrollTo({ left: link.offsetLeft - 16, top: link.offsetTop - 0.4 * nav.clientHeight });
        link.ariaCurrent = is ? "true" : null;
      }
    }
  };
  addEventListener("scroll", follow, { passive: true });
  addEventListener("resize", follow);
  follow();

  // Shown in the page of a review: its keys work here too.
  if (parent !== window) addEventListener("keydown", (event) => {
    if (event.defaultPrevented || event.key.length > 1 || event.ctrlKey || event.metaKey || event.altKey || event.target.matches("input, select")) return;
    parent.postMessage({ key: event.key }, "*");
  });
})();
