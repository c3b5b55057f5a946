"use strict";
// The fluid force on one cylindrical link, in SI units: the same equations as in physics/hydrodynamics.py.
// v_t and v_n are the velocity of the link's centre along and across the link.
const { C_A, C_F, C_MU, C_NU, P_1, P_2, P_3, C_1, C_2, EULER_GAMMA, LAMB_REYNOLDS } = PLAY.force;

// C_D of a smooth cylinder in cross flow, at Reynolds number |v_n| d/ν > 0.
function dragCoefficient(reynolds) {
  if (reynolds < LAMB_REYNOLDS) return C_1 / (reynolds * (0.5 - EULER_GAMMA - Math.log(reynolds / 8))) + C_2;
  const log = Math.log10(reynolds);
  return Math.exp(Math.LN10 * (P_1 * log * log + P_2 * log + P_3));
}

// Added mass c_a of a link for motion across it [kg].
function addedMass(fluid, length, diameter) {
  return Math.PI * diameter * diameter / 4 * C_A * fluid.density * length;
}

// Force along a link per -v_t [kg/s]: pressure drag and viscous resistance.
function tangentialResistance(v_t, v_n, fluid, length, diameter) {
  const c_f = 0.5 * C_F * fluid.density * Math.PI * diameter * length;
  const c_v = fluid.density * Math.PI * diameter * Math.sqrt(fluid.viscosity * length);
  return c_f * Math.abs(v_t) + c_v * (C_MU * Math.sqrt(Math.abs(v_t)) + C_NU * Math.sqrt(Math.abs(v_n)));
}

// Force across a link per -v_n [kg/s]: pressure drag. `shape` multiplies C_D on the head and on the tail.
function normalResistance(v_n, fluid, length, diameter, shape) {
  const speed = Math.abs(v_n), reynolds = speed * diameter / fluid.viscosity;
  if (reynolds < 1e-300) return 0;
  return 0.5 * shape * dragCoefficient(reynolds) * fluid.density * diameter * length * speed;
}

// The y of a table of increasing [x, y] at x, linear between its points and constant outside them.
function interpolated(table, x) {
  const after = table.findIndex(([place]) => place >= x);
  if (after <= 0) return after < 0 ? table[table.length - 1][1] : table[0][1];
  const [[a, from], [b, to]] = table.slice(after - 1, after + 1);
  return from + (x - a) / (b - a) * (to - from);
}

// A fluid that is known only by its kinematic viscosity [m²/s]; density [kg/m³] as in fluid.py.
function fluidOf(viscosity) {
  return { viscosity, density: interpolated(PLAY.densities, Math.log10(viscosity)) };
}
