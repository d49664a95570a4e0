"use strict";
for (const canvas of document.querySelectorAll("canvas.surface")) {
  const columns = Number(canvas.dataset.columns), c = canvas.getContext("2d");
  const [dx, dy, dz] = canvas.dataset.steps.split(",").map(Number);
  const heights = canvas.dataset.heights.split(",").map((h) => h === "" ? NaN : dz * Number(h));
  const rows = heights.length / columns, known = heights.filter((h) => h === h);
  const low = known.reduce((a, b) => Math.min(a, b)), high = known.reduce((a, b) => Math.max(a, b));
  const width = dx * (columns - 1), depth = dy * (rows - 1), size = Math.hypot(width, depth);
  // Flat surfaces are stretched so that their shape is seen.
  const stretch = Math.max(1, 0.35 * size / (high - low || 1));
  canvas.nextElementSibling.textContent += stretch > 1 ? `, heights ×${stretch.toPrecision(2)}` : "";
  let azimuth = 0.6, elevation = 0.6;
  const draw = () => {
    const [ca, sa, ce, se] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(elevation), Math.sin(elevation)];
    const scale = 0.92 * Math.min(canvas.width, 1.4 * canvas.height) / size;
    const at = (row, column) => {
      const [x, y] = [column * dx - width / 2, row * dy - depth / 2];
      const z = stretch * (heights[row * columns + column] - (low + high) / 2);
      const [u, v] = [ca * x - sa * y, sa * x + ca * y];
      return [canvas.width / 2 + scale * u, canvas.height / 2 + scale * (se * v - ce * z), ce * v + se * z, z];
    };
    const faces = [];
    for (let row = 0; row + 1 < rows; row++) for (let column = 0; column + 1 < columns; column++) {
      const corners = [at(row, column), at(row, column + 1), at(row + 1, column + 1), at(row + 1, column)];
      if (corners.every((p) => p[3] === p[3])) faces.push([corners, corners.reduce((sum, p) => sum + p[2], 0)]);
    }
    faces.sort((a, b) => a[1] - b[1]);
    c.clearRect(0, 0, canvas.width, canvas.height);
    for (const [corners] of faces) {
      const height = corners.reduce((sum, p) => sum + p[3], 0) / 4 / stretch + (low + high) / 2;
      const share = (height - low) / (high - low || 1);
      // The height is the hue, the slope along x the light.
      const slope = (corners[1][3] - corners[0][3] + corners[2][3] - corners[3][3]) / (2 * dx);
      const light = 52 + 16 * slope / Math.hypot(1, slope);
      c.fillStyle = c.strokeStyle = `hsl(${250 - 200 * share} 65% ${light}%)`;
      c.beginPath();
      corners.forEach((p) => c.lineTo(p[0], p[1]));
      c.closePath();
      c.fill();
      c.stroke();
    }
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
  draw();
}
