"use strict";
const at = (id) => document.getElementById(id);
const status = document.querySelector("[role=status]");
const frame = document.querySelector("iframe");
const chart = document.querySelector("svg");
const main = document.querySelector("main");
let shown = null;
let last = "";
const list = (element, lines) => {
  element.hidden = lines.length === 0;
  if (element.dataset.text === lines.join("\n")) return;
  element.dataset.text = lines.join("\n");
  element.replaceChildren(...lines.map((line) => {
    const item = document.createElement("li");
    item.textContent = line;
    return item;
  }));
};
const doing = (phases) => {
  const all = Object.entries(phases);
  const going = all.filter(([, phase]) => phase !== "recorded");
  const done = all.length - going.length;
  return [...going.map(([name, phase]) => name ? `${name}: ${phase}` : phase), ...(done ? [`${done} of ${all.length} recorded`] : [])];
};
const draw = (scores, most) => {
  chart.toggleAttribute("hidden", scores.length < 2);
  const made = (name, attributes) => {
    const element = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    return element;
  };
  const known = scores.map((score, index) => [index, score]).filter(([, score]) => score !== null);
  const points = known.map(([index, score]) => [4 + 152 * index / Math.max(1, scores.length - 1), 21 - 18 * score / (most || 1)]);
  const end = points.at(-1);
  chart.replaceChildren(made("polyline", { points: points.join(" ") }), ...(end ? [made("circle", { cx: end[0], cy: end[1], r: 3 })] : []));
  chart.setAttribute("aria-label", `Scores since watching began, of ${most} points: ${scores.map((score) => score ?? "not graded").join(", ")}`);
};
const follow = async () => {
  try {
    const text = await (await fetch("state")).text();
    const state = JSON.parse(text);
    if (text !== last) {
      status.textContent = state.text;
      document.title = state.title;
      main.classList.toggle("is-old", state.is_old);
      at("changed").hidden = !state.changed;
      at("changed").textContent = `Since your last save: ${state.changed}`;
      at("hints").hidden = state.hints === null;
      at("hints").textContent = `Your course counts the further hints that you open here: ${state.hints} so far.`;
      list(at("phases"), state.is_old ? doing(state.phases) : []);
      list(at("early"), state.is_old ? state.early : []);
      draw(state.scores, state.most);
      last = text;
    }
    if (shown !== null && state.version !== shown) {
      // A reload keeps the scroll position.
      frame.contentWindow.location.reload();
    }
    shown = state.version;
  } catch {
    status.textContent = "has ended. This is the last report.";
    main.classList.remove("is-old");
  }
  setTimeout(follow, 500);
};
frame.addEventListener("load", () => {
  // Else the keys of the replay do nothing until somebody clicks into the report.
  if (document.activeElement === document.body) frame.contentWindow.focus();
  // The report may ask no server for anything: this page around it tells which hints are opened in it.
  frame.contentDocument.addEventListener("toggle", ({ target }) => {
    const { check, hint } = target.dataset;
    if (!target.open || !hint || at("hints").hidden) return;
    fetch("hints", { method: "POST", body: JSON.stringify({ check, number: Number(hint) }) }).catch(() => {});
  }, true);
});
follow();
