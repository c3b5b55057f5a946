"use strict";
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
