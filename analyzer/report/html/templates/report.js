"use strict";
(() => {
  const form = document.getElementById("filter");
  const all = [...document.querySelectorAll("details.finding")];
  const toggle = document.getElementById("toggle");
  const matches = document.getElementById("matches");
  const texts = new Map();
  const textOf = (of) => {
    if (!texts.has(of)) texts.set(of, of.textContent.toLowerCase());
    return texts.get(of);
  };
  const apply = () => {
    const words = form.elements.text.value.toLowerCase().split(" ").filter(Boolean);
    const severity = form.elements.severity.value;
    const category = form.elements.category.value;
    let shown = 0;
    for (const of of all) {
      const fits = (!severity || of.dataset.s === severity) && (!category || of.dataset.c === category) &&
        words.every((word) => textOf(of).includes(word));
      of.hidden = !fits;
      shown += fits ? 1 : 0;
    }
    matches.textContent = shown === all.length ? `${shown} findings` : `${shown} of ${all.length} findings`;
  };
  if (all.length > 1) {
    form.hidden = false;
    form.addEventListener("input", apply);
    form.addEventListener("submit", (event) => event.preventDefault());
    toggle.addEventListener("click", () => {
      const open = toggle.textContent === "Open all";
      for (const of of all) if (!of.hidden) of.open = open;
      toggle.textContent = open ? "Close all" : "Open all";
    });
    apply();
  }
  const show = () => {
    const target = document.getElementById(location.hash.slice(1));
    const of = target && target.closest("details");
    if (!of) return;
    of.hidden = false;
    of.open = true;
    of.scrollIntoView({ block: "start" });
  };
  addEventListener("hashchange", show);
  show();
  let closed = [];
  addEventListener("beforeprint", () => {
    closed = [...document.querySelectorAll("details:not([open])")];
    for (const of of closed) of.open = true;
  });
  addEventListener("afterprint", () => {
    for (const of of closed) of.open = false;
  });
})();
