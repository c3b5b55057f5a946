"use strict";
// The page: its controls, its clock, and what it says.
const LONGEST_FRAME = 0.1;  // after a pause of the browser, time does not catch up [s]
const byId = (id) => document.getElementById(id);
const settings = { fluid: fluidOf(PLAY.media[0].viscosity), price: 0, delay: 0, noise: 0, dead: new Array(PLAY.robot.length.length - 1).fill(false) };
const game = { lanes: [], playing: false, owed: 0, last: null, news: false };

// A viscosity within 3 % of a named fluid's is that fluid's. Named fluids have their own density.
function setFluid(chosen) {
  const named = PLAY.media.find((one) => Math.abs(Math.log(one.viscosity / chosen)) < 0.03), viscosity = named?.viscosity ?? chosen;
  settings.fluid = fluidOf(viscosity);
  const text = `${named ? `${named.name}, ` : ""}${Number((viscosity * 1e6).toPrecision(3))} mm²/s`;
  show("viscosity", Math.log10(viscosity), text);
  for (const button of document.querySelectorAll("[data-viscosity]")) button.setAttribute("aria-pressed", Number(button.dataset.viscosity) === viscosity);
  changed();
}

function setSlider(name, value) {
  settings[name] = Number(value);
  const text = {
    price: () => `${PLAY.prices[settings.price].toPrecision(2)} per W`,
    delay: () => `${Math.round(settings.delay / PLAY.rate * 1000)} ms`,
    noise: () => `${settings.noise} ×`,
  }[name]();
  show(name, value, text);
  changed();
}

// A slider's place and its value in words, which screen readers say.
function show(name, value, text) {
  byId(name).value = value;
  byId(name).setAttribute("aria-valuetext", text);
  byId(`${name}-shown`).textContent = text;
}

function kill(joint) {
  settings.dead[joint] = !settings.dead[joint];
  document.querySelectorAll("[data-joint]").forEach((button, j) => button.setAttribute("aria-pressed", settings.dead[j]));
  changed();
}

function changed() {
  for (const lane of game.lanes) lane.changed(settings);
  game.news = true;
  if (!game.playing && game.lanes.length) draw();
}

function play(playing) {
  game.playing = playing;
  game.last = null;
  byId("pause").textContent = playing ? "Pause" : "Play";
  cancelAnimationFrame(game.frame);
  if (playing) game.frame = requestAnimationFrame(frame);
  else say();
}

function restart() {
  for (const lane of game.lanes) lane.restart(settings);
  game.owed = 0;
  changed();
}

function frame(now) {
  if (!game.playing) return;
  const seconds = game.last === null ? 0 : Math.min((now - game.last) / 1000, LONGEST_FRAME);
  game.last = now;
  game.owed += seconds * PLAY.rate;
  const steps = Math.floor(game.owed);
  game.owed -= steps;
  for (const lane of game.lanes) lane.advance(steps, settings);
  draw();
  if (game.news && game.lanes.every((lane) => lane.settled(settings))) say();
  game.frame = requestAnimationFrame(frame);
}

// Pictures first, then texts: a text that changes between two pictures makes the browser lay out the page once more.
function draw() {
  drawCourse();
  for (const lane of game.lanes) lane.draw(settings);
  write(byId("clock"), `${Math.max(...game.lanes.map((lane) => lane.time)).toFixed(1)} s`);
  for (const lane of game.lanes) {
    const now = lane.measured(settings), put = (name, text) => write(lane.box.querySelector(`[data-read=${name}]`), text);
    put("speed", now ? `${now.speed.toFixed(3)} m/s` : "–");
    put("power", now ? `${now.power.toFixed(2)} W` : "–");
    put("positive", now ? `${now.positive.toFixed(2)} W` : "–");
    put("share", now?.share ? `${Math.round(100 * now.share)} %` : now && !now.settled ? "settling" : "–");
    put("distance", lane.controller ? `${lane.distance.toFixed(1).replace(/^-0\.0$/, "0.0")} m` : "–");
    write(lane.box.querySelector(".about"), lane.swimmer.alive ? visible(lane.description) : "The run has diverged: restart.");
  }
}

// Text with an escape for whatever cannot be seen, such as a mark that turns the way of writing, as in errors.py.
function visible(text) {
  return text.replace(/[\p{C}\p{Zl}\p{Zp}]/gu, (letter) => `\\u${letter.codePointAt(0).toString(16).padStart(4, "0")}`);
}

function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

// Both robots on one line, from the start on.
function drawCourse() {
  const [pen, width, height] = clean(byId("course")), ahead = Math.max(...game.lanes.map((lane) => lane.distance));
  const length = [5, 10, 20, 50, 100, 200, 500].find((one) => one > ahead * 1.05) ?? 1000, at = (x) => 24 + Math.max(x, 0) / length * (width - 64);
  pen.font = "11px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.strokeStyle = "#a9bccb";
  pen.fillStyle = "#4d6575";
  pen.beginPath(); pen.moveTo(at(0), height - 18); pen.lineTo(at(length), height - 18); pen.stroke();
  for (let k = 0; k <= 5; k++) pen.fillText(`${k * length / 5} m`, at(k * length / 5), height - 4);
  game.lanes.filter((lane) => lane.controller).forEach((lane) => {
    const x = at(lane.distance), y = lane.name === "A" ? 12 : height - 28;
    pen.fillStyle = lane.name === "A" ? "#0b6e99" : "#9a4d00";
    pen.beginPath(); pen.arc(x, y, 8, 0, 2 * Math.PI); pen.fill();
    pen.fillStyle = "#ffffff";
    pen.fillText(lane.name, x, y + 4);
  });
}

// What screen readers are told: once mean values have settled after a change, and at a pause.
function say() {
  game.news = false;
  byId("status").textContent = game.lanes.map((lane) => {
    const now = lane.measured(settings);
    if (!lane.swimmer.alive) return `Lane ${lane.name} has diverged.`;
    if (!lane.controller || !now) return "";
    const share = now.share ? `, ${Math.round(100 * now.share)} % of the limit` : "";
    return `Lane ${lane.name}, ${lane.select.value}: ${now.speed.toFixed(2)} m/s, ${now.power.toFixed(1)} W${share}.`;
  }).join(" ");
}

function listen() {
  byId("pause").addEventListener("click", () => play(!game.playing));
  byId("restart").addEventListener("click", restart);
  byId("viscosity").addEventListener("input", (event) => setFluid(10 ** Number(event.target.value)));
  for (const name of ["price", "delay", "noise"]) byId(name).addEventListener("input", (event) => setSlider(name, event.target.value));
  for (const button of document.querySelectorAll("[data-viscosity]")) button.addEventListener("click", () => setFluid(Number(button.dataset.viscosity)));
  document.querySelectorAll("[data-joint]").forEach((button, joint) => button.addEventListener("click", () => kill(joint)));
  for (const lane of game.lanes) for (const select of [lane.select, lane.tuned]) select.addEventListener("change", () => { lane.drive(settings); changed(); });
  byId("lanes").addEventListener("keydown", (event) => {
    if (event.target !== byId("lanes") || event.ctrlKey || event.metaKey || event.altKey) return;
    const step = { ArrowLeft: -0.1, ArrowRight: 0.1 }[event.key], joint = Number(event.key) - 1;
    if (event.repeat && !step) return;  // a key held down
    if (event.key === " ") play(!game.playing);
    else if (event.key.toLowerCase() === "r") restart();
    else if (step) setFluid(10 ** Math.max(-7, Math.min(-2, Math.log10(settings.fluid.viscosity) + step)));
    else if (joint in settings.dead) kill(joint);
    else return;
    event.preventDefault();
  });
  window.addEventListener("resize", () => game.playing || draw());
}

async function begin() {
  const networks = {};
  for (const { label, card, numbers } of PLAY.policies) {
    try {
      networks[label] = new Network(card, await numbersOf(numbers));
    } catch (error) {
      for (const option of document.querySelectorAll(`option[value="${label}"]`)) option.remove();
      byId("problem").textContent = "This browser cannot unpack the policies; gaits swim without them.";
    }
  }
  game.lanes = Array.from(document.querySelectorAll(".lane"), (box) => new Lane(box, networks, settings));
  listen();
  setFluid(PLAY.media[0].viscosity);
  for (const name of ["price", "delay", "noise"]) setSlider(name, byId(name).value);
  draw();
  play(!window.matchMedia("(prefers-reduced-motion: reduce)").matches);
}

begin();
