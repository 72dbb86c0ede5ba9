// Robots along a recording: play, or drag the time; each robot can be hidden.
function drawMoving(figure) {
  const data = JSON.parse(figure.dataset.moving), canvas = figure.querySelector("canvas");
  const [play, time] = [figure.querySelector(".play"), figure.querySelector("input")];
  const buttons = [...figure.querySelectorAll("[data-robot]")], said = figure.querySelector("output");
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  let started = null;
  const draw = () => {
    const k = Number(time.value), box = canvas.getContext("2d"), dense = window.devicePixelRatio || 1;
    [canvas.width, canvas.height] = [data.size[0] * dense, data.size[1] * dense];
    box.scale(dense, dense);
    box.lineCap = box.lineJoin = "round";
    buttons.forEach((button, r) => {
      if (button.getAttribute("aria-pressed") !== "true") return;
      const points = data.robots[r][k];
      if (!points) return;
      box.strokeStyle = box.fillStyle = colour(`--${data.tones[r]}`);
      box.lineWidth = r ? 2 : 8;
      box.globalAlpha = r ? 1 : 0.35;
      for (const [a, b] of data.lines) {
        box.beginPath();
        box.moveTo(points[2 * a], points[2 * a + 1]);
        box.lineTo(points[2 * b], points[2 * b + 1]);
        box.stroke();
      }
      for (let a = 0; a < data.joints; a++) {
        box.beginPath();
        box.arc(points[2 * a], points[2 * a + 1], r ? 3 : 5, 0, 2 * Math.PI);
        box.fill();
      }
    });
    said.textContent = [`${data.t[k].toFixed(2)} s`, ...data.errors.map((e) => e[k])].join(" \u00b7 ");
  };
  const step = (now) => {
    if (started === null) return;
    const [first, last] = [data.t[0], data.t.at(-1)];
    const t = first + ((now - started) / 1000) % Math.max(last - first, 1e-3);
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
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
}
for (const figure of document.querySelectorAll("[data-moving]")) drawMoving(figure);
