"use strict";
(function () {
  const data = JSON.parse(document.getElementById("data").textContent);
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const config = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["lasso2d", "select2d"] };

  const NARROW = 520, PAPER = 660;
  let printing = false;  // paper is white whatever the screen is, and as wide as A4 between its margins

  // lines of at most so many letters: a phone has no room for a long axis title
  function broken(text, letters) {
    const lines = [""];
    for (const word of text.split(" ")) {
      const last = lines[lines.length - 1];
      if (last && last.length + 1 + word.length > letters) { lines.push(word); } else { lines[lines.length - 1] = last ? last + " " + word : word; }
    }
    return lines.join("<br>");
  }

  function styled(figure, width) {
    const style = getComputedStyle(document.documentElement), layout = figure.layout, narrow = width < NARROW;
    const ink = printing ? "#000000" : style.getPropertyValue("--ink").trim();
    const grid = printing ? "#d0d0d0" : style.getPropertyValue("--line").trim();
    const out = Object.assign({
      margin: { l: 60, r: 20, t: 10, b: 50 }, font: { color: ink, family: "system-ui, sans-serif" },
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", height: 380,
      legend: { orientation: "h", yanchor: "top", y: -0.22, traceorder: "normal" },
      modebar: { bgcolor: "rgba(0,0,0,0)", color: ink, activecolor: ink }
    }, layout);
    for (const key of Object.keys(out)) {
      if (/^[xy]axis/.test(key)) { out[key] = Object.assign({ gridcolor: grid, zerolinecolor: grid, linecolor: grid }, out[key]); }
    }
    if (printing) { out.width = PAPER; } else { out.width = undefined; out.autosize = true; }
    if (narrow) {
      const named = figure.traces.filter(function (trace) { return trace.name && trace.showlegend !== false; }).length;
      out.legend = { orientation: "h", yanchor: "bottom", y: 1.02, traceorder: "normal" };
      out.height += named > 1 ? 19 * named : 0;
      if (out.xaxis.title) { out.xaxis.title = { text: broken(out.xaxis.title.text, 32) }; }
    }
    return out;
  }

  function draw(id) {
    const figure = data.figures[id], place = document.getElementById(id), width = printing ? PAPER : place.clientWidth;
    place.dataset.narrow = String(width < NARROW);
    const shown = Object.assign({ displayModeBar: width < NARROW ? false : "hover" }, config);
    return Plotly.react(place, figure.traces, styled(figure, width), shown);
  }

  // a figure is drawn when it comes near the window, so that a long page opens at once
  const seen = new Set();
  function show(id) { if (!seen.has(id)) { seen.add(id); draw(id); } }
  const near = new IntersectionObserver(function (entries) {
    for (const entry of entries) { if (entry.isIntersecting) { show(entry.target.id); near.unobserve(entry.target); } }
  }, { rootMargin: "600px" });
  for (const id of Object.keys(data.figures)) { near.observe(document.getElementById(id)); }
  window.addEventListener("beforeprint", function () { printing = true; Object.keys(data.figures).forEach(function (id) { seen.add(id); draw(id); }); });
  window.addEventListener("afterprint", function () { printing = false; seen.forEach(function (id) { draw(id); Plotly.Plots.resize(document.getElementById(id)); }); });
  dark.addEventListener("change", function () { seen.forEach(draw); });
  window.addEventListener("resize", function () {
    for (const id of seen) {
      const place = document.getElementById(id);
      if (place.dataset.narrow !== String(place.clientWidth < NARROW)) { draw(id); }
    }
  });

  // switches: each combination of effects has its prediction, residual map and error in the data
  for (const [section, spec] of Object.entries(data.switches)) {
    const place = document.querySelector('.switches[data-section="' + section + '"]');
    const boxes = spec.effects.map(function (effect, bit) {
      const label = document.createElement("label"), box = document.createElement("input");
      box.type = "checkbox"; box.checked = Boolean(spec.start & (1 << bit)); box.dataset.bit = String(bit);
      label.append(box, document.createTextNode(effect)); place.append(label);
      box.addEventListener("change", update);
      return box;
    });
    const said = document.createElement("output"); said.setAttribute("aria-live", "polite"); place.append(said);
    function update() {
      const state = boxes.reduce(function (sum, box, bit) { return sum + (box.checked ? 1 << bit : 0); }, 0);
      const chosen = spec.states[String(state)];
      said.textContent = chosen.text;
      for (const [id, changes] of Object.entries(chosen.figures)) {
        for (const [trace, values] of Object.entries(changes)) { Object.assign(data.figures[id].traces[Number(trace)], values); }
        data.figures[id].layout.datarevision = state;
        if (seen.has(id)) { draw(id); }
      }
    }
    update();
  }
  document.documentElement.dataset.ready = "true";
})();
