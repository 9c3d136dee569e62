"use strict";
(() => {
  const main = document.querySelector("main"), problem = document.querySelector("#problem"), text = document.querySelector("#text");
  const check = new URLSearchParams(location.search).get("check") ?? document.querySelector("select").value;
  const draft = "regrade", typed = sessionStorage.getItem(draft);
  if (typed !== null) text.value = typed;
  text.addEventListener("input", () => sessionStorage.setItem(draft, text.value));
  const at = check ? text.value.search(new RegExp(`\\bid: *["']?${check}\\b`)) : -1;
  if (at >= 0) {
    text.focus({ preventScroll: true });
    text.setSelectionRange(at, at);
    const lines = (part) => part.split("\n").length;
    text.scrollTop = text.scrollHeight * (lines(text.value.slice(0, at)) - 3) / lines(text.value);
  }
  document.querySelector("#choose").addEventListener("change", (event) => { location.search = `?check=${encodeURIComponent(event.target.value)}`; });
  main.addEventListener("submit", async (event) => {
    event.preventDefault();
    const doing = event.submitter.value;
    try {
      const answer = await fetch("regrade", {
        method: "POST", headers: { "Content-Type": "application/json" },
        body: JSON.stringify({ do: doing, check, text: text.value }),
      });
      if (answer.ok) {
        if (doing !== "preview") sessionStorage.removeItem(draft);
        return location.reload();
      }
      problem.firstElementChild.textContent = await answer.text();
    } catch {
      problem.firstElementChild.textContent = "rosgrade review cannot be reached any more. Start it again.";
    }
    problem.hidden = false;
    problem.scrollIntoView();
  });
  // Only the result is exchanged, so that the text and the focus stay.
  const follow = async () => {
    const page = new DOMParser().parseFromString(await (await fetch(location.href)).text(), "text/html");
    document.querySelector("section").replaceWith(page.querySelector("section"));
    if (page.querySelector("main").dataset.running) setTimeout(follow, 300);
    else main.dataset.running = "";
  };
  if (main.dataset.running) follow();
})();
