// The glides' numbers, and the pose at any time between their frames.

const WIDTHS = [
  ["times", 1], ["centre", 3], ["velocity", 3], ["axes", 9], ["angles", 3],
  ["nodes", 0], ["chordwise", 0], ["dorsal", 0], ["lift", 0], ["drag", 0],
  ["inputs", null], ["told", null],
];

// Cuts the numbers of all glides into named arrays, frame after frame.
export function glidesOf(about, numbers) {
  let place = 0;
  return about.glides.map((given) => {
    const glide = { ...given, fields: {}, now: {} };
    for (const [name, width] of WIDTHS) {
      const each = width === null ? given.steered.length : width || 3 * given.nodes;
      const count = each * given.frames;
      glide.fields[name] = numbers.subarray(place, place + count);
      glide.now[name] = new Float32Array(each);
      place += count;
    }
    glide.end = glide.fields.times[given.frames - 1];
    pose(glide, 0);
    return glide;
  });
}

// Sets glide.now to the time, or to the glide's end where that is earlier.
export function pose(glide, time) {
  const { times } = glide.fields;
  const at = Math.min(Math.max(time, 0), glide.end);
  let low = 0;
  let high = glide.frames - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= at) low = middle;
    else high = middle;
  }
  const u = high === low ? 0 : (at - times[low]) / (times[high] - times[low]);
  for (const [name] of WIDTHS) {
    const values = glide.now[name];
    const all = glide.fields[name];
    const a = low * values.length;
    const b = high * values.length;
    for (let i = 0; i < values.length; i += 1) {
      values[i] = (1 - u) * all[a + i] + u * all[b + i];
    }
  }
}

// Height, speed and angle of the path below the horizontal, now [m, m/s, deg].
export function numbersOf(glide) {
  const [x, y, z] = glide.now.velocity;
  const level = Math.hypot(x, y);
  return {
    height: glide.now.centre[2],
    speed: Math.hypot(level, z),
    glideAngle: (Math.atan2(-z, level) * 180) / Math.PI,
  };
}

// Points of a surface now: the same rule as in Python, see _loft.py there.
export function loft(glide, stations, outline, points) {
  const { nodes, chordwise, dorsal } = glide.now;
  const last = glide.nodes - 1;
  const centre = [0, 0, 0];
  const across = [0, 0, 0];
  const up = [0, 0, 0];
  const tangent = (i, k) => {
    const a = 3 * i + ((k + 1) % 3);
    const b = 3 * i + ((k + 2) % 3);
    return chordwise[a] * dorsal[b] - chordwise[b] * dorsal[a];
  };
  const mixed = (field, i, u, factor, result) => {
    for (let k = 0; k < 3; k += 1) {
      result[k] = (1 - u) * field[3 * i + k] + u * field[3 * i + 3 + k];
    }
    const size = factor / Math.max(Math.hypot(...result), 1e-9);
    for (let k = 0; k < 3; k += 1) result[k] *= size;
  };
  let place = 0;
  for (let m = 0; m < stations.segment.length; m += 1) {
    const segment = stations.segment[m];
    const i = Math.min(Math.max(segment, 0), last - 1);
    const beyond = segment < 0 ? -1 : segment >= last ? 1 : 0;
    const u = stations.within[m];
    for (let k = 0; k < 3; k += 1) {
      if (beyond) {
        const end = beyond < 0 ? 0 : last;
        centre[k] = nodes[3 * end + k] + beyond * u * tangent(end, k);
      } else {
        const h = glide.step[i];
        centre[k] = (1 + 2 * u) * (1 - u) ** 2 * nodes[3 * i + k]
          + u * (1 - u) ** 2 * h * tangent(i, k)
          + u * u * (3 - 2 * u) * nodes[3 * i + 3 + k]
          + u * u * (u - 1) * h * tangent(i + 1, k);
      }
    }
    const mix = beyond < 0 ? 0 : beyond > 0 ? 1 : u;
    mixed(chordwise, i, mix, stations.width[m], across);
    mixed(dorsal, i, mix, stations.height[m], up);
    for (const [x, z] of outline.points) {
      for (let k = 0; k < 3; k += 1) points[place + k] = centre[k] + x * across[k] + z * up[k];
      place += 3;
    }
  }
}
