// What moves with a glide: body, head, shadow, force sheets, axes, path.
import * as THREE from "three";
import { Line2 } from "./Line2.js";
import { LineGeometry } from "./LineGeometry.js";
import { LineMaterial } from "./LineMaterial.js";
import { loft } from "./data.js";
import { label } from "./labels.js";

export const FORCES = { lift: "#0072b2", drag: "#e69f00" };
const BACK = ["#2f8f3a", "#1f6b33"];
const BELLY = ["#d3dd5a", "#c2cf46"];
const BAND = 0.045; // of SVL, from one dark band to the next
const EYE = 4; // station of the head
const TICK = 0.1; // s between marks on the path
const AXES = [["right", "#b3366b"], ["forward", "#33404d"], ["up", "#0b7a75"]];

function colours(stations, outline, head) {
  const values = [];
  const [backs, bellies] = [BACK, BELLY].map((pair) => pair.map((c) => new THREE.Color(c)));
  const mixed = new THREE.Color();
  for (const fraction of stations.fraction) {
    const wave = head ? 0.55 : 0.5 + 0.5 * Math.cos((2 * Math.PI * fraction) / BAND);
    for (const belly of outline.belly) {
      const [a, b] = belly ? bellies : backs;
      mixed.copy(a).lerp(b, wave ** 2);
      values.push(mixed.r, mixed.g, mixed.b);
    }
  }
  return values;
}

function surface(glide, stations, outline, head) {
  const [rows, around] = [stations.segment.length, outline.points.length];
  const geometry = new THREE.BufferGeometry();
  const points = new THREE.BufferAttribute(new Float32Array(3 * rows * around), 3);
  points.setUsage(THREE.DynamicDrawUsage);
  geometry.setAttribute("position", points);
  const tint = new THREE.Float32BufferAttribute(colours(stations, outline, head), 3);
  geometry.setAttribute("color", tint);
  const index = [];
  for (let row = 0; row + 1 < rows; row += 1) {
    if (!head && stations.fraction[row] < glide.covered) continue;
    for (let i = 0; i < around; i += 1) {
      // Back and belly meet at doubled points: no face between those.
      const next = (i + 1) % around;
      if (outline.belly[i] !== outline.belly[next]) continue;
      const [a, b] = [row * around + i, row * around + next];
      index.push(a, a + around, b, b, a + around, b + around);
    }
  }
  geometry.setIndex(index);
  const mesh = new THREE.Mesh(geometry, new THREE.MeshStandardMaterial({
    vertexColors: true, roughness: 0.55, metalness: 0, side: THREE.DoubleSide,
  }));
  mesh.frustumCulled = false;
  mesh.userData.update = () => {
    loft(glide, stations, outline, points.array);
    points.needsUpdate = true;
    geometry.computeVertexNormals();
  };
  return mesh;
}

// The body's shadow, straight below it: the same points at height zero.
function shadow(meshes) {
  const group = new THREE.Group();
  for (const mesh of meshes) {
    const flat = new THREE.Mesh(mesh.geometry, new THREE.MeshBasicMaterial({
      color: "#b4b9a4", side: THREE.DoubleSide,
    }));
    flat.scale.z = 0;
    flat.position.z = 0.004;
    flat.frustumCulled = false;
    group.add(flat);
  }
  return group;
}

function eyes() {
  const ball = new THREE.SphereGeometry(1, 16, 12);
  const dark = new THREE.MeshStandardMaterial({ color: "#15181a", roughness: 0.2 });
  return [new THREE.Mesh(ball, dark), new THREE.Mesh(ball, dark)];
}

function placeEyes(pair, glide, head, outline) {
  const around = outline.points.length;
  const size = glide.head.width[EYE] * 0.17;
  // On the outline, well up the sides.
  for (const [eye, i] of [[pair[0], 2], [pair[1], 6]]) {
    eye.position.fromBufferAttribute(head.geometry.attributes.position, EYE * around + i);
    eye.scale.setScalar(size);
  }
}

// A sheet from the nodes to the tips of their forces, with its edge and a few ribs.
function sheet(glide, name, scale) {
  const count = glide.nodes;
  const points = new THREE.BufferAttribute(new Float32Array(6 * count), 3);
  points.setUsage(THREE.DynamicDrawUsage);
  const face = new THREE.BufferGeometry();
  face.setAttribute("position", points);
  const index = [];
  const lines = [];
  for (let i = 0; i < count; i += 1) {
    if (i + 1 < count) {
      index.push(2 * i, 2 * i + 1, 2 * i + 2, 2 * i + 2, 2 * i + 1, 2 * i + 3);
      lines.push(2 * i + 1, 2 * i + 3);
    }
    if (i % 3 === 1) lines.push(2 * i, 2 * i + 1);
  }
  face.setIndex(index);
  const edge = new THREE.BufferGeometry();
  edge.setAttribute("position", points);
  edge.setIndex(lines);
  const color = FORCES[name];
  const group = new THREE.Group();
  group.add(
    new THREE.Mesh(face, new THREE.MeshBasicMaterial({
      color, transparent: true, opacity: 0.34, side: THREE.DoubleSide, depthWrite: false,
    })),
    new THREE.LineSegments(edge, new THREE.LineBasicMaterial({
      color, transparent: true, opacity: 0.85,
    })),
  );
  for (const child of group.children) child.frustumCulled = false;
  group.userData.points = points.array;
  group.userData.update = () => {
    const { nodes, [name]: force } = glide.now;
    for (let i = 0; i < count; i += 1) {
      for (let k = 0; k < 3; k += 1) {
        points.array[6 * i + k] = nodes[3 * i + k];
        points.array[6 * i + 3 + k] = nodes[3 * i + k] + scale * force[3 * i + k];
      }
    }
    points.needsUpdate = true;
  };
  return group;
}

function axes(glide) {
  const group = new THREE.Group();
  const size = 0.3 * glide.svl;
  const arrows = AXES.map(([name, colour]) => {
    const arrow = new THREE.Group();
    const paint = new THREE.MeshStandardMaterial({ color: colour, roughness: 0.6 });
    const rod = new THREE.CylinderGeometry(0.008 * size, 0.008 * size, size, 10);
    const tip = new THREE.ConeGeometry(0.028 * size, 0.09 * size, 16);
    const [shaft, point] = [new THREE.Mesh(rod, paint), new THREE.Mesh(tip, paint)];
    shaft.position.y = size / 2;
    point.position.y = size;
    arrow.add(shaft, point);
    const text = label(name, { colour, weight: 600 });
    text.userData.label = true;
    group.add(arrow, text);
    return [arrow, text];
  });
  const [y, direction, centre] = [0, 1, 2].map(() => new THREE.Vector3());
  y.set(0, 1, 0);
  group.userData.update = () => {
    centre.fromArray(glide.now.centre);
    arrows.forEach(([arrow, text], i) => {
      direction.fromArray(glide.now.axes, 3 * i).normalize();
      arrow.position.copy(centre);
      arrow.quaternion.setFromUnitVectors(y, direction);
      text.position.copy(centre).addScaledVector(direction, 1.15 * size);
    });
  };
  return group;
}

function line(positions, colour, width, opacity) {
  const geometry = new LineGeometry();
  geometry.setPositions(positions);
  const mesh = new Line2(geometry, new LineMaterial({
    color: colour, linewidth: width, transparent: true, opacity, depthWrite: false,
  }));
  mesh.frustumCulled = false;
  return mesh;
}

// The way of the centre of mass: faint where it is still to come, with a mark each 0.1 s.
function path(glide) {
  const { centre, times } = glide.fields;
  const group = new THREE.Group();
  const ahead = line(centre, glide.colour, 1.5, 0.3);
  const flown = line(centre, glide.colour, 3, 0.9);
  const below = [...centre].map((value, i) => (i % 3 === 2 ? 0.006 : value));
  const marks = [];
  const words = new THREE.Group();
  for (let k = 0, i = 0; k * TICK <= glide.end; k += 1) {
    while (i + 2 < times.length && times[i + 1] < k * TICK) i += 1;
    const u = (k * TICK - times[i]) / (times[i + 1] - times[i]);
    const spot = [0, 1, 2].map((n) => (1 - u) * centre[3 * i + n] + u * centre[3 * i + 3 + n]);
    marks.push(...spot);
    if (k % 5 === 0 && k > 0) {
      const text = label(`${(k * TICK).toFixed(1)} s`, { size: 0.9, colour: glide.colour });
      text.position.set(spot[0] + 0.06, spot[1], spot[2] + 0.03);
      words.add(text);
    }
  }
  const dots = new THREE.BufferGeometry();
  dots.setAttribute("position", new THREE.Float32BufferAttribute(marks, 3));
  const plumb = line([0, 0, 0, 0, 0, 1], glide.colour, 1, 0.35);
  group.add(ahead, flown, line(below, "#4d5a4a", 1.5, 0.35), plumb, words, new THREE.Points(
    dots,
    new THREE.PointsMaterial({ color: glide.colour, size: 5, sizeAttenuation: false }),
  ));
  group.userData.words = words;
  group.userData.update = () => {
    let passed = 0;
    while (passed + 1 < times.length && times[passed + 1] <= glide.now.times[0]) passed += 1;
    flown.geometry.instanceCount = passed;
    flown.visible = passed > 0;
    const [x, y, z] = glide.now.centre;
    plumb.position.set(x, y, 0);
    plumb.scale.set(1, 1, Math.max(z, 1e-6));
  };
  return group;
}

// Everything of one glide, in one group that can be moved aside.
export function snake(glide, outlines, scale, index, named) {
  const group = new THREE.Group();
  const body = surface(glide, glide.body, outlines.body, false);
  const head = surface(glide, glide.head, outlines.head, true);
  const pair = glide.head.width.length > 0 ? eyes() : []; // a robot has no head
  const parts = {
    lift: sheet(glide, "lift", scale),
    drag: sheet(glide, "drag", scale),
    path: path(glide),
    axes: axes(glide),
  };
  const name = label(glide.label, { size: 1.1, colour: glide.colour, weight: 600 });
  group.add(shadow([body, head]), body, head, ...pair, ...Object.values(parts));
  if (named) group.add(name);
  // Of several glides, each name stands a line lower, and one path alone has its times.
  name.center.set(0.5, 1 + 1.1 * index);
  parts.path.userData.words.visible = index === 0;
  const update = () => {
    body.userData.update();
    head.userData.update();
    if (pair.length > 0) placeEyes(pair, glide, head, outlines.head);
    for (const part of Object.values(parts)) part.userData.update();
    const [x, y, z] = glide.now.centre;
    name.position.set(x, y, z - 0.18 * glide.svl);
  };
  const words = index === 0 ? [name, parts.path.userData.words] : [name];
  const axisNames = parts.axes.children.filter((child) => child.userData.label);
  return { group, body, head, parts, words, axisNames, update };
}
