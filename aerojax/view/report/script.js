// The player: slider, camera crops with overlays, the cloud from two sides, cursors in the plots.
"use strict";
(() => {
const data = JSON.parse(document.getElementById("data").textContent);
const get = id => document.getElementById(id);
const slider = get("slider"), play = get("play"), now = get("now"), detail = get("detail");
const figures = [...document.querySelectorAll(".camera")];
const cursors = [...document.querySelectorAll(".cursor")].map(g => [g, g.dataset.at.split(" ")]);
if (!data.frames.length) { get("player").hidden = true; return; }
slider.max = data.frames.length - 1;

const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0));
const clouds = new Map();
function cloudOf(index) {
  if (!clouds.has(index)) {
    const packed = data.frames[index].cloud;
    clouds.set(index, { xyz: new Int16Array(bytes(packed.xyz).buffer), rgb: bytes(packed.rgb) });
  }
  return clouds.get(index);
}

function drawCloud(canvas, cloud, up, depth, nearIsLarge) {
  const side = Math.round(canvas.clientWidth * (window.devicePixelRatio || 1));
  if (!side) return;
  canvas.width = canvas.height = side;
  const pen = canvas.getContext("2d"), dot = Math.max(2, side / 130), scale = side / 2 / 32767;
  const order = Array.from({ length: cloud.xyz.length / 3 }, (_, i) => i);
  const sign = nearIsLarge ? 1 : -1;
  order.sort((a, b) => sign * (cloud.xyz[3 * a + depth] - cloud.xyz[3 * b + depth]));
  for (const i of order) {
    pen.fillStyle = `rgb(${cloud.rgb[3 * i]},${cloud.rgb[3 * i + 1]},${cloud.rgb[3 * i + 2]})`;
    const x = side / 2 + cloud.xyz[3 * i] * scale, y = side / 2 - cloud.xyz[3 * i + up] * scale;
    pen.fillRect(x - dot / 2, y - dot / 2, dot, dot);
  }
  drawScale(pen, side, getComputedStyle(canvas).color);
}

function drawScale(pen, side, colour) {
  const power = 10 ** Math.floor(Math.log10(data.radius));
  const metres = [5, 2, 1, .5].map(f => f * power).find(m => m <= data.radius * .6) || power / 5;
  const unit = side / 260, length = metres / data.radius * side / 2, y = side - 12 * unit;
  pen.strokeStyle = pen.fillStyle = colour;
  pen.lineWidth = 2 * unit;
  pen.beginPath(); pen.moveTo(12 * unit, y); pen.lineTo(12 * unit + length, y); pen.stroke();
  pen.font = `${12 * unit}px sans-serif`;
  pen.fillText(`${+metres.toPrecision(2)} m`, 12 * unit, y - 6 * unit);
}

function rectangle(node, [x0, y0, x1, y1]) {
  const values = { x: x0, y: y0, width: x1 - x0, height: y1 - y0 };
  for (const key in values) node.setAttribute(key, Math.max(0, values[key]));
}

function sizeOf(crop) {
  const [x0, y0, x1, y1] = crop.object || [0, 0, 0, 0];
  const scale = (crop.box[2] - crop.box[0]) / crop.size[0];
  return `${Math.round((x1 - x0) * scale)}×${Math.round((y1 - y0) * scale)} px`;
}

function showCrop(figure, crop) {
  figure.classList.toggle("absent", !crop);
  figure.querySelector(".where").textContent = crop ? sizeOf(crop) : "not used";
  if (!crop) return;
  figure.querySelector("img").setAttribute("src", crop.jpeg);
  const over = figure.querySelector(".over"), place = figure.querySelector(".place");
  over.setAttribute("viewBox", `0 0 ${crop.size[0]} ${crop.size[1]}`);
  over.querySelector("path").setAttribute("d", crop.outline);
  rectangle(over.querySelector("rect"), crop.object || [0, 0, 0, 0]);
  place.setAttribute("viewBox", `0 0 ${crop.full[0]} ${crop.full[1]}`);
  rectangle(place.querySelector("rect"), crop.box);
}

function describe(frame) {
  const best = frame.probabilities.reduce((b, p, i) => (p > frame.probabilities[b] ? i : b), 0);
  const place = frame.place.map((v, i) => `${"xyz"[i]} ${v === null ? "?" : v.toFixed(2)}`).join("  ");
  const chance = frame.probabilities[best] === null ? "" : ` ${(100 * frame.probabilities[best]).toFixed(1)} %`;
  return `${data.classes[best] ?? ""}${chance} · ${place} m · ${frame.cloud.count} points`;
}

function show() {
  const index = +slider.value, frame = data.frames[index];
  now.textContent = `frame ${frame.frame}`;
  detail.textContent = describe(frame);
  figures.forEach((figure, i) => {
    const name = data.cameras[i];
    showCrop(figure, Object.hasOwn(frame.crops, name) ? frame.crops[name] : null);
  });
  drawCloud(get("front"), cloudOf(index), 2, 1, false);
  drawCloud(get("top"), cloudOf(index), 1, 2, true);
  for (const [g, places] of cursors) g.setAttribute("transform", `translate(${places[frame.index]})`);
}

let timer = null;
function stop() { clearInterval(timer); timer = null; play.textContent = "\u25B6"; }
play.addEventListener("click", () => {
  if (timer) { stop(); return; }
  play.textContent = "\u275A\u275A";
  timer = setInterval(() => { slider.value = (+slider.value + 1) % data.frames.length; show(); }, 125);
});
slider.addEventListener("input", () => { if (timer) stop(); show(); });
new ResizeObserver(show).observe(get("front"));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", show);
show();
})();
