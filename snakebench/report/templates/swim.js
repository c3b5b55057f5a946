"use strict";
for (const box of document.querySelectorAll(".swim")) {
  const runs = runsOf(box);
  const water = box.querySelector(".water"), torques = box.querySelector(".torques");
  const select = box.querySelector("select"), dial = box.querySelector(".dial"), position = box.querySelector(".position");
  const positions = position ? JSON.parse(position.dataset.positions) : [""];
  for (const run of runs) {
    run.strongest = 1e-9;
    for (const torques of run.torque) for (const torque of torques) run.strongest = Math.max(run.strongest, Math.abs(torque));
  }
  let run = runs[0];

  const duration = () => (run.head.length - 1) / run.rate;

  function drawWater(frame) {
    const [pen, width, height] = clean(water), scale = width / 2.6, [cx, cy] = run.center[frame];
    const place = ([x, y]) => [width / 2 + (x - cx) * scale, height / 2 - (y - cy) * scale];
    drawGrid(pen, width, height, cx, cy, scale);
    drawBody(pen, bodyOf(run, frame).map(place), run.diameter * scale, run.torque[frame], run.strongest);
  }

  function drawTorques(frame) {
    const [pen, width, height] = clean(torques), span = 4 * run.rate;
    const first = Math.max(0, Math.min(frame - span / 2, run.head.length - 1 - span));
    const final = Math.min(first + span, run.head.length - 1);
    const strongest = run.strongest * 1.1;
    const at = (k, torque) => [34 + (k - first) / span * (width - 40), height / 2 - torque / strongest * (height / 2 - 6)];
    pen.strokeStyle = "#dde3ea";
    pen.fillStyle = "#5b6875";
    pen.font = "11px system-ui, sans-serif";
    for (const level of [-1, 0, 1]) {
      const torque = level * strongest / 1.1, [x, y] = at(first, torque);
      pen.beginPath(); pen.moveTo(x, y); pen.lineTo(width, y); pen.stroke();
      pen.fillText(torque.toFixed(1), 2, y + 4);
    }
    for (let joint = 0; joint < run.joints[0].length; joint++) {
      pen.strokeStyle = hueOf(joint, run.joints[0].length);
      pen.lineWidth = 1.3;
      pen.beginPath();
      for (let k = Math.ceil(first); k <= final; k++) pen.lineTo(...at(k, run.torque[k][joint]));
      pen.stroke();
    }
    const [x] = at(frame, 0);
    pen.strokeStyle = "#c2410c";
    pen.beginPath(); pen.moveTo(x, 0); pen.lineTo(x, height); pen.stroke();
  }

  const player = playback(box, duration, (time) => {
    const frame = Math.min(Math.round(time * run.rate), run.head.length - 1);
    drawWater(frame);
    drawTorques(frame);
  });

  // Of each run in the list there is one for every position of the dial, side by side.
  function choose() {
    const turned = dial ? Number(dial.value) : 0;
    run = runs[select.selectedIndex * positions.length + turned];
    if (position) position.textContent = positions[turned];
    player.again();
  }

  select.addEventListener("change", choose);
  dial?.addEventListener("input", choose);
  player.go(20);
}
