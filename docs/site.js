// What the theme makes while a page is shown, and a reader of screens should know better.
"use strict";
const mend = () => {
  // Copy buttons stand each in a <nav> of its own: they are no places to go to.
  for (const bar of document.querySelectorAll("nav.md-code__nav:not([role])")) bar.setAttribute("role", "presentation");
  // A wide table is scrolled with the keyboard too.
  for (const box of document.querySelectorAll(".md-typeset__scrollwrap:not([tabindex])")) {
    box.tabIndex = 0;
    box.setAttribute("role", "group");
    box.setAttribute("aria-label", "Table");
  }
  // The label of a section with a page of its own is empty.
  for (const part of document.querySelectorAll("nav.md-nav[aria-labelledby]")) {
    if (document.getElementById(part.getAttribute("aria-labelledby"))?.textContent.trim()) continue;
    part.removeAttribute("aria-labelledby");
    part.setAttribute("aria-label", part.querySelector(".md-nav__title").textContent.trim());
  }
};
new MutationObserver(mend).observe(document.documentElement, { childList: true, subtree: true });
mend();
