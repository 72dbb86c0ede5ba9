// Lines over time: drag to zoom, double click for all, the cursor reads values off.
function drawTraces(figure) {
  const box = figure.querySelector(".trace-box"), reset = figure.querySelector(".reset");
  const buttons = [...figure.querySelectorAll("[data-trace]")];
  // On a phone a list takes the place of many buttons.
  const list = document.createElement("select");
  list.setAttribute("aria-label", "Which joint is shown");
  list.append(...buttons.map((button) => new Option(button.textContent)));
  list.onchange = () => buttons[list.selectedIndex].click();
  if (buttons.length > 6) buttons[0].before(list);
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  let plot = null;
  const show = (button) => {
    for (const other of buttons) other.setAttribute("aria-pressed", String(other === button));
    list.selectedIndex = buttons.indexOf(button);
    const data = JSON.parse(button.dataset.trace);
    for (const note of figure.querySelectorAll(".gaps")) note.hidden = !data.rows[1].includes(null);
    if (plot) plot.destroy();
    const [ink, line] = [colour("--muted"), colour("--line")];
    const strokes = [colour("--muted"), colour("--blue"), colour("--purple"), colour("--sky"), colour("--green")];
    const named = { residual: "--vermilion", command: "--ink", "fitted model": "--purple" };
    const paint = (name, k) => (named[name] ? colour(named[name]) : strokes[k]);
    const ticked = (u, ticks) => ticks.map((x) => Number(x.toPrecision(7)).toString().replace("-", "\u2212"));
    const axis = { values: ticked, stroke: ink, grid: { stroke: line, width: 1 }, ticks: { stroke: line, width: 1 } };
    // What was measured, or was before, lies wide and pale below what follows it.
    const faint = (k) => k === 0 && ["measured", "before"].includes(data.names[0]) && data.names.length > 1;
    const limit = (name) => name.endsWith(" allowed") || name.startsWith("95 %");
    const edges = data.names.flatMap((name, k) => (limit(name) ? [k + 1] : []));
    const digits = (u, x) => (x == null ? "" : Number(x.toPrecision(4)).toString());
    // The lower end of a band reads both ends off; the upper end has no entry of its own.
    const ends = (u, x, s, at) => (at == null ? "" : edges.map((k) => digits(u, u.data[k][at])).join(" \u2026 "));
    const low = data.names[edges[0] - 1], both = edges.length === 2;
    const shared = both && (low.startsWith("95 %") ? "95 % interval" : "allowed");
    // The numbers of a narrow plot have its width; what they are stands above.
    const narrow = box.clientWidth < 480;
    plot = new uPlot({
      title: narrow ? `${data.axis} over ${data.x}` : "",
      width: box.clientWidth - 20, height: Math.max(200, Math.min(420, box.clientWidth * 0.36)),
      scales: { x: { time: false } },
      cursor: { drag: { x: true, y: false } },
      legend: { live: true, markers: { dash: (u, k) => (u.series[k].dash.length ? "dashed" : "solid") } },
      axes: narrow ? [{ ...axis, size: 32 }, { ...axis, size: 54 }] : [{ ...axis, label: data.x }, { ...axis, label: data.axis, size: 64 }],
      series: [{ label: data.x, value: digits }, ...data.names.map((name, k) => ({
        label: limit(name) && both ? shared : name, class: both && limit(name) ? (k + 1 === edges[1] ? "upper" : "band") : undefined, stroke: limit(name) ? colour("--blue") : faint(k) ? `color-mix(in srgb, ${paint(name, k)} 50%, transparent)` : paint(name, k), width: name.startsWith("95 %") ? 0.4 : faint(k) ? 7 : k ? 1.4 : 2.6,
        value: limit(name) && both ? ends : digits, dash: name.endsWith(" allowed") || name === "command" ? [6, 4] : [],
        points: { show: false },
      }))],
      bands: edges.length === 2
        ? [{ series: [...edges].reverse(), fill: `color-mix(in srgb, ${colour("--blue")} 14%, transparent)` }] : [],
      hooks: {
        drawClear: [(u) => {  // where the first line breaks
          const [x, y] = data.rows;
          u.ctx.fillStyle = line;
          for (const k of x.keys()) {
            if (y[k] !== null || !x[k - 1] || !x[k + 1]) continue;
            const [start, end] = [x[k - 1], x[k + 1]].map((t) => u.valToPos(t, "x", true));
            u.ctx.fillRect(start, u.bbox.top, end - start, u.bbox.height);
          }
        }],
        setScale: [(u, key) => {
          const all = data.rows[0], { min, max } = u.scales.x;
          if (key === "x") reset.hidden = !(min > all[0] || max < all[all.length - 1]);
        }],
      },
    }, data.rows, box);
    // Of a long log the first part is shown, in which single swings can be seen.
    const [times] = data.rows, few = box.clientWidth / 2;
    if (times.length > 8 * few) plot.setScale("x", { min: times[0], max: times[Math.round(few)] });
    reset.onclick = () => plot.setScale("x", { min: data.rows[0][0], max: data.rows[0].at(-1) });
  };
  for (const button of buttons) button.addEventListener("click", () => {
    show(button);
    // Plots of one section show the same joint.
    for (const twin of button.closest("section").querySelectorAll("[data-trace][aria-pressed=false]")) {
      if (twin.textContent === button.textContent && twin.closest("figure").checkVisibility()) twin.click();
    }
  });
  const again = () => show(buttons.find((b) => b.getAttribute("aria-pressed") === "true"));
  let width = 0;  // none while it is hidden
  new ResizeObserver(() => {
    if (box.clientWidth === width) return;
    width = box.clientWidth;
    again();
  }).observe(box);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
}
for (const figure of document.querySelectorAll(".traces")) {
  // A plot below another one of the same joints has no buttons of its own.
  const before = figure.previousElementSibling;
  const [chips, above] = [figure, before].map((one) => [...(one?.querySelectorAll("[data-trace]") ?? [])]);
  if (chips.map((chip) => chip.textContent).join() === above.map((chip) => chip.textContent).join()) {
    figure.classList.add("follows");
    for (const [k, chip] of chips.entries()) chip.setAttribute("aria-pressed", above[k].getAttribute("aria-pressed"));
  }
  drawTraces(figure);
}
