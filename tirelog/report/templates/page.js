"use strict";
(function () {
  const data = JSON.parse(document.getElementById("data").textContent);
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const config = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["lasso2d", "select2d"] };

  const NARROW = 520, SLIM = 640, PAPER = 660;
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
    if (width < SLIM) {
      const named = figure.traces.filter(function (trace) { return trace.name && trace.showlegend !== false; }).length;
      out.legend = { orientation: "h", yanchor: "bottom", y: 1.02, traceorder: "normal" };
      out.height += named > 1 ? 19 * named : 0;
    }
    if (narrow) {
      if (out.xaxis.title) { out.xaxis.title = { text: broken(out.xaxis.title.text, 32) }; }
    }
    return out;
  }

  // on dark paper each colour of the traces is the light one of the same number
  function recoloured(value) {
    if (typeof value === "string") {
      return value[0] === "#" && data.dark[value.slice(0, 7)] ? data.dark[value.slice(0, 7)] + value.slice(7) : value;
    }
    if (Array.isArray(value)) { return value.map(recoloured); }
    if (value && typeof value === "object" && !value.bdata) {
      return Object.fromEntries(Object.entries(value).map(function (pair) { return [pair[0], recoloured(pair[1])]; }));
    }
    return value;
  }

  // the first drawing of a figure is its picture to a reader of screens; the rest belongs to it
  function name(place, title) {
    place.querySelectorAll("svg").forEach(function (svg) {
      if (svg.parentElement.closest("svg")) { return; }
      if (svg.matches(".main-svg") && !place.querySelector('.main-svg[role="img"]')) {
        svg.setAttribute("role", "img"); svg.setAttribute("aria-label", title); svg.removeAttribute("aria-hidden");
      } else if (svg.getAttribute("role") !== "img") { svg.setAttribute("aria-hidden", "true"); }
    });
  }

  // what of a figure's form its width decides
  function form(width) { return String(width < NARROW) + String(width < SLIM); }

  function draw(id) {
    const figure = data.figures[id], place = document.getElementById(id), width = printing ? PAPER : place.clientWidth;
    place.dataset.form = form(width);
    const shown = Object.assign({ displayModeBar: width < NARROW ? false : "hover" }, config);
    const traces = dark.matches && !printing ? recoloured(figure.traces) : figure.traces;
    return Plotly.react(place, traces, styled(figure, width), shown).then(function () { name(place, figure.title); });
  }

  // a figure is drawn when it comes near the window, so that a long page opens at once
  const seen = new Set();
  function show(id) { if (!seen.has(id)) { seen.add(id); draw(id); } }
  const near = new IntersectionObserver(function (entries) {
    for (const entry of entries) { if (entry.isIntersecting) { show(entry.target.id); near.unobserve(entry.target); } }
  }, { rootMargin: "600px" });
  for (const id of Object.keys(data.figures)) { near.observe(document.getElementById(id)); }
  // paper has nothing to unfold
  let unfolded = [];
  window.addEventListener("beforeprint", function () {
    printing = true;
    unfolded = Array.from(document.querySelectorAll("details:not([open])"));
    unfolded.forEach(function (fold) { fold.open = true; });
    Object.keys(data.figures).forEach(function (id) { seen.add(id); draw(id); });
  });
  window.addEventListener("afterprint", function () {
    printing = false;
    unfolded.forEach(function (fold) { fold.open = false; });
    seen.forEach(fitted);
  });

  // a figure in a fold has no width until that is open, and may have another one than it was drawn with
  function fitted(id) {
    const place = document.getElementById(id);
    if (place.clientWidth) { draw(id).then(function () { Plotly.Plots.resize(place); }); }
  }
  document.querySelectorAll("details").forEach(function (fold) {
    fold.addEventListener("toggle", function () {
      if (fold.open && !printing) { fold.querySelectorAll(".plot").forEach(function (place) { if (seen.has(place.id)) { fitted(place.id); } }); }
    });
  });

  // a link of the contents opens what it leads to
  function unfold() {
    const target = location.hash.length > 1 && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    const fold = target && target.querySelector(":scope > details");
    if (fold) { fold.open = true; }
  }
  window.addEventListener("hashchange", unfold);
  unfold();
  dark.addEventListener("change", function () { seen.forEach(draw); });
  window.addEventListener("resize", function () {
    for (const id of seen) {
      const place = document.getElementById(id);
      if (place.clientWidth && place.dataset.form !== form(place.clientWidth)) { draw(id); }
    }
  });

  document.documentElement.dataset.ready = "true";
})();
