// Experiments of the concept pages. Without this script the picture of each page is still there.
"use strict";
(() => {
  const SVG = "http://www.w3.org/2000/svg";
  const make = (node, attributes, children) => {
    for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
    node.append(...children);
    return node;
  };
  const html = (tag, attributes = {}, ...children) => make(document.createElement(tag), attributes, children);
  const svg = (tag, attributes = {}, ...children) => make(document.createElementNS(SVG, tag), attributes, children);
  const text = (x, y, kind, words) => svg("text", { x, y, class: kind }, words);
  const picture = (height) => svg("svg", { class: "concept-picture", viewBox: `0 0 360 ${height}`, "aria-hidden": "true" });
  const select = (name, options, chosen = options[0]) => {
    const input = html("select", {}, ...options.map((one) => html("option", {}, one)));
    input.value = chosen;
    return { input, label: html("label", {}, name, input) };
  };
  const slider = (name, min, max, step, value) => {
    const input = html("input", { type: "range", min, max, step, value });
    return { input, label: html("label", {}, name, input) };
  };
  const inputs = (...labels) => html("div", { class: "concept-inputs" }, ...labels);
  const group = (name, ...fields) => html("fieldset", {}, html("legend", {}, name), ...fields.map((one) => one.label));

  // An experiment gives its parts and a function that tells [whether it is well, what to say].
  const experiments = {
    qos() {
      const side = (name) => ({
        name,
        reliability: select("Reliability", ["reliable", "best effort"]),
        durability: select("Durability", ["volatile", "transient local"]),
        deadline: select("Deadline", ["none", "500 ms", "100 ms"]),
      });
      const offered = side("Publisher offers"), requested = side("Subscription requests");
      offered.reliability.input.value = "best effort";
      const both = [offered, requested].map((one) => group(one.name, one.reliability, one.durability, one.deadline));
      const strength = { reliability: ["best effort", "reliable"], durability: ["volatile", "transient local"], deadline: ["none", "500 ms", "100 ms"] };
      return [[inputs(...both)], () => {
        const refused = Object.keys(strength).filter((policy) => {
          const rank = (one) => strength[policy].indexOf(one[policy].input.value);
          return rank(offered) < rank(requested);
        });
        const say = (policy) => `${policy}: offered ${offered[policy].input.value}, requested ${requested[policy].input.value}`;
        if (refused.length) return [false, `No match, so no message arrives. Too little is offered: ${refused.map(say).join("; ")}.`];
        const kept = requested.durability.input.value === "transient local";
        const lost = [offered, requested].some((one) => one.reliability.input.value === "best effort");
        return [true, `They match. ${lost ? "A lost message is not sent again" : "A lost message is sent again"}; `
          + `${kept ? "a subscription that starts late gets the last messages" : "a subscription that starts late gets only new messages"}.`];
      }];
    },

    executors() {
      const groups = select("Callback groups", ["one for both timers", "one for each timer", "one, reentrant"]);
      const threads = select("Executor", ["SingleThreadedExecutor", "MultiThreadedExecutor, 2 threads"]);
      const work = slider("Timer A works", 0, 900, 50, 400);
      const drawn = picture(120);
      const PERIOD = 500, END = 3000, B_WORK = 100;
      const simulate = () => {
        const most = threads.input.selectedIndex + 1, kind = groups.input.selectedIndex;
        const timers = [{ next: PERIOD, work: Number(work.input.value) }, { next: PERIOD, work: B_WORK }];
        const runs = [], missed = [];
        for (let now = 0; now < END; now += 10) {
          timers.forEach((timer, index) => {
            const busy = runs.filter((run) => run.end > now);
            const waits = kind === 0 ? busy.length : kind === 1 && busy.some((run) => run.index === index);
            if (timer.next > now || busy.length >= most || waits) return;
            runs.push({ index, due: timer.next, start: now, end: now + Math.max(timer.work, 20) });
            // Calls that were due meanwhile are left out.
            for (timer.next += PERIOD; timer.next <= now; timer.next += PERIOD) missed.push({ index, due: timer.next });
          });
        }
        return { runs, missed };
      };
      const draw = ({ runs }) => {
        const x = (ms) => 24 + ms * 330 / END;
        const rows = [20, 60];
        drawn.replaceChildren(
          ...[0, 1, 2, 3, 4, 5, 6].map((tick) => svg("line", { x1: x(tick * PERIOD), y1: 10, x2: x(tick * PERIOD), y2: 92, class: "thin dash" })),
          ...[0, 1, 2, 3].map((second) => text(Math.min(x(second * 1000), 346), 108, "small c", `${second} s`)),
          ...rows.map((y, index) => text(4, y + 17, "strong", "AB"[index])),
          ...runs.map((run) => svg("rect", {
            x: x(run.start), y: rows[run.index], height: 24, width: Math.max(x(Math.min(run.end, END)) - x(run.start) - 1, 2),
            class: `full ${run.start - run.due > 20 ? "bad" : "good"}`,
          })));
      };
      const parts = [inputs(groups.label, threads.label, work.label), drawn];
      return [parts, () => {
        const found = simulate();
        draw(found);
        const late = Math.max(0, ...found.runs.filter((run) => run.index === 1).map((run) => run.start - run.due));
        const skipped = found.missed.length;
        const both = found.runs.some((a) => found.runs.some((b) => a !== b && a.start < b.end && b.start < a.end));
        const words = `Timer A works ${work.input.value} ms every 500 ms, timer B 100 ms. B starts `
          + (late > 20 ? `up to ${late} ms late` : "on time") + (skipped ? `; ${skipped} calls are left out` : "")
          + `. Callbacks ${both ? "run at the same time" : "never run at the same time"}.`;
        return [late <= 20 && !skipped, words];
      }];
    },

    angles() {
      const yaw = slider("The robot's yaw", -180, 180, 5, 170), goal = slider("The goal's heading", -180, 180, 5, -170);
      const drawn = picture(190);
      const at = (degrees, radius) => [180 + radius * Math.cos(degrees * Math.PI / 180), 95 - radius * Math.sin(degrees * Math.PI / 180)];
      const ray = (degrees, radius, kind) => { const [x, y] = at(degrees, radius); return svg("line", { x1: 180, y1: 95, x2: x, y2: y, class: kind }); };
      const arc = (from, turn, radius, kind) => {
        const steps = Array.from({ length: 73 }, (_, step) => at(from + turn * step / 72, radius + 6 * step / 72).map((value) => value.toFixed(1)).join(" "));
        return svg("path", { d: `M${steps.join("L")}`, class: kind });
      };
      const signed = (number, digits = 0) => number.toFixed(digits).replace("-", "−");
      const radians = (degrees) => `${signed(degrees * Math.PI / 180, 2)} rad`;
      return [[inputs(yaw.label, goal.label), drawn], () => {
        const from = Number(yaw.input.value), to = Number(goal.input.value), plain = to - from;
        const wrapped = ((plain + 180) % 360 + 360) % 360 - 180;
        drawn.replaceChildren(
          svg("circle", { cx: 180, cy: 95, r: 80, class: "thin" }), text(268, 99, "small", "0"), text(92, 99, "small e", "π, −π"), text(180, 11, "small c", "π/2"), text(180, 188, "small c", "−π/2"),
          ray(from, 76, "mark"), ray(to, 76, "dash"), arc(from, wrapped, 50, "good"),
          ...(wrapped === plain ? [] : [arc(from, plain, 26, "bad dash")]));
        const turn = wrapped === 0 ? "no turn" : `turn ${wrapped > 0 ? "left" : "right"} by ${Math.abs(wrapped)}°`;
        const same = wrapped === plain;
        return [same, `goal − yaw = ${signed(plain)}° = ${radians(plain)}${same ? "" : `; wrapped: ${signed(wrapped)}° = ${radians(wrapped)}`}: ${turn}`
          + `${same ? "." : `, not ${plain > 0 ? "left" : "right"} by ${Math.abs(plain)}°.`}`];
      }];
    },

    names() {
      const space = select("The node's namespace", ["/", "/robot1", "/robot1/arm"], "/robot1");
      const name = select("The name in the code", ["cmd_vel", "/cmd_vel", "~/cmd_vel"]);
      return [[inputs(space.label, name.label)], () => {
        const base = space.input.value === "/" ? "" : space.input.value, written = name.input.value;
        const full = written.startsWith("/") ? written : written.startsWith("~") ? `${base}/driver${written.slice(1)}` : `${base}/${written}`;
        return [true, `Of a node called driver, the topic is ${full}`];
      }];
    },
  };

  for (const root of document.querySelectorAll(".concept-try[data-try]")) {
    if (!experiments[root.dataset.try] || root.firstChild) continue;
    const [parts, tell] = experiments[root.dataset.try]();
    const result = html("p", { class: "concept-result", role: "status" });
    const update = () => {
      const [well, words] = tell();
      result.className = `concept-result ${well ? "good" : "bad"}`;
      result.textContent = words;
    };
    root.append(html("p", { class: "concept-title" }, "Try it"), ...parts, result);
    root.addEventListener("input", update);
    update();
  }
})();
