// What stands still: the light, the ground with its metres, the mast with its heights.
import * as THREE from "three";
import { label } from "./labels.js";

const FADE = 7; // metres around the glide in which the grid fades

export function lights() {
  const sky = new THREE.HemisphereLight("#ffffff", "#c9cfa8", 1.9);
  sky.position.set(0, 0, 1);
  const sun = new THREE.DirectionalLight("#fff6e0", 2.1);
  sun.position.set(-3, -2, 5);
  const group = new THREE.Group();
  group.add(sky, sun);
  return group;
}

// The rectangle over which the glides pass [m].
export function extent(glides, shift) {
  const box = { x: [Infinity, -Infinity], y: [Infinity, -Infinity], top: 0 };
  for (const [index, glide] of glides.entries()) {
    const { centre } = glide.fields;
    for (let i = 0; i < centre.length; i += 3) {
      const x = centre[i] + shift(index);
      box.x = [Math.min(box.x[0], x), Math.max(box.x[1], x)];
      box.y = [Math.min(box.y[0], centre[i + 1]), Math.max(box.y[1], centre[i + 1])];
      box.top = Math.max(box.top, centre[i + 2]);
    }
    for (const [x, y] of glide.points) {
      box.x = [Math.min(box.x[0], x), Math.max(box.x[1], x)];
      box.y = [Math.min(box.y[0], y), Math.max(box.y[1], y)];
    }
  }
  return box;
}

function disc(box) {
  const size = 256;
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = size;
  const pen = canvas.getContext("2d");
  const fade = pen.createRadialGradient(size / 2, size / 2, 0, size / 2, size / 2, size / 2);
  fade.addColorStop(0, "rgba(226, 229, 212, 1)");
  fade.addColorStop(0.4, "rgba(226, 230, 216, 0.95)");
  fade.addColorStop(1, "rgba(230, 236, 236, 0)");
  pen.fillStyle = fade;
  pen.fillRect(0, 0, size, size);
  const map = new THREE.CanvasTexture(canvas);
  map.colorSpace = THREE.SRGBColorSpace;
  const reach = 24 + Math.hypot(box.x[1] - box.x[0], box.y[1] - box.y[0]) + box.top;
  const ground = new THREE.Mesh(
    new THREE.PlaneGeometry(2 * reach, 2 * reach),
    new THREE.MeshBasicMaterial({ map, transparent: true, depthWrite: false }),
  );
  ground.position.set((box.x[0] + box.x[1]) / 2, (box.y[0] + box.y[1]) / 2, -0.004);
  ground.renderOrder = -3;
  return ground;
}

function grid(box) {
  const far = (x, y) => Math.hypot(
    Math.max(box.x[0] - x, 0, x - box.x[1]),
    Math.max(box.y[0] - y, 0, y - box.y[1]),
  );
  const positions = [];
  const colours = [];
  const ink = new THREE.Color("#7b8a86");
  const stroke = (x0, y0, x1, y1, strong) => {
    for (const [x, y] of [[x0, y0], [x1, y1]]) {
      positions.push(x, y, 0);
      colours.push(ink.r, ink.g, ink.b, Math.max(0, 1 - far(x, y) / FADE) * (strong ? 0.9 : 0.45));
    }
  };
  const [left, right] = [Math.floor(box.x[0] - FADE), Math.ceil(box.x[1] + FADE)];
  const [back, front] = [Math.floor(box.y[0] - FADE), Math.ceil(box.y[1] + FADE)];
  for (let x = left; x <= right; x += 1) {
    for (let y = back; y <= front; y += 1) {
      if (x < right) stroke(x, y, x + 1, y, y % 5 === 0);
      if (y < front) stroke(x, y, x, y + 1, x === 0);
    }
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(positions, 3));
  geometry.setAttribute("color", new THREE.Float32BufferAttribute(colours, 4));
  const lines = new THREE.LineSegments(
    geometry,
    new THREE.LineBasicMaterial({ vertexColors: true, transparent: true, depthWrite: false }),
  );
  lines.renderOrder = -2;
  return lines;
}

// The ground, its grid of one metre, and the metres written along the launch direction.
export function ground(box) {
  const group = new THREE.Group();
  const words = new THREE.Group();
  group.add(disc(box), grid(box), words);
  const side = Math.ceil(box.x[1] + 0.6);
  const [from, to] = [Math.floor(box.y[0]) - 1, Math.ceil(box.y[1]) + 2];
  const every = Math.max(to - from, box.top) > 24 ? 5 : 1;
  for (let y = Math.ceil(from / every) * every; y <= to; y += every) {
    const text = label(`${y} m`.replace("-", "\u2212"), { colour: "#45534e" });
    text.position.set(side + 0.3, y, 0.02);
    words.add(text);
  }
  return { group, words };
}

// Posts with numbers at the points that a glide is steered to.
export function posts(glide, top) {
  const group = new THREE.Group();
  const words = new THREE.Group();
  const tall = Math.max(0.5, 0.08 * top);
  const lines = glide.points.flatMap(([x, y]) => [x, y, 0, x, y, tall]);
  glide.points.forEach(([x, y], index) => {
    const text = label(String(index + 1), { colour: glide.colour });
    text.position.set(x, y, 1.1 * tall);
    words.add(text);
  });
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(lines, 3));
  const material = new THREE.LineBasicMaterial({ color: glide.colour });
  group.add(new THREE.LineSegments(geometry, material), words);
  return { group, words };
}

// A mast at the launch with a tick each metre of height.
export function mast(box) {
  const group = new THREE.Group();
  const words = new THREE.Group();
  const top = Math.ceil(box.top);
  const every = top > 24 ? 5 : 1;
  const x = Math.floor(box.x[0] - 0.5);
  const points = [x, 0, 0, x, 0, top];
  for (let z = 0; z <= top; z += every) {
    points.push(x - 0.08, 0, z, x + 0.08, 0, z);
    if (z === 0) continue;
    const text = label(`${z} m`, { colour: "#45534e" });
    text.position.set(x - 0.4, 0, z);
    words.add(text);
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
  group.add(new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: "#8a949c" })));
  group.add(words);
  return { group, words };
}
