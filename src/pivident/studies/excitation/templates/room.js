// The room of the moving picture: capsules of the robot instead of its sticks, and the obstacles as
// wires, which hide nothing of the robot.
(() => {
  const { faces: sticks, poses } = arm;
  const SIDES = 12, RINGS = 3;
  const UPRIGHT = [1, 0, 0, 0, 1, 0, 0, 0, 1];
  const MESHES = 6; // of the lattice on each face of a box

  /** Points that cut a segment in parts: faces are drawn from far to near, long ones would lie wrong. */
  function between(a, b, parts) {
    const count = Math.min(Math.floor(parts), 12);
    return Array.from({ length: count }, (_, k) => {
      const share = (k + 1) / (count + 1);
      return arm.add(arm.scaled(a, 1 - share), arm.scaled(b, share));
    });
  }

  /** Faces of a body of revolution from a to b; round ends are half spheres. */
  function round(a, b, radius, colour, ends) {
    const way = arm.less(b, a), length = Math.hypot(...way);
    const axis = length > 1e-9 ? arm.scaled(way, 1 / length) : [0, 0, 1];
    const [u, v] = arm.across(axis);
    const half = Array.from({ length: RINGS + 1 }, (_, k) => (Math.PI / 2) * (k / RINGS));
    const profile = ends === "round"
      ? [...half.map((x) => [a, -radius * Math.cos(x), radius * Math.sin(x)]),
         ...between(a, b, length / (2 * radius || 1)).map((middle) => [middle, 0, radius]),
         ...half.map((x) => [b, radius * Math.sin(x), radius * Math.cos(x)])]
      : [[a, 0, 0], [a, 0, radius], [b, 0, radius], [b, 0, 0]];
    const ring = ([middle, along, across]) => Array.from({ length: SIDES }, (_, k) => {
      const angle = (2 * Math.PI * k) / SIDES;
      const out = arm.add(arm.scaled(u, across * Math.cos(angle)), arm.scaled(v, across * Math.sin(angle)));
      return arm.add(arm.add(middle, arm.scaled(axis, along)), out);
    });
    const rings = profile.map(ring);
    return rings.slice(1).flatMap((high, i) => high.map((_, k) => {
      const next = (k + 1) % SIDES, low = rings[i];
      // At a pole two corners are one: the three that remain come first, they give the normal.
      const points = profile[i][2] > 1e-12
        ? [low[k], low[next], high[next], high[k]] : [high[next], high[k], low[k], low[next]];
      return { points, colour };
    }));
  }

  /** A thin line, as a face without extent: replay.js strokes what it fills. */
  const line = (a, b, colour) => ({ points: [a, b, b], colour });

  /** Wires of a box: its edges as bars and a lattice on its faces; edges are columns of R. */
  function box(middle, R, size, thickness, colour) {
    const edges = [0, 1, 2].map((k) => arm.scaled([R[k], R[3 + k], R[6 + k]], size[k]));
    const found = [];
    for (const [n, i, j] of [[0, 1, 2], [1, 2, 0], [2, 0, 1]]) {
      for (const side of [-0.5, 0.5]) {
        const at = (x, y) => arm.add(arm.add(middle, arm.scaled(edges[n], side)),
          arm.add(arm.scaled(edges[i], x / MESHES - 0.5), arm.scaled(edges[j], y / MESHES - 0.5)));
        for (let x = 0; x <= MESHES; x += 1) {
          for (let y = 0; y < MESHES; y += 1) {
            if (x % MESHES) found.push(line(at(x, y), at(x, y + 1), colour), line(at(y, x), at(y + 1, x), colour));
            else found.push(...round(at(x, y), at(x, y + 1), thickness, colour, "flat"));
          }
        }
      }
    }
    return found;
  }

  /** Wires of a body of revolution: the outlines of its faces. */
  const wires = (faces) => faces.flatMap(({ points, colour }) =>
    [line(points[0], points[1], colour), line(points[1], points[2], colour)]);

  const rotated = (R, v) => [0, 3, 6].map((row) => R[row] * v[0] + R[row + 1] * v[1] + R[row + 2] * v[2]);

  function obstacle({ shape, size, radius, length, rotation, translation }, thickness, colour) {
    if (shape === "box") return box(translation, rotation, size, thickness, colour);
    const half = shape === "sphere" ? [0, 0, 0] : rotated(rotation, [0, 0, length / 2]);
    const ends = shape === "cylinder" ? "flat" : "round";
    return wires(round(arm.less(translation, half), arm.add(translation, half), radius, colour, ends));
  }

  // What is seen at first holds the frames of the links; it is to hold the base as well.
  const holder = document.getElementById("replay-motion");
  const base = (holder ? JSON.parse(holder.textContent).bodies : []).filter(({ link }) => link < 0);
  const ends = base.flatMap(({ start, end }) => [{ R: UPRIGHT, p: start }, { R: UPRIGHT, p: end }]);
  arm.poses = (joints, q) => [...poses(joints, q), ...ends];

  arm.faces = (motion, q, reach, colours) => {
    const around = motion.obstacles.flatMap((one) => obstacle(one, 0.004 * reach, theme.variable("--edge")));
    if (!motion.bodies.length) return [...sticks(motion, q, reach, colours), ...around];
    const frames = poses(motion.joints, q);
    const bodies = motion.bodies.flatMap(({ link, start, end, radius }) => {
      const { R, p } = frames[link] ?? { R: UPRIGHT, p: [0, 0, 0] };
      const place = (point) => arm.add(p, rotated(R, point));
      const colour = link < 0 ? colours.base : colours.joint(link);
      return round(place(start), place(end), radius, colour, "round");
    });
    return [...bodies, ...around];
  };
})();
