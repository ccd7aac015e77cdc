// 3D Gaussian splatting: projected covariances (Zwicker et al. 2001), drawn from far to near (Kerbl et al. 2023).
const SPLAT_ROW = 256; // Gaussians a row of the texture; each is 4 texels wide

const SPLAT_VERTEX = `
layout(location = 0) in vec2 corner;
layout(location = 1) in uint index;
uniform highp sampler2D splats;
uniform mat3 rotation;
uniform vec3 offset;
uniform mat4 clipFromCamera;
uniform vec2 viewport, focal, limit;
uniform float near;
out vec2 place;
flat out vec4 colour;
void main() {
  ivec2 texel = ivec2(4 * (int(index) % ${SPLAT_ROW}), int(index) / ${SPLAT_ROW});
  vec4 a = texelFetch(splats, texel, 0), b = texelFetch(splats, texel + ivec2(1, 0), 0);
  vec4 c = texelFetch(splats, texel + ivec2(2, 0), 0);
  vec3 mean = rotation * a.xyz + offset;
  gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
  if (mean.z <= near) return;
  mat3 world = mat3(b.x, b.y, b.z, b.y, b.w, c.x, b.z, c.x, c.y);
  mat3 covariance = rotation * world * transpose(rotation);
  vec2 ratio = clamp(mean.xy / mean.z, -limit, limit);
  vec3 jx = vec3(focal.x, 0.0, -focal.x * ratio.x) / mean.z, jy = vec3(0.0, focal.y, -focal.y * ratio.y) / mean.z;
  float xx = dot(jx, covariance * jx) + 0.3, yy = dot(jy, covariance * jy) + 0.3, xy = dot(jx, covariance * jy);
  float middle = 0.5 * (xx + yy), radius = length(vec2(0.5 * (xx - yy), xy));
  float large = middle + radius, small = max(middle - radius, 0.1);
  vec2 axis = abs(xy) > 1e-6 ? normalize(vec2(xy, large - xx)) : (xx >= yy ? vec2(1.0, 0.0) : vec2(0.0, 1.0));
  float reach = sqrt(2.0 * max(log(255.0 * a.w), 0.0)); // where the opacity falls below one step of a byte
  place = reach * corner;
  vec2 pixels = place.x * sqrt(large) * axis + place.y * sqrt(small) * vec2(-axis.y, axis.x);
  vec4 clip = clipFromCamera * vec4(mean, 1.0);
  gl_Position = clip + vec4(vec2(2.0, -2.0) * pixels / viewport * clip.w, 0.0, 0.0);
  vec4 d = texelFetch(splats, texel + ivec2(3, 0), 0);
  colour = vec4(d.rgb, a.w);
}`;

const SPLAT_FRAGMENT = `
in vec2 place;
flat in vec4 colour;
uniform float strength;
out vec4 pixel;
void main() {
  float alpha = min(0.99, colour.a * exp(-0.5 * dot(place, place)));
  if (alpha < 1.0 / 255.0) discard;
  pixel = vec4(colour.rgb, 1.0) * alpha * strength;
}`;

function halfToFloat(h) {
  const sign = h & 0x8000 ? -1 : 1, exponent = (h >> 10) & 31, fraction = h & 1023;
  return exponent ? sign * 2 ** (exponent - 15) * (1 + fraction / 1024) : sign * 2 ** -14 * (fraction / 1024);
}

// From the page's base64 (ten half floats a Gaussian, then four bytes each) to mean, opacity, covariance, colour.
function unpackSplats(text) {
  const bytes = Uint8Array.from(atob(text), c => c.charCodeAt(0)), count = bytes.length / 24;
  const halves = new DataView(bytes.buffer), rows = Math.max(1, Math.ceil(count / SPLAT_ROW));
  const values = new Float32Array(rows * SPLAT_ROW * 16);
  for (let i = 0; i < count; i++) {
    const v = Array.from({ length: 10 }, (_, k) => halfToFloat(halves.getUint16(20 * i + 2 * k, true)));
    const level = bytes.subarray(20 * count + 4 * i, 20 * count + 4 * i + 4);
    values.set([...v.slice(0, 3), level[3] / 255, ...covarianceOf(v.slice(3, 7), v.slice(7, 10)), 0, 0,
      level[0] / 255, level[1] / 255, level[2] / 255, 1], 16 * i);
  }
  return { count, rows, values };
}

// xx, xy, xz, yy, yz, zz of R S S R'.
function covarianceOf([w0, x0, y0, z0], s) {
  const n = 1 / (Math.hypot(w0, x0, y0, z0) || 1), w = w0 * n, x = x0 * n, y = y0 * n, z = z0 * n;
  const m = [
    [(1 - 2 * (y * y + z * z)) * s[0], 2 * (x * y - w * z) * s[1], 2 * (x * z + w * y) * s[2]],
    [2 * (x * y + w * z) * s[0], (1 - 2 * (x * x + z * z)) * s[1], 2 * (y * z - w * x) * s[2]],
    [2 * (x * z - w * y) * s[0], 2 * (y * z + w * x) * s[1], (1 - 2 * (x * x + y * y)) * s[2]],
  ];
  return [dot(m[0], m[0]), dot(m[0], m[1]), dot(m[0], m[2]), dot(m[1], m[1]), dot(m[1], m[2]), dot(m[2], m[2])];
}

class SplatLayer {
  constructor(gl) {
    this.gl = gl;
    Object.assign(this, makeProgram(gl, SPLAT_VERTEX, SPLAT_FRAGMENT));
    this.vao = gl.createVertexArray();
    gl.bindVertexArray(this.vao);
    bindCorners(gl);
    this.order = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.order);
    gl.enableVertexAttribArray(1);
    gl.vertexAttribIPointer(1, 1, gl.UNSIGNED_INT, 0, 0);
    gl.vertexAttribDivisor(1, 1);
    this.texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, side, gl.NEAREST);
    this.splats = null;
  }

  set(splats) {
    if (this.splats === splats) return;
    const gl = this.gl;
    this.splats = splats;
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, 4 * SPLAT_ROW, splats.rows, 0, gl.RGBA, gl.FLOAT, splats.values);
  }

  // Indices from far to near.
  sorted(eye) {
    const { count, values } = this.splats, [a, b, c] = eye.rotation.slice(6);
    const depth = Float32Array.from({ length: count }, (_, i) =>
      a * values[16 * i] + b * values[16 * i + 1] + c * values[16 * i + 2]);
    return Uint32Array.from(depth.keys()).sort((i, j) => depth[j] - depth[i]);
  }

  // `centre` is where the Gaussians' own origin lies in the scene, `strength` fades them.
  draw(eye, centre, width, height, strength) {
    if (!this.splats || !this.splats.count) return;
    const gl = this.gl, [fx, fy] = eye.lens;
    gl.useProgram(this.program);
    gl.bindVertexArray(this.vao);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.order);
    gl.bufferData(gl.ARRAY_BUFFER, this.sorted(eye), gl.DYNAMIC_DRAW);
    useEye(gl, this.uniforms, eye, add(turn(eye.rotation, centre), eye.offset), width, height);
    gl.uniform2f(this.uniforms.focal, fx, fy);
    gl.uniform2f(this.uniforms.limit, 0.65 * width / fx, 0.65 * height / fy);
    gl.uniform1f(this.uniforms.strength, strength);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.depthMask(false);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, this.splats.count);
    gl.depthMask(true);
  }
}
