"use strict";
(() => {
  const main = document.querySelector("main"), problem = document.querySelector("#problem");
  main.addEventListener("toggle", async (event) => {
    const cluster = event.target, place = cluster.querySelector(".examples");
    if (!cluster.open || place.hasChildNodes()) return;
    const answer = await fetch(`clusters/example?check=${cluster.dataset.example}`);
    if (answer.ok) place.innerHTML = await answer.text();
  }, true);
  const open = () => { const one = location.hash && document.getElementById(location.hash.slice(1)); if (one) { one.open = true; one.scrollIntoView(); } };
  addEventListener("hashchange", open);
  open();
  problem.querySelector("button").addEventListener("click", () => location.reload());
  main.addEventListener("submit", async (event) => {
    event.preventDefault();
    const form = event.target, cluster = form.closest(".cluster");
    const sent = new FormData(form), typed = Object.fromEntries(sent);
    if (form.dataset.do === "split") typed.students = sent.getAll("students");
    if (typed.share) typed.share = Number(typed.share) / 100;
    let said;
    try {
      const answer = await fetch("clusters", {
        method: "POST", headers: { "Content-Type": "application/json" },
        body: JSON.stringify({ do: form.dataset.do, was: Number(cluster.dataset.was), check: cluster.dataset.check, cause: cluster.dataset.cause, ...typed }),
      });
      if (answer.ok) {
        location.hash = cluster.id;
        return location.reload();
      }
      said = await answer.text();
    } catch {
      said = "rosgrade review cannot be reached any more. Start it again.";
    }
    problem.querySelector("p").textContent = `${said}\nNothing was saved. Your text stays in its box.`;
    problem.hidden = false;
    problem.scrollIntoView();
  });
})();
