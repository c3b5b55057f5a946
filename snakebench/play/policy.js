"use strict";
// A trained policy: the network of policy.py and what it observes, as in observation.py.

// The numbers of a policy: 32-bit floats, all first bytes, then all second bytes, and so on, deflated (page.py).
async function numbersOf(text) {
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const planes = new Uint8Array(await new Response(stream).arrayBuffer()), count = planes.length / 4;
  const bytes = new Uint8Array(planes.length);
  for (let k = 0; k < count; k++) for (let b = 0; b < 4; b++) bytes[4 * k + b] = planes[b * count + k];
  return new Float32Array(bytes.buffer);  // the lowest byte first, as all browsers' machines have it
}

// `weight` times x, plus `bias`; a row of `weight` for each number of `bias`.
function affine({ weight, bias }, x) {
  return Float32Array.from(bias, (sum, row) => {
    for (let k = 0, at = row * x.length; k < x.length; k++, at++) sum += weight[at] * x[k];
    return sum;
  });
}

const sigmoid = (x) => 0.5 * (1 + Math.tanh(0.5 * x));

class Network {
  constructor(card, numbers) {
    this.card = card;
    this.layers = {};
    let used = 0;
    for (const [name, shape] of card.arrays) {
      const size = shape.reduce((product, one) => product * one, 1), dot = name.lastIndexOf(".");
      (this.layers[name.slice(0, dot)] ??= {})[name.slice(dot + 1)] = numbers.subarray(used, used + size);
      used += size;
    }
  }

  // Hidden and cell state of each LSTM layer, at the beginning of a run.
  memory() {
    return this.card.lstm.map((units) => ({ hidden: new Float32Array(units), cell: new Float32Array(units) }));
  }

  // Target angles [rad] for an observation; changes the memory.
  act(observation, memory) {
    let x = observation;
    this.card.mlp.forEach((_, k) => { x = affine(this.layers[`mlp.${k}`], x).map((one) => (one > 0 ? one : Math.expm1(one))); });
    memory.forEach((state, k) => {
      const units = state.hidden.length, inputs = new Float32Array(x.length + units);
      inputs.set(x);
      inputs.set(state.hidden, x.length);
      const gates = affine(this.layers[`lstm.${k}`], inputs);
      for (let u = 0; u < units; u++) {  // gates: input, forget, candidate, output
        state.cell[u] = sigmoid(gates[units + u]) * state.cell[u] + sigmoid(gates[u]) * Math.tanh(gates[2 * units + u]);
        state.hidden[u] = sigmoid(gates[3 * units + u]) * Math.tanh(state.cell[u]);
      }
      x = state.hidden;
    });
    return affine(this.layers.action, x).map((angle) => Math.max(-1, Math.min(1, angle)));
  }
}

// A policy in one run: once a control step it looks at the robot and tells its target angles.
class Pilot {
  constructor(network) {
    this.network = network;
    this.memory = network.memory();
    this.last = null;
  }

  // `noise` multiplies the largest errors of the sensors, of PLAY.noise.
  choose(swimmer, fluid, price, noise) {
    const { columns, scale, offset } = this.network.card, head = swimmer.head;
    const off = (sensor) => noise * PLAY.noise[sensor] * (2 * Math.random() - 1);
    const joints = swimmer.joints.map(({ angle, turn }) => ({ angle: angle + off("angle"), turn: turn + off("rate") }));
    const torque = joints.map(({ angle, turn }, j) => (this.last
      ? appliedTorque(swimmer.chain, commandTorque(swimmer.chain, this.last[j], angle, turn), angle, turn) : 0));
    const sensors = [...joints.map((one) => one.angle), ...joints.map((one) => one.turn), ...torque, 0, 0, head.turn + off("gyro")];
    const action = this.last ?? joints.map(() => 0);
    const whole = [...sensors, ...action, Math.log10(fluid.viscosity), head.v_x, head.v_y, 0, Math.log10(price)];
    const scaled = columns.map((column, k) => Math.max(-100, Math.min(100, scale[k] * whole[column] + offset[k])));
    this.last = this.network.act(Float32Array.from(scaled), this.memory);
    return this.last;
  }
}
