"use strict";
// The report is whole without this: it adds the replay, opens what a link points at, and
// nothing else. It reads the page's own data and loads nothing from elsewhere.
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
        [bottom, top] = [Math.min(bottom, y - radius - 0.1), Math.max(top, y + radius + 0.1)];
      }
      const far = { left: left - 0.35, right: right + 0.35, bottom: bottom - 0.35, top: top + 0.35 };
      for (const [x1, y1, x2, y2] of this.data.walls.map((wall) => wall.map((value) => value / 1000))) {
        if (Math.max(x1, x2) < far.left || Math.min(x1, x2) > far.right) continue;
        if (Math.max(y1, y2) < far.bottom || Math.min(y1, y2) > far.top) continue;
        for (const [x, y] of [[x1, y1], [x2, y2]]) {
          const [nearX, nearY] = [clamp(x, far.left, far.right), clamp(y, far.bottom, far.top)];
          [left, right] = [Math.min(left, nearX - 0.05), Math.max(right, nearX + 0.05)];
          [bottom, top] = [Math.min(bottom, nearY - 0.05), Math.max(top, nearY + 0.05)];
        }
      }
      return { left, right, bottom, top };
    }
  }

  // The picture of one run.
  class Side {
    constructor(parent, name, run, box) {
      this.run = run;
      const figure = make(parent, "figure", { class: "side" });
      const values = run.data.values.join(", ");
      make(figure, "figcaption", {}, values ? `${name} (${values})` : name);
      const [width, height] = [box.right - box.left, box.top - box.bottom];
      const svg = make(figure, "svg", {
        viewBox: `${box.left} ${-box.top} ${width} ${height}`, class: "plan", role: "img",
      });
      this.svg = svg;
      this.name = name;
      const world = make(svg, "g", { transform: "scale(1 -1)" });
      for (const wall of run.data.walls) {
        const [x1, y1, x2, y2, radius] = wall.map((value) => value / 1000);
        make(world, "line", radius
          ? { x1, y1, x2: x2 + 1e-4, y2, class: "thing", "stroke-width": 2 * radius }
          : { x1, y1, x2, y2, class: "wall" });
      }
      this.movers = run.data.moving.map((thing) => thing.radius === null
        ? make(world, "rect", {
            x: -thing.size[0] / 2000, y: -thing.size[1] / 2000,
            width: thing.size[0] / 1000, height: thing.size[1] / 1000, class: "mover",
          })
        : make(world, "circle", { r: thing.radius / 1000, class: "mover" }));
      for (const goal of run.goals) this.goal(world, goal, Math.max(width, height));
      make(world, "path", { d: this.way(run.x.length), class: "way to-come" });
      this.beams = make(world, "path", { class: "beams" });
      this.gone = make(world, "path", { class: "way" });
      this.robot = make(world, "g");
      const radius = run.data.radius / 1000;
      make(this.robot, "circle", { r: radius, class: "robot" });
      make(this.robot, "line", { x1: 0, y1: 0, x2: radius, y2: 0, class: "robot nose" });
      this.cross = make(world, "path", {
        d: `M${-radius} ${-radius}L${radius} ${radius}M${-radius} ${radius}L${radius} ${-radius}`, class: "out",
      });
      this.chart(figure);
      this.readout = make(figure, "p", { class: "readout" });
      this.log = make(figure, "ol", { class: "log said-so-far" });
    }
    goal(world, { x, y, yaw, radius }, size) {
      make(world, "circle", { cx: x, cy: y, r: radius, class: "target" });
      const [dx, dy] = [1.5 * radius * Math.cos(yaw), 1.5 * radius * Math.sin(yaw)];
      make(world, "line", { x1: x, y1: y, x2: x + dx, y2: y + dy, class: "target-heading" });
      const text = make(this.svg, "text", { x, y: -(y + 1.2 * radius), "text-anchor": "middle", class: "lane" }, "goal");
      // In metres, as all of the picture is.
      text.style.fontSize = `${0.04 * size}px`;
      text.style.strokeWidth = `${0.012 * size}px`;
      text.style.vectorEffect = "none";
    }
    way(count) {
      let path = "";
      for (let i = 0; i < count; i++) path += `${i ? "L" : "M"}${this.run.x[i].toFixed(3)} ${this.run.y[i].toFixed(3)}`;
      return path;
    }
    chart(figure) {
      const { run } = this;
      const svg = make(figure, "svg", {
        viewBox: "0 0 300 64", class: "chart", preserveAspectRatio: "none", "aria-hidden": "true",
      });
      [[run.cv, run.v], [run.cw, run.w]].forEach(([command, real], row) => {
        const most = Math.max(0.02, ...command.map(Math.abs), ...real.map(Math.abs)) * 1.1;
        const point = (value, i) => `${(300 * i / (run.x.length - 1)).toFixed(1)} ${(16 + 32 * row - 14 * value / most).toFixed(1)}`;
        make(svg, "line", { x1: 0, x2: 300, y1: 16 + 32 * row, y2: 16 + 32 * row, class: "grid" });
        make(svg, "path", { d: "M" + command.map(point).join("L"), class: "command" });
        make(svg, "path", { d: "M" + real.map(point).join("L"), class: "true" });
      });
      this.cursor = make(svg, "line", { y1: 0, y2: 64, class: "cursor" });
    }
    show(time) {
      const { run } = this;
      const now = run.at(time);
      this.robot.setAttribute("transform", `translate(${now.x} ${now.y}) rotate(${now.yaw * 180 / Math.PI})`);
      this.cross.setAttribute("transform", `translate(${now.x} ${now.y})`);
      this.cross.setAttribute("visibility", run.touches(time) ? "visible" : "hidden");
      this.gone.setAttribute("d", this.way(now.index + 1));
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
      const x = 300 * clamp((time - run.begin) / (run.end - run.begin), 0, 1);
      this.cursor.setAttribute("x1", x);
      this.cursor.setAttribute("x2", x);
      const over = time > run.end + 0.05 ? " The run has ended." : "";
      const away = run.goals.map((goal) =>
        ` ${Math.hypot(now.x - goal.x, now.y - goal.y).toFixed(2)} m from the goal (dashed: within ${goal.within}).`).join("");
      this.readout.textContent =
        `Commanded ${now.cv.toFixed(2)} m/s, ${now.cw.toFixed(2)} rad/s; true ${now.v.toFixed(2)} m/s, ${now.w.toFixed(2)} rad/s.` +
        (run.touches(time) ? " It touches something." : "") + away + over;
      this.svg.setAttribute("aria-label", `${this.name}: robot at x ${now.x.toFixed(2)} m, y ${now.y.toFixed(2)} m, heading ${Math.round(now.yaw * 180 / Math.PI)}°`);
      const lines = run.data.log.filter(([stamp]) => stamp <= time).slice(-4);
      this.log.replaceChildren();
      for (const [stamp, text] of lines) make(this.log, "li", {}, `${stamp.toFixed(2)} s  ${text}`);
      this.log.hidden = !lines.length;
    }
  }

  class Player {
    constructor(root) {
      this.root = root;
      const data = JSON.parse(document.getElementById(`data-${root.dataset.scenario}`).textContent);
      const runs = [new Run(data.student)];
      if (data.reference) {
        const reference = new Run(data.reference);
        // Both clocks start with the simulation: the later launch of one is not a later drive.
        this.shift = reference.begin - runs[0].begin;
        runs.push(reference);
      }
      const boxes = runs.map((run) => run.box());
      const box = {
        left: Math.min(...boxes.map((b) => b.left)), right: Math.max(...boxes.map((b) => b.right)),
        bottom: Math.min(...boxes.map((b) => b.bottom)), top: Math.max(...boxes.map((b) => b.top)),
      };
      const sides = make(root, "div", { class: "sides" });
      this.sides = runs.map((run, i) => new Side(sides, i ? "Reference" : "This submission", run, box));
      this.begin = runs[0].begin;
      this.end = Math.max(runs[0].end, runs[1] ? runs[1].end - this.shift : 0);
      this.slider = root.querySelector("input");
      this.output = root.querySelector("output");
      this.button = root.querySelector("button");
      this.slider.min = this.begin.toFixed(1);
      this.slider.max = this.end.toFixed(1);
      this.slider.addEventListener("input", () => { this.stop(); this.show(Number(this.slider.value)); });
      this.button.addEventListener("click", () => (this.playing ? this.stop() : this.play()));
      root.hidden = false;
      this.show(this.begin);
    }
    show(time) {
      this.time = clamp(time, this.begin, this.end);
      this.slider.value = this.time.toFixed(1);
      this.slider.setAttribute("aria-valuetext", `${this.time.toFixed(1)} s after launch`);
      this.output.textContent = `${this.time.toFixed(1)} s`;
      this.sides.forEach((side, i) => side.show(this.time + (i ? this.shift : 0)));
    }
    play() {
      if (this.time >= this.end - 0.05) this.show(this.begin);
      this.playing = true;
      this.button.textContent = "Pause";
      let last = performance.now(), due = 0;
      const frame = (now) => {
        if (!this.playing) return;
        due += (now - last) / 1000;
        last = now;
        // Who asked for less motion gets stills, two a second.
        if (due >= (calm.matches ? 0.5 : 0)) { this.show(this.time + due); due = 0; }
        if (this.time >= this.end) this.stop();
        else requestAnimationFrame(frame);
      };
      requestAnimationFrame(frame);
    }
    stop() {
      this.playing = false;
      this.button.textContent = "Play";
    }
  }

  const players = new Map();
  const ready = (root) => {
    const name = root.dataset.scenario;
    if (!players.has(name)) players.set(name, new Player(root));
    return players.get(name);
  };
  for (const root of document.querySelectorAll(".replay")) {
    const card = root.closest("details");
    if (!card || card.open) ready(root);
    else card.addEventListener("toggle", () => card.open && ready(root), { once: true });
  }

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
    if (!link) return;
    const card = document.getElementById(link.hash.slice(1));
    if (card && card.tagName === "DETAILS") card.open = true;
    const root = card && card.querySelector(".replay");
    if (!root) return;
    event.preventDefault();
    const player = ready(root);
    player.stop();
    player.show(Number(link.dataset.time));
    root.scrollIntoView({ block: "center" });
    player.slider.focus({ preventScroll: true });
  });

  // Shown in the page of a review: its keys work here too.
  if (parent !== window) addEventListener("keydown", (event) => {
    if (event.key.length > 1 || event.ctrlKey || event.metaKey || event.altKey || event.target.matches("input")) return;
    parent.postMessage({ key: event.key }, "*");
  });
})();
