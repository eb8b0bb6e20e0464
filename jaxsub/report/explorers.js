"use strict";
Bokeh.set_log_level("warn");
// Puts each figure of Bokeh into the page, and what its choices say into the figure.
for (const explorer of document.querySelectorAll(".explorer")) {
  const item = JSON.parse(explorer.querySelector("script").textContent);
  const selects = [...explorer.querySelectorAll("select")];
  const show = (root) => {
    const [store, bindings] = root.tags;
    const chosen = Object.fromEntries(selects.map((select) => [select.name, select.value]));
    const at = (pattern) => store[pattern.replace(/\{(\w+)\}/g, (_, name) => chosen[name])];
    for (const [name, property, pattern] of bindings) {
      const value = typeof pattern === "string" ? at(pattern) : columns(pattern, at);
      if (value !== undefined) root.document.get_model_by_name(name).setv({ [property]: value });
    }
  };
  explorer.hidden = false;
  Bokeh.embed.embed_item(item).then((views) => {
    const root = [...views.roots][0].model;
    for (const select of selects) select.addEventListener("change", () => show(root));
    explorer.parentElement.classList.add("live");
  });
}

// Columns of one length: what is not there is missing at every place.
function columns(patterns, at) {
  const found = Object.entries(patterns).map(([name, pattern]) => [name, at(pattern)]);
  const length = Math.max(0, ...found.map(([, values]) => (values ? values.length : 0)));
  return Object.fromEntries(found.map(([name, values]) => [name, values ?? new Float32Array(length).fill(NaN)]));
}
