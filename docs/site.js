// The theme's copy buttons stand each in a <nav> of its own, all without a name: they are no places to go to.
"use strict";
const unname = () => {
  for (const bar of document.querySelectorAll("nav.md-code__nav:not([role])")) bar.setAttribute("role", "presentation");
};
new MutationObserver(unname).observe(document.documentElement, { childList: true, subtree: true });
unname();
