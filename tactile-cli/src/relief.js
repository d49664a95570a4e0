"use strict";
// A function that draws heights on the canvas and returns how far it stretches them. The mouse, a finger or the
// arrow keys turn them, and the next heights are drawn as they are turned.
function turnable(canvas) {
  const c = canvas.getContext("2d");
  let relief = null, azimuth = 0.6, elevation = 0.6;
  const draw = () => {
    if (!relief) return 1;
    const columns = relief.columns, [dx, dy, dz] = relief.steps_mm, rows = relief.heights.length / columns;
    const heights = relief.heights.map((h) => h === null ? NaN : dz * h), high = relief.height_mm;
    const width = dx * (columns - 1), depth = dy * (rows - 1), size = Math.hypot(width, depth);
    // Flat surfaces are stretched so that their shape is seen.
    const stretch = Math.max(1, 0.35 * size / high);
    const [ca, sa, ce, se] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(elevation), Math.sin(elevation)];
    const scale = 0.92 * Math.min(canvas.width, 1.4 * canvas.height) / size;
    const at = (row, column) => {
      const [x, y] = [column * dx - width / 2, row * dy - depth / 2];
      const z = stretch * (heights[row * columns + column] - high / 2);
      const [u, v] = [ca * x - sa * y, sa * x + ca * y];
      return [canvas.width / 2 + scale * u, canvas.height / 2 + scale * (se * v - ce * z), ce * v + se * z, z];
    };
    const faces = [];
    for (let row = 0; row + 1 < rows; row++) for (let column = 0; column + 1 < columns; column++) {
      const corners = [at(row, column), at(row, column + 1), at(row + 1, column + 1), at(row + 1, column)];
      if (corners.every((p) => p[3] === p[3])) faces.push([corners, corners.reduce((sum, p) => sum + p[2], 0)]);
    }
    // Each face is cut along the level below which the rim lies.
    const level = stretch * (dz * relief.cut - high / 2), above = (p) => p[3] >= level;
    const trimmed = (corners) => corners.flatMap((p, k) => {
      const q = corners[(k + 1) % corners.length], share = (level - p[3]) / (q[3] - p[3]);
      const kept = above(p) ? [p] : [];
      return above(p) === above(q) ? kept : [...kept, p.map((v, i) => v + share * (q[i] - v))];
    });
    faces.sort((a, b) => a[1] - b[1]);
    c.clearRect(0, 0, canvas.width, canvas.height);
    for (const [corners] of faces) {
      const share = corners.reduce((sum, p) => sum + p[3], 0) / (4 * stretch * high) + 0.5;
      // The height is the hue, the slope along x the light.
      const slope = (corners[1][3] - corners[0][3] + corners[2][3] - corners[3][3]) / (2 * dx);
      const light = 52 + 16 * slope / Math.hypot(1, slope);
      c.fillStyle = c.strokeStyle = `hsl(${250 - 200 * share} 65% ${light}%)`;
      c.beginPath();
      trimmed(corners).forEach((p) => c.lineTo(p[0], p[1]));
      c.closePath();
      c.fill();
      c.stroke();
    }
    return stretch;
  };
  canvas.onpointermove = (event) => {
    if (!event.buttons) return;
    azimuth -= event.movementX / 120;
    elevation = Math.min(1.57, Math.max(0, elevation + event.movementY / 120));
    draw();
  };
  canvas.onpointerdown = (event) => canvas.setPointerCapture(event.pointerId);
  canvas.onkeydown = (event) => {
    const turn = { ArrowLeft: 0.1, ArrowRight: -0.1 }[event.key];
    if (turn) azimuth += turn, draw();
  };
  return (next) => (relief = next, draw());
}
