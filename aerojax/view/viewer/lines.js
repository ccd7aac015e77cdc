// Lines of any width in pixels with round ends, smooth edges and dashes: WebGL's own are one pixel wide.
const LINE_FLOATS = 12; // from, to, premultiplied colour, width, dash

const LINE_VERTEX = `
layout(location = 0) in vec2 corner;
layout(location = 1) in vec3 from;
layout(location = 2) in vec3 to;
layout(location = 3) in vec4 tint;
layout(location = 4) in vec2 pen;
uniform mat3 rotation;
uniform vec3 offset;
uniform mat4 clipFromCamera;
uniform vec2 viewport;
uniform float near, ratio;
out vec2 place;
flat out vec4 colour;
flat out vec3 shape;
vec3 screen(vec3 p) {
  vec4 clip = clipFromCamera * vec4(p, 1.0);
  return vec3((clip.xy / clip.w * 0.5 + 0.5) * viewport, clip.z / clip.w);
}
void main() {
  vec3 p = rotation * from + offset, q = rotation * to + offset;
  gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
  float least = 1.001 * near;
  if (max(p.z, q.z) <= least) return;
  if (p.z < least) p = mix(p, q, (least - p.z) / (q.z - p.z));
  else if (q.z < least) q = mix(q, p, (least - q.z) / (p.z - q.z));
  vec3 a = screen(p), b = screen(q);
  float span = length(b.xy - a.xy), half_width = 0.5 * pen.x * ratio, margin = half_width + 1.0;
  vec2 along = span > 1e-3 ? (b.xy - a.xy) / span : vec2(1.0, 0.0);
  place = vec2(corner.x < 0.0 ? -margin : span + margin, corner.y * margin);
  vec2 pixel = a.xy + along * place.x + vec2(-along.y, along.x) * place.y;
  float depth = mix(a.z, b.z, clamp(place.x / max(span, 1e-3), 0.0, 1.0));
  gl_Position = vec4(2.0 * pixel / viewport - 1.0, depth, 1.0);
  shape = vec3(span, half_width, pen.y * ratio);
  colour = tint;
}`;

const LINE_FRAGMENT = `
in vec2 place;
flat in vec4 colour;
flat in vec3 shape;
out vec4 pixel;
void main() {
  float beyond = max(max(-place.x, place.x - shape.x), 0.0);
  float cover = clamp(shape.y + 0.5 - length(vec2(beyond, place.y)), 0.0, 1.0);
  if (shape.z > 0.0) cover *= step(mod(place.x, shape.z), 0.6 * shape.z);
  if (cover < 0.02) discard;
  pixel = colour * cover;
}`;

class LineLayer {
  constructor(gl) {
    this.gl = gl;
    this.count = 0;
    Object.assign(this, makeProgram(gl, LINE_VERTEX, LINE_FRAGMENT));
    this.vao = gl.createVertexArray();
    gl.bindVertexArray(this.vao);
    bindCorners(gl);
    this.buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    [[1, 3, 0], [2, 3, 3], [3, 4, 6], [4, 2, 10]].forEach(([slot, size, start]) => {
      gl.enableVertexAttribArray(slot);
      gl.vertexAttribPointer(slot, size, gl.FLOAT, false, 4 * LINE_FLOATS, 4 * start);
      gl.vertexAttribDivisor(slot, 1);
    });
  }

  set(lines) {
    const gl = this.gl;
    this.count = lines.length;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(lines.flat()), gl.DYNAMIC_DRAW);
  }

  draw(eye, width, height, ratio) {
    if (!this.count) return;
    const gl = this.gl;
    gl.useProgram(this.program);
    gl.bindVertexArray(this.vao);
    useEye(gl, this.uniforms, eye, eye.offset, width, height);
    gl.uniform1f(this.uniforms.ratio, ratio);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, this.count);
  }
}

// One line: colour is red, green, blue in 0..1, alpha its opacity; width and dash in CSS pixels.
function line(from, to, [r, g, b], alpha, width, dash = 0) {
  return [...from, ...to, r * alpha, g * alpha, b * alpha, alpha, width, dash];
}
