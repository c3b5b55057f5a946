"use strict";
// A lane: one robot, what drives it, what it has done, and its pictures.
const MOMENTS = PLAY.rate / PLAY.every, KEPT = 14, TRACE = 4;  // moments remembered a second; for so long, and drawn [s]
const MEAN = 5, SETTLING = 2;  // mean values are of so long at least; after a change they settle for a while [s]

class Lane {
  constructor(box, networks, settings) {
    this.box = box;
    this.networks = networks;
    this.name = box.dataset.lane;
    [this.water, this.torques] = box.querySelectorAll("canvas");
    [this.select, this.tuned] = box.querySelectorAll("select");
    this.restart(settings);
  }

  restart(settings) {
    this.swimmer = new Swimmer(PLAY.robot);
    this.moments = [];
    this.drive(settings);
  }

  // Puts the chosen controller in charge of the robot, wherever it is.
  drive(settings) {
    const name = this.select.value, family = PLAY.families.find((one) => one.label === name);
    this.controller = family ? new GaitRun(family) : name in this.networks ? new PolicyRun(this.networks[name], this.swimmer) : null;
    this.swimmer.chain.servo = this.controller?.drives !== "torque";
    this.swimmer.relax(this.swimmer.command);  // until the controller commands
    this.tuned.parentElement.hidden = !family;
    this.changed(settings);
  }

  // The settings are others: mean values are measured anew from now on.
  changed(settings) {
    this.since = this.time;
    if (this.controller instanceof GaitRun) this.controller.attend(this.swimmer, settings, this.tuned.value);
  }

  get time() { return this.swimmer.steps / PLAY.rate; }

  get distance() { return this.moments.length ? this.swimmer.place[0] - this.start : 0; }

  advance(steps, settings) {
    const swimmer = this.swimmer;
    for (let k = 0; k < steps && this.controller && swimmer.alive; k++) {
      swimmer.dead = settings.dead;
      this.controller.attend(swimmer, settings, this.tuned.value);
      if (swimmer.steps % PLAY.every === 0) this.remember();
      swimmer.step(settings.fluid, (time, command) => this.controller.ask(time, command));
    }
  }

  remember() {
    if (this.swimmer.steps === 0) this.start = this.swimmer.place[0];
    const torques = this.swimmer.joints.map(({ torque }) => torque);
    this.moments.push({ x: this.swimmer.place[0], work: this.swimmer.energy[0], positive: this.swimmer.energy[1], torques });
    if (this.moments.length > KEPT * MOMENTS) this.moments.shift();
  }

  // Mean speed [m/s] and powers [W] of the last whole periods, and the share of the limit once they have settled.
  measured(settings) {
    const period = this.controller?.period, span = Math.min(period ? Math.ceil(MEAN / period) * period : MEAN, KEPT - 1);
    const rows = Math.round(Math.min(span, this.time - this.since) * MOMENTS), last = this.moments.at(-1);
    const first = this.moments.at(-1 - rows);
    if (rows < MOMENTS || !first) return null;
    const seconds = rows / MOMENTS, speed = (last.x - first.x) / seconds;
    const power = (last.work - first.work) / seconds, positive = (last.positive - first.positive) / seconds;
    const settled = this.time - this.since >= span + SETTLING;
    const limit = settled ? limitAt(settings.fluid.viscosity, power) : null;
    return { speed, power, positive, settled, share: limit && speed / limit };
  }

  // Whether nothing more is to come of the last change.
  settled(settings) { return !this.controller || !this.swimmer.alive || Boolean(this.measured(settings)?.settled); }

  // One line: what drives the robot.
  get description() {
    if (!this.controller) return "No robot in this lane.";
    const { medium, gait, speed, power } = this.controller.now ?? {};
    if (!medium) return PLAY.policies.find(({ label }) => label === this.select.value)?.about ?? "";
    const rhythm = `${(1 / periodOf(gait)).toFixed(2)} Hz`;
    return `Gait of ${medium.name}, ${rhythm}: ${speed.toFixed(3)} m/s at P = ${power.toFixed(2)} W there.`;
  }

  draw(settings) {
    this.drawWater(settings.dead);
    this.drawTorques();
  }

  drawWater(dead) {
    const [pen, width, height] = clean(this.water), scale = height / 1.15, { place, chain } = this.swimmer;
    if (!this.controller) return;
    const cx = place[0] + 0.15 * width / scale * (width > 2.2 * height ? 1 : 0), cy = place[1];
    const at = ([x, y]) => [width / 2 + (x - cx) * scale, height / 2 - (y - cy) * scale];
    drawGrid(pen, width, height, cx, cy, scale);
    const { x, y, heading } = this.swimmer.head, angles = this.swimmer.joints.map(({ angle }) => angle);
    const points = bodyOf({ lengths: chain.length, head: [[x, y, heading]], joints: [angles] }, 0).map(at);
    const torques = this.moments.at(-1)?.torques ?? [], thick = chain.diameter * scale;
    drawBody(pen, points, thick, torques, this.strongest, dead);
    torques.forEach((_, joint) => dead[joint] && drawCross(pen, ...points[joint + 1], thick * 0.18));
  }

  drawTorques() {
    const [pen, width, height] = clean(this.torques), count = TRACE * MOMENTS, shown = this.moments.slice(-count - 1);
    const strongest = this.strongest, left = 38;
    const at = (k, torque) => [left + (k + count + 1 - shown.length) / count * (width - left - 2), height / 2 - torque / strongest * (height / 2 - 8)];
    pen.font = "11px system-ui, sans-serif";
    pen.fillStyle = "#5b6875";
    pen.strokeStyle = "#c9d3dd";
    for (const level of [-strongest, 0, strongest]) {
      const y = at(0, level)[1];
      pen.beginPath(); pen.moveTo(left, y); pen.lineTo(width, y); pen.stroke();
      pen.fillText(String(level), 4, y + 4);
    }
    pen.lineWidth = 1.3;
    for (let joint = 0; joint < this.swimmer.command.length; joint++) {
      pen.strokeStyle = hueOf(joint, this.swimmer.command.length);
      pen.beginPath();
      shown.forEach(({ torques }, k) => pen.lineTo(...at(k, torques[joint])));
      pen.stroke();
    }
  }

  // The torque at the edge of the pictures [N m]: a round number above all that is remembered.
  get strongest() {
    let most = 0;
    for (const { torques } of this.moments.slice(-TRACE * MOMENTS)) for (const torque of torques) most = Math.max(most, Math.abs(torque));
    return [1, 2, 5, 10, 20, 50, 100].find((level) => level >= most) ?? 200;
  }
}

// The limit of the body in a fluid at a mean power, from the table that sb.limit gave; null where it is not known.
function limitAt(viscosity, power) {
  const { viscosities, powers, speeds } = PLAY.limits;
  const corner = (axis, value) => {  // the point of the axis before it, and how far it is to the next
    const after = axis.findIndex((one, k) => k && one >= value);
    return after < 0 || !(value >= axis[0]) ? null : [after - 1, (value - axis[after - 1]) / (axis[after] - axis[after - 1])];
  };
  const v = corner(viscosities, Math.log10(viscosity)), p = corner(powers, Math.log10(power));
  if (!v || !p) return null;
  let speed = 0;
  for (const i of [0, 1]) for (const j of [0, 1]) {
    const weight = (i ? v[1] : 1 - v[1]) * (j ? p[1] : 1 - p[1]), known = speeds[v[0] + i][p[0] + j];
    if (weight < 1e-6) continue;
    if (known === null) return null;
    speed += weight * known;
  }
  return speed;
}

function drawCross(pen, x, y, radius) {
  pen.strokeStyle = "#ffffff";
  pen.lineWidth = 2;
  pen.beginPath();
  pen.moveTo(x - radius, y - radius); pen.lineTo(x + radius, y + radius);
  pen.moveTo(x - radius, y + radius); pen.lineTo(x + radius, y - radius);
  pen.stroke();
}
