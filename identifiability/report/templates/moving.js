// Robots along a recording: play, or drag the time; each robot can be hidden.
function drawMoving(figure) {
  const data = JSON.parse(figure.dataset.moving), now = figure.querySelector(".now");
  const [play, time] = [figure.querySelector(".play"), figure.querySelector("input")];
  const buttons = [...figure.querySelectorAll("[data-robot]")], said = figure.querySelector("output");
  const robots = [...figure.querySelectorAll(".robots > g")];
  let started = null;
  const outline = (p) => data.lines.map(([a, b]) =>
    `M${p[2 * a]} ${p[2 * a + 1]}L${p[2 * b]} ${p[2 * b + 1]}`).join("");
  // Where the first robot was along the motion, faint behind it: a still says how it moved.
  const trail = () => {
    const known = data.robots[0].filter(Boolean), every = Math.max(1, Math.round(known.length / 9));
    const path = document.createElementNS("http://www.w3.org/2000/svg", "path");
    path.setAttribute("class", "trail");
    path.setAttribute("d", known.filter((p, k) => k % every === 0).map(outline).join(""));
    figure.querySelector(".robots").prepend(path);
  };
  const draw = () => {
    const k = Number(time.value);
    robots.forEach((group, r) => {
      const p = data.robots[r][k], hidden = buttons[r]?.getAttribute("aria-pressed") === "false";
      group.style.display = p && !hidden ? "" : "none";
      if (!p) return;
      group.querySelector("path").setAttribute("d", outline(p));
      group.querySelectorAll(".joint").forEach((dot, a) => {
        dot.setAttribute("transform", `translate(${p[2 * a]} ${p[2 * a + 1]})`);
        const missed = dot.querySelector(".missed");
        if (missed) missed.setAttribute("r", 24 * Math.sqrt(data.misses[k][a]));
      });
    });
    const share = (data.t[k] - data.t[0]) / (data.t.at(-1) - data.t[0]);
    now?.setAttribute("transform", `translate(${400 * share} 0)`);
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
  trail();
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
