// The scene in space and the camera that looks at it.
import * as THREE from "three";
import { OrbitControls } from "./OrbitControls.js";
import { extent, ground, lights, mast, posts } from "./surroundings.js";
import { snake } from "./snake.js";

const FOV = 38;
const FOLLOW = new THREE.Vector3(0.75, -1.0, 0.95); // from behind, right and above
const OVERVIEW = new THREE.Vector3(1, -0.42, 0.3);

export class Stage {
  constructor(canvas, glides, about) {
    this.glides = glides;
    this.gap = 1.15 * Math.max(...glides.map((glide) => glide.svl));
    this.apart = glides.length > 1;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.setClearColor(0, 0);
    this.camera = new THREE.PerspectiveCamera(FOV, 1, 0.02, 1000);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.minDistance = 0.15;
    this.controls.maxDistance = 400;
    this.scene = new THREE.Scene();
    this.snakes = glides.map((glide, index) => (
      snake(glide, about.outlines, about.forceScale, index, glides.length > 1)
    ));
    this.box = extent(glides, (index) => this.shiftOf(index));
    this.surroundings = [ground(this.box), mast(this.box)];
    this.surroundings.push(...glides.map((glide) => posts(glide, this.box.top)));
    this.scene.add(lights(), ...this.surroundings.map((part) => part.group));
    this.scene.add(...this.snakes.map((part) => part.group));
    this.target = new THREE.Vector3();
    this.spot = new THREE.Vector3();
    this.named = true;
    this.size = 1;
    this.mode = "all";
    this.controls.addEventListener("change", () => { this.dirty = true; });
    this.setApart(this.apart);
  }

  // How far a glide is moved to the right, so that several can be told apart [m].
  shiftOf(index) {
    return this.apart ? (index - (this.glides.length - 1) / 2) * this.gap : 0;
  }

  setApart(apart) {
    this.apart = apart;
    this.snakes.forEach((part, index) => part.group.position.setX(this.shiftOf(index)));
    this.dirty = true;
  }

  show(name, visible) {
    if (name === "labels") {
      this.named = visible;
      for (const part of [...this.snakes, ...this.surroundings]) {
        for (const word of [part.words].flat()) word.visible = visible;
      }
    } else {
      for (const part of this.snakes) part.parts[name].visible = visible;
    }
    this.dirty = true;
  }

  // The middle of what is followed.
  middle(result) {
    const chosen = this.mode === "all" ? this.glides.keys() : [Number(this.mode)];
    let count = 0;
    result.set(0, 0, 0);
    for (const index of chosen) {
      const [x, y, z] = this.glides[index].now.centre;
      result.x += x + this.shiftOf(index);
      result.y += y;
      result.z += z;
      count += 1;
    }
    return result.divideScalar(count);
  }

  // How large a part of space must be in view around the middle [m].
  needed(middle) {
    let most = 0;
    for (const index of this.mode === "all" ? this.glides.keys() : []) {
      this.spot.fromArray(this.glides[index].now.centre);
      this.spot.x += this.shiftOf(index);
      most = Math.max(most, this.spot.distanceTo(middle));
    }
    return 0.72 * Math.max(...this.glides.map((glide) => glide.svl)) + 1.15 * most;
  }

  // "all", "fixed", or the number of a glide.
  look(mode) {
    this.mode = mode;
    this.reset();
  }

  reset() {
    const half = Math.tan((FOV * Math.PI) / 360);
    const wide = Math.max(this.camera.aspect, 0.2);
    if (this.mode === "fixed") {
      const { x, y, top } = this.box;
      this.controls.target.set((x[0] + x[1]) / 2, (y[0] + y[1]) / 2, 0.47 * top);
      const across = (y[1] - y[0] + 2.5) / wide;
      const distance = (0.56 * Math.max(top + 1.2, across)) / half + (x[1] - x[0]) / 2;
      this.camera.position.copy(OVERVIEW).normalize().multiplyScalar(distance);
    } else {
      this.middle(this.controls.target);
      this.size = this.needed(this.controls.target);
      this.camera.position.copy(FOLLOW).normalize();
      this.camera.position.multiplyScalar((0.62 * this.size) / (half * Math.min(wide, 1)));
      this.target.copy(this.controls.target);
    }
    this.camera.position.add(this.controls.target);
    this.controls.update();
    this.dirty = true;
  }

  // Bodies, forces and camera to the poses the glides have now.
  update() {
    for (const part of this.snakes) part.update();
    if (this.mode !== "fixed") {
      // Keep the place and the distance chosen by hand; glides that part stay in view.
      this.camera.position.sub(this.target);
      this.controls.target.sub(this.target);
      this.middle(this.target);
      const size = this.needed(this.target);
      this.camera.position.multiplyScalar(size / this.size).add(this.target);
      this.controls.target.add(this.target);
      this.size = size;
      this.controls.update();
    }
    this.dirty = true;
  }

  resize(width, height) {
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.dirty = true;
  }

  // The axes' names would lie on top of each other from afar.
  thin() {
    this.snakes.forEach((part, index) => {
      const { centre } = this.glides[index].now;
      this.spot.fromArray(centre).setX(centre[0] + this.shiftOf(index));
      const far = this.spot.distanceTo(this.camera.position) > 7 * this.glides[index].svl;
      for (const word of part.axisNames) word.visible = this.named && !far;
    });
  }

  draw() {
    if (!this.dirty) return;
    this.dirty = false;
    this.thin();
    this.renderer.render(this.scene, this.camera);
  }
}
