"use strict";
// Equations of motion of a planar chain of links in a fluid, as in physics/chain.py and physics/joints.py.
// Coordinates are the centre of mass (x, y) and the links' absolute angles: `place` and `rate`, n_links + 2 numbers.

function scratchOf(n) {
  const rows = (width) => Array.from({ length: n }, () => new Float64Array(width));
  return {
    axis: rows(2), resistance: rows(3), velocity: rows(2), startVelocity: rows(2), drift: rows(2), inertia: rows(3), force: rows(2),
    matrix: Array.from({ length: n + 2 }, () => new Float64Array(n + 2)),
    acceleration: new Float64Array(n + 2),
  };
}

// Writes into s.acceleration what carries the chain on from its start. Drag and the joints' law are linearised at
// (place, rate) and taken at the velocity and angles that a constant acceleration reaches after `ahead` seconds from
// (start, startRate). With `ahead` = 0 and the start at (place, rate) this is the plain derivative; with half a step it
// is the implicit midpoint rule, solved for its stiff terms.
function accelerate(chain, fluid, place, rate, start, startRate, ahead, command, s) {
  const n = chain.length.length, out = s.acceleration, matrix = s.matrix;
  move(chain, place, rate, startRate, s);
  press(chain, fluid, rate, ahead, s);
  assemble(chain, s);
  for (let j = 0; j < n - 1; j++) {
    const angle = place[3 + j] - place[2 + j], turn = rate[3 + j] - rate[2 + j];
    const stiffness = chain.stiffness + (chain.servo ? chain.proportional_gain : 0);
    const damping = chain.damping + (chain.servo ? chain.derivative_gain : 0);
    const u = appliedTorque(chain, commandTorque(chain, command[j], angle, turn), angle, turn);
    const angle0 = start[3 + j] - start[2 + j], turn0 = startRate[3 + j] - startRate[2 + j];
    const torque = u + stiffness * angle + damping * turn - stiffness * (angle0 + ahead * turn0) - damping * turn0;
    out[2 + j] -= torque;
    out[3 + j] += torque;
    const resisted = ahead * (damping + ahead * stiffness);
    matrix[2 + j][2 + j] += resisted;
    matrix[3 + j][3 + j] += resisted;
    matrix[3 + j][2 + j] -= resisted;
  }
  factorise(matrix, n + 2);
  solve(matrix, out, n + 2);
  for (let i = 0; i < n; i++) {  // from the head's centre to the centre of mass
    out[0] += chain.lever[i] * s.axis[i][1] * out[2 + i];
    out[1] -= chain.lever[i] * s.axis[i][0] * out[2 + i];
  }
}

// The torque u_in [N m] that a command makes in a joint: the command itself, or the servo's PD law.
function commandTorque(chain, command, angle, rate) {
  return chain.servo ? chain.proportional_gain * (command - angle) - chain.derivative_gain * rate : command;
}

// The torque u [N m] that acts in a joint: u_in, and the cover's spring and damper.
function appliedTorque(chain, u_in, angle, rate) {
  return u_in - chain.stiffness * angle - chain.damping * rate;
}

// Each link's velocity at both rates and its drift, along and across it, from head to tail.
function move(chain, place, rate, startRate, s) {
  const n = chain.length.length;
  let v_x = rate[0], v_y = rate[1], u_x = startRate[0], u_y = startRate[1], b_x = 0, b_y = 0;
  for (let i = 0; i < n; i++) {
    const cos = Math.cos(place[2 + i]), sin = Math.sin(place[2 + i]), lever = chain.lever[i];
    s.axis[i][0] = cos;
    s.axis[i][1] = sin;
    const turn = lever * rate[2 + i], turn0 = lever * startRate[2 + i], whirl = lever * rate[2 + i] ** 2;
    v_x -= turn * sin; v_y += turn * cos;
    u_x -= turn0 * sin; u_y += turn0 * cos;
    b_x -= whirl * cos; b_y -= whirl * sin;
  }
  for (let i = 0; i < n; i++) {
    const [cos, sin] = s.axis[i], w = rate[2 + i], w0 = startRate[2 + i];
    const go = (half) => {
      v_x += half * w * sin; v_y -= half * w * cos;
      u_x += half * w0 * sin; u_y -= half * w0 * cos;
      b_x += half * w * w * cos; b_y += half * w * w * sin;
    };
    go(chain.front[i]);
    s.velocity[i][0] = v_x * cos + v_y * sin; s.velocity[i][1] = v_y * cos - v_x * sin;
    s.startVelocity[i][0] = u_x * cos + u_y * sin; s.startVelocity[i][1] = u_y * cos - u_x * sin;
    s.drift[i][0] = b_x * cos + b_y * sin; s.drift[i][1] = b_y * cos - b_x * sin;
    go(chain.rear[i]);
  }
}

// Each link's force and inertia.
function press(chain, fluid, rate, ahead, s) {
  for (let i = 0; i < chain.length.length; i++) {
    const [v_t, v_n] = s.velocity[i], [cos, sin] = s.axis[i], length = chain.length[i], mass = chain.mass[i];
    const along = tangentialResistance(v_t, v_n, fluid, length, chain.diameter);
    const across = normalResistance(v_n, fluid, length, chain.diameter, chain.drag_multiple[i]);
    const carried = addedMass(fluid, length, chain.diameter);
    const m_t = mass + ahead * along, m_n = mass + carried + ahead * across;
    s.inertia[i][0] = m_t * cos * cos + m_n * sin * sin;
    s.inertia[i][1] = (m_t - m_n) * cos * sin;
    s.inertia[i][2] = m_t * sin * sin + m_n * cos * cos;
    const f_t = -along * s.startVelocity[i][0] - mass * s.drift[i][0];
    const f_n = carried * (rate[2 + i] * v_t - s.drift[i][1]) - across * s.startVelocity[i][1] - mass * s.drift[i][1];
    s.force[i][0] = f_t * cos - f_n * sin;
    s.force[i][1] = f_t * sin + f_n * cos;
  }
}

// Sums the links' inertias and forces, from tail to head, into the mass matrix, whose lower half counts, and the
// generalised force.
function assemble(chain, s) {
  const matrix = s.matrix, out = s.acceleration;
  let xx = 0, xy = 0, yy = 0, f_x = 0, f_y = 0;  // of all links behind
  for (let i = chain.length.length - 1; i >= 0; i--) {
    const [cos, sin] = s.axis[i], own = chain.front[i], whole = chain.front[i] + chain.rear[i];
    const [i_xx, i_xy, i_yy] = s.inertia[i];
    const ownX = i_xy * cos - i_xx * sin, ownY = i_yy * cos - i_xy * sin;
    const allX = xy * cos - xx * sin, allY = yy * cos - xy * sin;
    const p_x = own * ownX + whole * allX, p_y = own * ownY + whole * allY;
    matrix[2 + i][0] = -p_x;
    matrix[2 + i][1] = -p_y;
    for (let j = 0; j < i; j++) {
      matrix[2 + i][2 + j] = (chain.front[j] + chain.rear[j]) * (s.axis[j][0] * p_y - s.axis[j][1] * p_x);
    }
    const turned = own * own * (cos * ownY - sin * ownX) + whole * whole * (cos * allY - sin * allX);
    matrix[2 + i][2 + i] = chain.inertia[i] + turned;
    out[2 + i] = sin * (own * s.force[i][0] + whole * f_x) - cos * (own * s.force[i][1] + whole * f_y);
    xx += i_xx; xy += i_xy; yy += i_yy;
    f_x += s.force[i][0]; f_y += s.force[i][1];
  }
  matrix[0][0] = xx; matrix[1][0] = xy; matrix[1][1] = yy;
  out[0] = f_x; out[1] = f_y;
}

// Replaces a symmetric matrix by its factors L D L': L below the diagonal, 1/D on it.
function factorise(matrix, n) {
  for (let i = 0; i < n; i++) {
    const row = matrix[i];
    let pivot = row[i];
    for (let j = 0; j < i; j++) for (let k = 0; k < j; k++) row[j] -= row[k] * matrix[j][k];
    for (let j = 0; j < i; j++) {
      const factor = row[j] * matrix[j][j];
      pivot -= factor * row[j];
      row[j] = factor;
    }
    row[i] = 1 / pivot;
  }
}

// Replaces values by the solution x of matrix x = values, given the factors of the matrix.
function solve(factors, values, n) {
  for (let i = 0; i < n; i++) for (let j = 0; j < i; j++) values[i] -= factors[i][j] * values[j];
  for (let i = 0; i < n; i++) values[i] *= factors[i][i];
  for (let i = n - 1; i > 0; i--) for (let j = 0; j < i; j++) values[j] -= factors[i][j] * values[i];
}
