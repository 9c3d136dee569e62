"use strict";
const status = document.querySelector("[role=status]");
const frame = document.querySelector("iframe");
let shown = null;
const follow = async () => {
  try {
    const state = await (await fetch("state")).json();
    status.textContent = state.text;
    document.title = state.title;
    if (shown !== null && state.version !== shown) {
      // A reload keeps the scroll position.
      frame.contentWindow.location.reload();
    }
    shown = state.version;
  } catch {
    status.textContent = "has ended. This is the last report.";
  }
  setTimeout(follow, 500);
};
follow();
