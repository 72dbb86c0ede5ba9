// Robots along a recording: play, or drag the time; each robot can be hidden.
function drawMoving(figure) {
  const data = JSON.parse(figure.dataset.moving), now = figure.querySelectorAll(".now");
  const [play, time] = [figure.querySelector(".play"), figure.querySelector("input")];
  const buttons = [...figure.querySelectorAll("[data-robot]")], said = figure.querySelector("output");
  const robots = [...figure.querySelectorAll(".robots > g")];
  robots.unshift(robots.pop());  // the first one is drawn last
  let started = null;
  const place = (p, k) => `${p[3 * k]} ${p[3 * k + 1]}`;
  // Bodies, the far ones first, so that near ones hide them.
  const solid = (p) => data.shapes.map(([points, kind, width, ahead]) => {
    const style = `d="M${points.map((k) => place(p, k)).join("L")}" style="--wide: ${width}px"`;
    const depth = points.reduce((sum, k) => sum + p[3 * k + 2], 0) / points.length;
    return [depth - ahead, `<path class="edge ${kind}" ${style}/><path class="${kind}" ${style}/>`];
  }).sort((a, b) => b[0] - a[0]).map(([, text]) => text).join("");
  // The path of the ends of the first robot: a still shows how it moved.
  const known = data.robots[0].filter(Boolean);
  figure.querySelector(".trail").setAttribute("d", data.tips.map((k) =>
    `M${known.map((p) => place(p, k)).join("L")}`).join(""));
  const draw = () => {
    const k = Number(time.value);
    robots.forEach((group, r) => {
      const p = data.robots[r][k], hidden = buttons[r]?.getAttribute("aria-pressed") === "false";
      group.style.display = p && !hidden ? "" : "none";
      if (!p) return;
      group.querySelector(".bodies").innerHTML = solid(p);
      group.querySelectorAll("g.joint").forEach((dot, a) => {
        dot.setAttribute("transform", `translate(${p[3 * a]} ${p[3 * a + 1]})`);
        dot.querySelector(".missed").setAttribute("r", 14 * Math.sqrt(Math.min(data.misses[k][a], 1)));
      });
    });
    const share = (data.t[k] - data.t[0]) / (data.t.at(-1) - data.t[0]);
    for (const line of now) line.setAttribute("transform", `translate(${400 * share} 0)`);
    said.textContent = [`${data.t[k].toFixed(2)} s`, ...data.told.map((e) => e[k])].join(" \u00b7 ");
  };
  const step = (clock) => {
    if (started === null) return;
    const [first, last] = [data.t[0], data.t.at(-1)];
    const t = first + ((clock - started) / 1000) % Math.max(last - first, 1e-3);
    time.value = data.t.findLastIndex((x) => x <= t);
    draw();
    requestAnimationFrame(step);
  };
  const stop = () => { started = null; play.textContent = "Play"; };
  play.addEventListener("click", () => {
    if (started !== null) return stop();
    started = performance.now() - 1000 * (data.t[Number(time.value)] - data.t[0]);
    play.textContent = "Stop";
    return requestAnimationFrame(step);
  });
  time.addEventListener("input", () => { stop(); draw(); });
  for (const button of buttons) button.addEventListener("click", () => {
    button.setAttribute("aria-pressed", String(button.getAttribute("aria-pressed") !== "true"));
    draw();
  });
  draw();
  // It plays once it is seen, unless the reader asked for stillness.
  if (matchMedia("(prefers-reduced-motion: reduce)").matches || !window.IntersectionObserver) return;
  const seen = new IntersectionObserver(([entry]) => {
    if (!entry.isIntersecting) return;
    seen.disconnect();
    play.click();
  }, { threshold: 0.6 });
  seen.observe(figure.querySelector(".robots"));
}
for (const figure of document.querySelectorAll("[data-moving]")) drawMoving(figure);
