"use strict";
// One robot and its steps of time, as in physics/stepping.py: order four (Runge-Kutta) under torques, the implicit
// midpoint rule under target angles. It begins at rest, straight, heading +x, its head's tip at the origin.
const SWING = 0.4, HALVINGS = 6;  // parts of a step that targets which jump ask for
const V_MAX = 3.0, JOINT_RATE_MAX = 100.0;  // beyond these a run has diverged [m/s, rad/s]

class Swimmer {
  constructor(robot, drives = "angle") {
    const n = robot.length.length;
    this.chain = { ...robot, servo: drives === "angle" };
    [this.place, this.rate, this.midPlace, this.midRate, this.placeGain, this.rateGain] = Array.from({ length: 6 }, () => new Float64Array(n + 2));
    this.command = new Float64Array(n - 1);
    this.dead = new Array(n - 1).fill(false);  // servos that exert no torque
    this.limp = new Float64Array(n - 1);
    this.scratch = scratchOf(n);
    this.energy = [0, 0];  // command work since the start, and its positive part [J]
    this.steps = this.halvings = 0;
    this.alive = true;
    let behind = 0;
    const total = robot.mass.reduce((sum, mass) => sum + mass, 0);
    robot.length.forEach((length, i) => {
      this.place[0] -= robot.mass[i] * (behind + length / 2) / total;
      behind += length;
    });
  }

  // Make a step; `ask` writes the command of every joint at a time [s] since the start.
  step(fluid, ask) {
    this.relax(this.limp);
    this.ask = (time) => {
      ask(time, this.command);
      this.dead.forEach((dead, j) => { if (dead) this.command[j] = this.limp[j]; });
    };
    if (this.chain.servo) this.midpoint(fluid);
    else this.rungeKutta(fluid);
    this.steps++;
    this.alive = this.alive && this.withinBounds();
  }

  // The commands at which servos exert no torque, written into `command`.
  relax(command) {
    this.joints.forEach(({ angle, turn }, j) => {
      command[j] = this.chain.servo ? angle + this.chain.derivative_gain / this.chain.proportional_gain * turn : 0;
    });
  }

  midpoint(fluid) {
    const { place, rate, midPlace, midRate, scratch } = this, a = scratch.acceleration;
    for (let done = 0; done < 1;) {
      const part = 0.5 ** this.halvings, half = 0.5 * part / PLAY.rate;
      this.ask((this.steps + done + part / 2) / PLAY.rate);
      accelerate(this.chain, fluid, place, rate, place, rate, half, this.command, scratch);
      let swing = 0;
      for (let i = 2; i < place.length; i++) swing = Math.max(swing, Math.abs(a[i]) * half * part);
      if (swing > SWING && this.halvings < HALVINGS) {
        this.halvings++;
        continue;
      }
      for (let i = 0; i < place.length; i++) {
        midRate[i] = rate[i] + half * a[i];
        midPlace[i] = place[i] + half * midRate[i];
      }
      accelerate(this.chain, fluid, midPlace, midRate, place, rate, half, this.command, scratch);
      for (let i = 0; i < place.length; i++) {
        midRate[i] = rate[i] + half * a[i];
        place[i] += 2 * half * midRate[i];
        rate[i] += 2 * half * a[i];
        midPlace[i] = place[i] - half * midRate[i];
      }
      this.spend(midPlace, midRate, 2 * half);
      done += part;
      if (this.halvings > 0 && 8 * swing < SWING && done % (2 * part) === 0) this.halvings--;
    }
  }

  rungeKutta(fluid) {
    const { place, rate, midPlace, midRate, placeGain, rateGain, scratch } = this, a = scratch.acceleration, dt = 1 / PLAY.rate;
    placeGain.fill(0);
    rateGain.fill(0);
    [0, 0.5, 0.5, 1].forEach((share, stage) => {
      for (let i = 0; i < place.length; i++) {
        midPlace[i] = place[i] + (stage && share * dt * midRate[i]);
        midRate[i] = rate[i] + (stage && share * dt * a[i]);
      }
      if (stage !== 2) this.ask((this.steps + share) / PLAY.rate);
      accelerate(this.chain, fluid, midPlace, midRate, midPlace, midRate, 0, this.command, scratch);
      const weight = share === 0.5 ? dt / 3 : dt / 6;
      this.spend(midPlace, midRate, weight);
      for (let i = 0; i < place.length; i++) {
        placeGain[i] += weight * midRate[i];
        rateGain[i] += weight * a[i];
      }
    });
    for (let i = 0; i < place.length; i++) {
      place[i] += placeGain[i];
      rate[i] += rateGain[i];
    }
  }

  // Count the work of the command torques over a time [s].
  spend(place, rate, time) {
    this.command.forEach((command, j) => {
      const turn = rate[3 + j] - rate[2 + j];
      const power = commandTorque(this.chain, command, place[3 + j] - place[2 + j], turn) * turn;
      this.energy[0] += time * power;
      this.energy[1] += time * Math.max(power, 0);
    });
  }

  withinBounds() {
    return this.joints.every(({ turn }) => Math.abs(turn) <= JOINT_RATE_MAX) && Math.hypot(this.rate[0], this.rate[1]) <= V_MAX;
  }

  // Each joint's angle [rad], rate [rad/s] and applied torque [N m].
  get joints() {
    return Array.from(this.command, (command, j) => {
      const angle = this.place[3 + j] - this.place[2 + j], turn = this.rate[3 + j] - this.rate[2 + j];
      return { angle, turn, torque: appliedTorque(this.chain, commandTorque(this.chain, command, angle, turn), angle, turn) };
    });
  }

  // The head's centre, heading, and their rates: x, y [m], heading [rad].
  get head() {
    const { place, rate, chain } = this, now = { x: place[0], y: place[1], heading: place[2], v_x: rate[0], v_y: rate[1], turn: rate[2] };
    chain.lever.forEach((lever, i) => {
      const cos = Math.cos(place[2 + i]), sin = Math.sin(place[2 + i]);
      now.x += lever * cos;
      now.y += lever * sin;
      now.v_x -= lever * rate[2 + i] * sin;
      now.v_y += lever * rate[2 + i] * cos;
    });
    return now;
  }
}
