"use strict";
const status = document.querySelector("[role=status]");
const frame = document.querySelector("iframe");
let shown = null;
const source = new EventSource("events");
source.onmessage = (event) => {
  const state = JSON.parse(event.data);
  status.textContent = state.told;
  document.title = state.title;
  if (shown !== null && state.version !== shown) {
    // A reload keeps the place that somebody reads at.
    frame.contentWindow.location.reload();
  }
  shown = state.version;
};
source.onerror = () => {
  status.textContent = "has ended. This is the last report.";
};
