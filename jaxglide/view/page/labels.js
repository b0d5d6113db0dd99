// Words in space: drawn once on a small canvas each, facing the camera, of one size on screen.
import * as THREE from "three";

const PIXELS = 34;
const HEIGHT = 0.0155; // of a label of size 1, at a distance of 1 from the camera

export function label(text, { size = 1, colour = "#33404d", weight = 600 } = {}) {
  const canvas = document.createElement("canvas");
  const pen = canvas.getContext("2d");
  const font = `${weight} ${PIXELS}px system-ui, "Helvetica Neue", Arial, sans-serif`;
  pen.font = font;
  canvas.width = Math.ceil(pen.measureText(text).width) + 16;
  canvas.height = PIXELS + 16;
  pen.font = font;
  pen.textBaseline = "middle";
  pen.lineJoin = "round";
  pen.lineWidth = 6;
  pen.strokeStyle = "rgba(255, 255, 255, 0.9)";
  pen.strokeText(text, 8, canvas.height / 2);
  pen.fillStyle = colour;
  pen.fillText(text, 8, canvas.height / 2);
  const map = new THREE.CanvasTexture(canvas);
  map.colorSpace = THREE.SRGBColorSpace;
  map.anisotropy = 4;
  const sprite = new THREE.Sprite(
    new THREE.SpriteMaterial({
      map, transparent: true, depthWrite: false, depthTest: false, sizeAttenuation: false,
    }),
  );
  const height = (HEIGHT * size * canvas.height) / PIXELS;
  sprite.scale.set((height * canvas.width) / canvas.height, height, 1);
  sprite.renderOrder = 10;
  sprite.userData.text = text;
  return sprite;
}
