"use strict";
// The runs of a box, with rows of numbers as report/animation.py packs them: how many a row has, steps to a unit, and text.
function runsOf(box) {
  const runs = JSON.parse(box.querySelector("script").textContent);
  for (const run of runs) for (const name of ["head", "joints", "torque", "center"]) if (run[name]) run[name] = rowsOf(...run[name]);
  return runs;
}

// Second differences, five bits a letter, the lowest first: of a number the lowest bit is its sign.
function rowsOf(width, steps, text) {
  const letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
  const rows = [], last = Array(width).fill(0), change = Array(width).fill(0);
  let code = 0, weight = 1, column = 0;
  for (const letter of text) {
    const bits = letters.indexOf(letter);
    code += bits % 32 * weight;
    weight *= 32;
    if (bits >= 32) continue;
    change[column] += code % 2 ? -(code + 1) / 2 : code / 2;
    last[column] += change[column];
    if (++column === width) {
      rows.push(last.map((whole) => whole / steps));
      column = 0;
    }
    code = 0;
    weight = 1;
  }
  return rows;
}

// Link ends of a frame of a run, head first.
function bodyOf(run, frame) {
  let [x, y, angle] = run.head[frame];
  const points = [[x + run.lengths[0] / 2 * Math.cos(angle), y + run.lengths[0] / 2 * Math.sin(angle)]];
  run.lengths.forEach((length, link) => {
    if (link > 0) angle += run.joints[frame][link - 1];
    const [px, py] = points[link];
    points.push([px - length * Math.cos(angle), py - length * Math.sin(angle)]);
  });
  return points;
}

// The links of a body with ends at `points`, and its joints: red and blue for torque, from white at 0 to `strongest`.
function drawBody(pen, points, width, torques, strongest, dead = []) {
  pen.lineCap = "round";
  pen.lineWidth = width;
  for (let link = points.length - 2; link >= 0; link--) {
    pen.strokeStyle = link === 0 ? "#12384d" : "#3f7f9f";
    pen.beginPath(); pen.moveTo(...points[link]); pen.lineTo(...points[link + 1]); pen.stroke();
  }
  torques.forEach((torque, joint) => {
    const light = 97 - 45 * Math.min(Math.abs(torque) / strongest, 1);
    pen.fillStyle = dead[joint] ? "#1d2733" : `hsl(${torque > 0 ? 8 : 215} 85% ${light}%)`;
    pen.beginPath(); pen.arc(...points[joint + 1], width * 0.3, 0, 2 * Math.PI); pen.fill();
  });
}

// The colour of a joint's line.
function hueOf(joint, count) {
  return `hsl(${205 - 8 * joint} 70% ${25 + 45 * joint / count}%)`;
}

// A canvas's pen and size in CSS pixels, cleared, sharp on any screen.
function clean(canvas) {
  const ratio = window.devicePixelRatio || 1, { width, height } = canvas.getBoundingClientRect();
  const pen = canvas.getContext("2d"), size = [width, height].map((length) => Math.round(length * ratio));
  if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;  // slow: not every frame
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.lineWidth = 1;
  pen.lineCap = "butt";
  return [pen, width, height];
}

// The button, slider and clock of a box, which draws what is at a time [s]; returns how to go to a time.
function playback(box, duration, draw) {
  const button = box.querySelector("button"), slider = box.querySelector(".time"), clock = box.querySelector(".clock");
  let time = 0, playing = false, last = null, frame;

  function go(to) {
    time = Math.min(to, duration());
    draw(time);
    slider.max = duration();
    slider.value = time;
    clock.textContent = `${time.toFixed(1)} s`;
  }

  function tick(now) {
    if (!playing) return;
    const next = time + (last === null ? 0 : Math.min(now - last, 100) / 1000);  // a hidden tab does not run on
    last = now;
    go(next > duration() ? 0 : next);
    frame = requestAnimationFrame(tick);
  }

  button.addEventListener("click", () => {
    playing = !playing;
    last = null;
    button.textContent = playing ? "Pause" : "Play";
    cancelAnimationFrame(frame);
    if (playing) frame = requestAnimationFrame(tick);
  });
  slider.addEventListener("input", () => go(Number(slider.value)));
  window.addEventListener("resize", () => go(time));
  return { go, again: () => go(time) };
}

// Lines every half metre, at rest in the fluid.
function drawGrid(pen, width, height, cx, cy, scale) {
  const left = cx - width / scale / 2, low = cy - height / scale / 2;
  pen.lineWidth = 1;
  pen.strokeStyle = "#cfe0ea";
  pen.fillStyle = "#4d6575";
  pen.font = "11px system-ui, sans-serif";
  for (let x = Math.ceil(left * 2) / 2; x < left + width / scale; x += 0.5) {
    const px = (x - left) * scale;
    pen.beginPath(); pen.moveTo(px, 0); pen.lineTo(px, height); pen.stroke();
    if (x % 1 === 0) pen.fillText(`${x} m`, px + 3, height - 5);
  }
  for (let y = Math.ceil(low * 2) / 2; y < low + height / scale; y += 0.5) {
    const py = height - (y - low) * scale;
    pen.beginPath(); pen.moveTo(0, py); pen.lineTo(width, py); pen.stroke();
  }
}
