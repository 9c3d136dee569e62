"use strict";
(() => {
  const find = (query, from = document) => from.querySelector(query);
  const all = (query, from = document) => [...from.querySelectorAll(query)];
  const text = find("#text"), notes = find("#notes"), saved = find("#saved"), problem = find("#problem");
  const frame = find("iframe"), code = find("#code"), files = find("#file"), keys = find("#keys");
  let panel = find("#panel"), current = 0, queue = Promise.resolve(), place = null, editing = null, shownFile = null;

  // What is typed outlives a reload, a conflict and the end of the server.
  const draft = `${location.pathname} ${panel.dataset.attempt}`;
  const keep = () => sessionStorage.setItem(draft, JSON.stringify({ text: text.value, place, editing }));
  text.addEventListener("input", keep);

  const fail = (said) => {
    saved.textContent = "";
    find("p", problem).textContent = said;
    problem.hidden = false;
    return false;
  };
  find("button", problem).addEventListener("click", () => location.reload());

  // One change after the other, each with the version that the one before left behind.
  const change = (what) => (queue = queue.then(async () => {
    saved.textContent = "saving";
    try {
      const answer = await fetch("review", {
        method: "POST", headers: { "Content-Type": "application/json" },
        body: JSON.stringify({ version: panel.dataset.version, attempt: panel.dataset.attempt, ...what }),
      });
      const body = await answer.text();
      if (!answer.ok) return fail(`${body}\nNothing was saved. Your text stays in its box.`);
      problem.hidden = true;
      swap(body);
      return true;
    } catch {
      return fail("rosgrade review cannot be reached any more. Nothing was saved. Start it again. Your text stays in its box.");
    }
  }));
  const swap = (html) => {
    const focused = panel.contains(document.activeElement) && document.activeElement.id;
    const shut = all("details:not([open]) > summary", panel).map((one) => one.parentElement.id);
    panel.outerHTML = html;
    panel = find("#panel");
    if (shut.includes("bank") && find("#bank")) find("#bank").open = false;
    saved.textContent = panel.dataset.saved;
    if (focused) document.getElementById(focused)?.focus();
    mark();
    annotate();
  };

  const again = async (button) => {
    button.disabled = true;
    saved.textContent = "running it again: this takes as long as its runs";
    try {
      let answer = await fetch("again", {
        method: "POST", headers: { "Content-Type": "application/json" }, body: "{}",
      });
      while (answer.ok) {
        answer = await fetch("again");
        if (answer.status === 200) return location.reload();
        await new Promise((done) => setTimeout(done, 500));
      }
      fail(`It was not run again: ${await answer.text()}`);
    } catch {
      fail("rosgrade review cannot be reached any more. Start it again.");
    }
    button.disabled = false;
  };

  const items = () => all(".item", panel);
  const mark = () => items().forEach((item, i) => {
    item.classList.toggle("is-current", i === current);
    if (i === current) item.setAttribute("aria-current", "true"); else item.removeAttribute("aria-current");
  });
  const score = (item, points) => change({
    do: "score", item: item.dataset.item, points, note: find(".why input", item).value,
  });
  const digit = (number) => {
    const item = items()[current];
    if (document.activeElement.closest("#bank")) return number && insert(find(`#bank-${number}`));
    if (!item) return;
    const levels = all(".levels > button", item);
    if (number && levels.length && !levels[number - 1]) return;
    if (number && !levels.length && number > Number(item.dataset.max)) return;
    const points = !number ? null : levels.length ? Number(levels[number - 1].dataset.points) : number;
    if (number && current < items().length - 1) current++;
    score(item, points);
  };
  const insert = (entry) => {
    if (!entry) return;
    const chosen = find(".said", entry).textContent;
    text.value = text.value.trim() ? `${text.value.trimEnd()}\n${chosen}` : chosen;
    keep();
    text.focus();
  };

  const setPlace = (now, at = null) => {
    place = now;
    editing = at;
    find("#where span").textContent = `${at === null ? "" : "changes the comment "}${now ? `at ${now.file}:${now.line}` : "about the whole submission"}`;
    find("#whole").hidden = !now && at === null;
    keep();
  };
  find("#whole").addEventListener("click", () => { setPlace(null); text.focus(); });
  const comment = async () => {
    if (!text.value.trim()) return text.focus();
    const sent = text.value;
    if (!await change({ do: "comment", text: sent, index: editing, ...place })) return;
    if (text.value === sent) text.value = "";
    setPlace(null);
  };
  find("#write").addEventListener("submit", (event) => { event.preventDefault(); comment(); });
  find("#give").addEventListener("submit", async (event) => {
    event.preventDefault();
    const form = event.target;
    if (await change({ do: "give", ...Object.fromEntries(new FormData(form)) })) form.reset();
  });
  notes.addEventListener("change", () => change({ do: "notes", notes: notes.value }));

  const show = (name, line) => {
    for (const tab of all("[role=tab]")) {
      const chosen = tab.id === `tab-${name}`;
      tab.setAttribute("aria-selected", chosen);
      tab.tabIndex = chosen ? 0 : -1;
      find(`#${tab.getAttribute("aria-controls")}`).hidden = !chosen;
    }
    if (name === "source" && files) load(files.value, line);
  };
  all("[role=tab]").forEach((tab) => {
    tab.addEventListener("click", () => show(tab.id.slice(4)));
    tab.addEventListener("keydown", (event) => {
      if (!event.key.startsWith("Arrow")) return;
      const other = all("[role=tab]").find((one) => one !== tab);
      other.focus();
      other.click();
    });
  });

  const load = async (path, line) => {
    if (shownFile !== path) {
      const answer = await fetch(`source?file=${encodeURIComponent(path)}`);
      if (!answer.ok) return fail(await answer.text());
      code.innerHTML = await answer.text();
      shownFile = files.value = path;
      annotate();
    }
    const row = find(`#L${line}`, code) ?? find(".is-marked", code) ?? find("#L1", code);
    markLine(row, line !== undefined);
  };
  const markLine = (row, focus) => {
    if (!row) return;
    for (const one of all(".is-marked", code)) { one.classList.remove("is-marked"); find(".line", one).tabIndex = -1; }
    row.classList.add("is-marked");
    find(".line", row).tabIndex = 0;
    if (focus) { find(".line", row).focus(); row.scrollIntoView({ block: "nearest" }); }
  };
  const annotate = () => {
    if (!code || shownFile === null) return;
    all(".note", code).forEach((one) => one.remove());
    for (const one of all("[data-file]", panel)) {
      const row = one.dataset.file === shownFile && find(`#L${one.dataset.line || 1}`, code);
      if (!row) continue;
      const said = document.createElement("div");
      said.className = one.dataset.said === undefined ? "note" : "note is-finding";
      said.textContent = one.dataset.said ?? find(".said", one).textContent;
      row.append(said);
    }
  };
  if (files) {
    const first = all("[data-said]", panel)[0]?.dataset.file;
    const names = [...files.options].map((option) => option.value);
    files.value = names.find((name) => name === first)
      ?? names.find((name) => /\.(py|cpp)$/.test(name) && !/(setup|__init__|test_[^/]*)\.py$/.test(name)) ?? names[0];
    files.addEventListener("change", () => load(files.value));
    code.addEventListener("click", (event) => {
      const line = event.target.closest(".line");
      if (!line) return;
      markLine(line.parentElement, true);
      setPlace({ file: shownFile, line: Number(line.textContent) });
      text.focus();
    });
    code.addEventListener("keydown", (event) => {
      const step = { ArrowUp: "previousElementSibling", ArrowDown: "nextElementSibling" }[event.key];
      const row = event.target.closest("li");
      if (!step || !row) return;
      event.preventDefault();
      markLine(row[step], true);
    });
  }

  addEventListener("click", (event) => {
    const target = event.target.closest("button");
    if (!target || !panel.contains(target)) return;
    const item = target.closest(".item"), entry = target.closest("li");
    if (item) { current = items().indexOf(item); score(item, Number(target.dataset.points)); }
    else if (target.closest("#bank")) insert(target);
    else if (target.matches(".place")) {
      const at = target.dataset.file ? target.dataset : entry.dataset;
      if (files && [...files.options].some((option) => option.value === at.file)) { files.value = at.file; show("source", at.line); }
    } else if (target.matches("#settle")) change({ do: "settle" });
    else if (target.matches("#again")) again(target);
    else if (target.matches(".take")) change({ do: "take", index: Number(entry.dataset.index) });
    else if (target.matches(".remove")) change({ do: "uncomment", index: Number(entry.dataset.index) });
    else if (target.matches(".edit")) {
      const { file, line, index } = entry.dataset;
      setPlace(file ? { file, line: Number(line) || null } : null, Number(index));
      text.value = find(".said", entry).textContent;
      keep();
      text.focus();
    }
  });
  addEventListener("change", (event) => {
    const item = panel.contains(event.target) && event.target.closest(".item");
    if (!item) return;
    const number = find("input[type=number]", item);
    if (event.target === number) score(item, number.value === "" ? null : Number(number.value));
    else if (item.dataset.points !== "") score(item, Number(item.dataset.points));
  });
  addEventListener("focusin", (event) => {
    const at = items().indexOf(event.target.closest(".item"));
    if (at >= 0) { current = at; mark(); }
  });

  const go = (link) => link && queue.then(() => { location.href = link.href; });
  const actions = {
    j: () => go(find("#next")), n: () => go(find("#next")), k: () => go(find("#previous")), p: () => go(find("#previous")),
    u: () => change({ do: "undo" }),
    i: () => { current = (current + 1) % Math.max(1, items().length); mark(); items()[current]?.scrollIntoView({ block: "nearest" }); },
    c: () => {
      const line = document.activeElement.closest(".code .line");
      if (line) setPlace({ file: shownFile, line: Number(line.textContent) });
      text.focus();
    },
    b: () => { const bank = find("#bank"); if (bank) { bank.open = true; find("button", bank).focus(); } },
    r: () => show("report"), s: () => show("source", 0),  // the marked line gets the focus
    "?": () => keys.showModal(),
  };
  const act = (key) => {
    if (/^[0-9]$/.test(key)) digit(Number(key));
    else if (Object.hasOwn(actions, key)) actions[key]();
    else return false;
    return true;
  };
  addEventListener("keydown", (event) => {
    if (event.target === text && event.key === "Enter" && (event.ctrlKey || event.metaKey)) return comment();
    if (event.ctrlKey || event.metaKey || event.altKey || keys.open) return;
    if (event.target.matches("textarea, select, input:not([type=checkbox])")) {
      if (event.key === "Escape") event.target.blur();
      else if (event.key === "Enter" && event.target.matches(".item input")) event.target.blur();
      return;
    }
    if (act(event.key)) event.preventDefault();
  });
  // Keys that are pressed in the report.
  addEventListener("message", (event) => {
    if (frame && event.source === frame.contentWindow && typeof event.data?.key === "string" && !keys.open) act(event.data.key);
  });
  find("#undo").addEventListener("click", actions.u);
  find("#help").addEventListener("click", actions["?"]);
  find("#only").addEventListener("change", (event) => { location.search = event.target.checked ? "?waiting" : ""; });

  const kept = JSON.parse(sessionStorage.getItem(draft) ?? "{}");
  text.value = kept.text ?? "";
  setPlace(kept.place ?? null, kept.editing ?? null);

  if (frame) frame.src = `report.html${location.hash}`;
  current = Math.max(0, items().findIndex((item) => item.dataset.points === ""));
  mark();
})();
