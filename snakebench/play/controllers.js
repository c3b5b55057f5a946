"use strict";
// What drives a robot: gaits, which are functions of time, and policies, which look at the robot 30 times a second.

// The commands of a gait at a time [s], written into `command`; as in controllers.py.
const WAVES = {
  "sea-snake": ({ amplitude, frequency, phase }, time, command) => {
    const n = command.length;
    for (let i = 1; i <= n; i++) command[i - 1] = i / n * amplitude * Math.sin(2 * Math.PI * frequency * time + (n - i) * phase);
  },
  "sinusoidal-torque": ({ amplitude, frequency, phase }, time, command) => {
    for (let i = 0; i < command.length; i++) command[i] = amplitude * Math.sin(2 * Math.PI * frequency * time - i * phase);
  },
  "periodic-targets": ({ period, targets }, time, command) => {
    const place = time * targets.length / period, before = Math.floor(place), share = place - before;
    const from = targets[before % targets.length], to = targets[(before + 1) % targets.length];
    for (let j = 0; j < command.length; j++) command[j] = (1 - share) * from[j] + share * to[j];
  },
};
const periodOf = (gait) => gait.period ?? 1 / gait.frequency;

// Of a kind of gait, the one for the fluid that is nearest, or was chosen, and for the price of power.
function gaitFor(family, settings, tuned) {
  const far = (medium) => Math.abs(Math.log10(medium.viscosity / settings.fluid.viscosity));
  const medium = family.media.find(({ name }) => name === tuned) ?? family.media.reduce((best, one) => (far(one) < far(best) ? one : best));
  return { ...medium.gaits[medium.best[settings.price]], medium };
}

// A gait in one run. When another gait takes its place, the phase stays; commands come `delay` physics steps late.
class GaitRun {
  constructor(family) {
    this.family = family;
    this.drives = family.drives;
    this.shift = 0;
  }

  attend(swimmer, settings, tuned) {
    const found = gaitFor(this.family, settings, tuned), time = swimmer.steps / PLAY.rate;
    if (this.now && this.now.gait !== found.gait) {
      const turns = (time + this.shift) / periodOf(this.now.gait);
      this.shift = turns % 1 * periodOf(found.gait) - time;
    }
    this.now = found;
    this.late = settings.delay / PLAY.rate;
  }

  ask(time, command) {
    const sent = time - this.late, period = periodOf(this.now.gait);
    if (sent < 0) command.fill(0);
    else WAVES[this.now.gait.kind](this.now.gait, this.shift ? ((sent + this.shift) % period + period) % period : sent, command);
  }

  get period() { return periodOf(this.now.gait); }
}

// A policy in one run. Its targets are held for a control step and arrive `delay` physics steps late, in their order.
class PolicyRun {
  drives = "angle";
  period = null;

  constructor(network, swimmer) {
    this.pilot = new Pilot(network);
    this.coming = [];
    this.target = swimmer.joints.map(({ angle }) => angle);  // until the first arrives, joints stay as they are
  }

  attend(swimmer, settings) {
    if (swimmer.steps % PLAY.every === 0) {
      const due = Math.max(swimmer.steps + settings.delay, this.coming.at(-1)?.due ?? 0);
      this.coming.push({ due, target: this.pilot.choose(swimmer, settings.fluid, PLAY.prices[settings.price], settings.noise) });
    }
    while (this.coming.length && this.coming[0].due <= swimmer.steps) this.target = this.coming.shift().target;
  }

  ask(time, command) { command.set(this.target); }
}
