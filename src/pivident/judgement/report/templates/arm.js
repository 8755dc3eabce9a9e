// Geometry of the moving picture: where the links are, what they look like, what is seen of them.
const arm = (() => {
  const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
  const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
  const less = (a, b) => add(a, scaled(b, -1));
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => scaled(a, 1 / (Math.hypot(...a) || 1));
  const column = (R, k) => [R[k], R[3 + k], R[6 + k]];
  const rotated = (R, v) => [0, 3, 6].map((row) => R[row] * v[0] + R[row + 1] * v[1] + R[row + 2] * v[2]);
  const product = (A, B) => [0, 1, 2].flatMap((i) => [0, 1, 2].map((j) =>
    A[3 * i] * B[j] + A[3 * i + 1] * B[3 + j] + A[3 * i + 2] * B[6 + j]));

  /** Pose of every link's frame in the base frame; a joint turns about, or slides along, its z axis. */
  function poses(joints, q) {
    const found = [];
    joints.forEach((joint, i) => {
      const base = joint.parent < 0 ? { R: [1, 0, 0, 0, 1, 0, 0, 0, 1], p: [0, 0, 0] } : found[joint.parent];
      let R = product(base.R, joint.rotation);
      let p = add(base.p, rotated(base.R, joint.translation));
      if (joint.kind === "revolute") {
        const c = Math.cos(q[i]), s = Math.sin(q[i]);
        R = product(R, [c, -s, 0, s, c, 0, 0, 0, 1]);
      } else p = add(p, scaled(column(R, 2), q[i]));
      found.push({ R, p });
    });
    return found;
  }

  /** Two directions across a third one. */
  function across(direction) {
    const other = Math.abs(direction[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
    const u = unit(cross(direction, other));
    return [u, cross(direction, u)];
  }

  /** Faces of a prism of n sides from a to b; a round bar for many sides. */
  function bar(a, b, radius, colour, sides = 14) {
    if (Math.hypot(...less(b, a)) < 1e-9) return [];
    const [u, v] = across(unit(less(b, a)));
    const rim = Array.from({ length: sides }, (_, k) => {
      const angle = (2 * Math.PI * (k + 0.5)) / sides;
      return add(scaled(u, radius * Math.cos(angle)), scaled(v, radius * Math.sin(angle)));
    });
    const low = rim.map((x) => add(a, x)), high = rim.map((x) => add(b, x));
    const walls = rim.map((_, k) => {
      const next = (k + 1) % sides;
      return { points: [low[k], low[next], high[next], high[k]], colour };
    });
    return [...walls, { points: low, colour }, { points: high, colour }];
  }

  /** Faces of the whole arm in a posture, in the base frame. */
  function faces(motion, q, reach, colours) {
    const { joints, tip, ends } = motion;
    const frames = poses(joints, q);
    const found = [];
    joints.forEach((joint, i) => {
      const { R, p } = frames[i];
      const before = joint.parent < 0 ? [0, 0, 0] : frames[joint.parent].p;
      const way = joint.parent < 0 ? colours.base : colours.joint(joint.parent);
      if (joint.way) found.push(...bar(before, p, 0.02 * reach, way));
      if (joint.axis) {
        const half = scaled(column(R, 2), 0.055 * reach);
        const sides = joint.kind === "revolute" ? 18 : 4;
        found.push(...bar(less(p, half), add(p, half), 0.038 * reach, colours.joint(i), sides));
      }
      if (tip[i]) found.push(...bar(p, add(p, rotated(R, tip[i])), 0.016 * reach, colours.joint(i)));
    });
    for (const [link, ...point] of ends) {
      const { R, p } = link < 0 ? { R: null, p: [0, 0, 0] } : frames[link];
      const end = R ? add(p, rotated(R, point)) : point;
      found.push(...bar(p, end, 0.018 * reach, link < 0 ? colours.base : colours.joint(link)));
    }
    return found;
  }

  /** Tips of the last links; of a mechanism that has none, the ends of its loops. */
  const tips = (motion, q) => {
    const frames = poses(motion.joints, q);
    const last = motion.tip.flatMap((tip, i) => (tip ? [add(frames[i].p, rotated(frames[i].R, tip))] : []));
    const closed = motion.ends.flatMap(([link, ...point]) => (link < 0 ? [] : [add(frames[link].p, rotated(frames[link].R, point))]));
    return last.length ? last : closed;
  };

  /** What a camera sees that turns about a target. */
  function camera({ target, up, azimuth, elevation, distance, width, height }) {
    const [east, north] = across(up);
    const level = add(scaled(east, Math.cos(azimuth)), scaled(north, Math.sin(azimuth)));
    const back = add(scaled(level, Math.cos(elevation)), scaled(up, Math.sin(elevation)));
    const right = unit(cross(up, level));
    const above = cross(back, right);
    const size = 1.35 * Math.min(width, height);
    return {
      back,
      /** x and y on the picture [px], and the distance from the camera. */
      seen(point) {
        const d = less(point, target);
        const depth = distance - dot(d, back);
        const zoom = size / Math.max(depth, 0.05 * distance);
        return [width / 2 + dot(d, right) * zoom, height / 2 - dot(d, above) * zoom, depth];
      },
    };
  }

  return { add, scaled, less, dot, cross, unit, across, poses, faces, tips, camera };
})();
