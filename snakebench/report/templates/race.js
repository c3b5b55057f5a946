"use strict";
for (const box of document.querySelectorAll(".race")) {
  const runs = runsOf(box);
  const lanes = [...box.querySelectorAll("canvas")], told = [...box.querySelectorAll("p output")];
  const duration = Math.max(...runs.map((run) => (run.head.length - 1) / run.rate));
  const length = runs[0].lengths.reduce((sum, one) => sum + one, 0);
  const farthest = Math.max(...runs.map((run) => Math.max(...run.head.map((head) => head[0])))) + 0.4;

  function drawLane(canvas, run, frame) {
    const [pen, width, height] = clean(canvas), scale = width / (farthest + length + 0.2);
    const points = bodyOf(run, frame), middle = points.reduce((sum, point) => sum + point[1], 0) / points.length;
    const place = ([x, y]) => [(x + length + 0.1) * scale, height / 2 - (y - middle) * scale];  // a lane follows its robot
    pen.strokeStyle = "#cfe0ea";
    pen.lineWidth = 1;
    for (let x = 0; x < farthest; x += 1) {
      const [px] = place([x, 0]);
      pen.beginPath(); pen.moveTo(px, 0); pen.lineTo(px, height); pen.stroke();
    }
    pen.lineCap = pen.lineJoin = "round";
    pen.lineWidth = Math.max(run.diameter * scale, 3);
    pen.strokeStyle = run.label === "student" ? "#2a9d57" : "#6b7680";
    pen.beginPath();
    for (const point of points) pen.lineTo(...place(point));
    pen.stroke();
  }

  playback(box, () => duration, (time) => runs.forEach((run, k) => {
    const frame = Math.min(Math.round(time * run.rate), run.head.length - 1);
    drawLane(lanes[k], run, frame);
    told[k].textContent = `${(run.head[frame][0] - run.head[0][0]).toFixed(1)} m`;
  })).go(duration);
}
