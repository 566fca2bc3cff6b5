// SPDX-License-Identifier: Apache-2.0
// GLSL of the points and of the eye-dome lighting.

/** What a point is coloured by; the numbers that the shader knows. */
export const kColourModes = { plain: 0, rgb: 1, normal: 2, height: 3, displacement: 4, scalar: 5, texture: 6 } as const;

// The light that falls on a surface that faces along n, in the eye's coordinates.
const kLight = /* glsl */ `
float light(vec3 n) {
  float key = max(dot(n, normalize(vec3(-0.45, 0.55, 0.70))), 0.0);
  float fill = max(dot(n, normalize(vec3(0.75, -0.15, 0.45))), 0.0);
  return mix(1.0, 0.18 + 0.78 * key + 0.22 * fill, uShade);
}
vec3 dimmed(vec3 colour) { return mix(vec3(dot(colour, vec3(0.3, 0.59, 0.11))), vec3(0.10, 0.12, 0.15), 0.55); }
`;

/** Of points, and with FACES of the corners of faces, whose light each pixel has itself. */
export const pointVertex = /* glsl */ `
precision highp float;
in vec3 position;
in float along;      // steps along the motion normal
in vec2 motion;      // octahedral
in vec3 move;        // steps
in vec3 far_move;    // file units: displacements that no steps can say
in vec2 normal_before, normal_after;
#ifdef FACES
in vec4 face_before, face_after;
out vec3 vAt, vView, vNormal;
out float vInside;
#ifdef PICTURE
in vec2 in_picture;  // 0, 0 is its lower left corner
out vec2 vInPicture;
#endif
#endif
in vec3 rgb;
in float scalar;
in float inside;     // 1 where the limits let a point move

uniform mat4 modelViewMatrix, projectionMatrix;
uniform float uAfter;         // 0 the original, 1 the result, more: displacements are that much longer
uniform int uMotion;          // 0 none, 1 along normals, 2 vectors, 3 far vectors
uniform float uStep, uPointSize, uPixelsPerUnit, uMinSize, uMaxSize, uShade;
uniform int uColour;
uniform vec2 uRange;          // of the scalar, the height or the displacement
uniform vec3 uHeightAxis;
uniform sampler2D uMap;
uniform vec3 uBoxMin, uBoxMax;
uniform bool uHide, uHasNormals, uDim;
uniform vec4 uHole;           // center and radius of a ball whose points others stand for; radius below 0: none
out vec3 vColour;

vec3 oct(vec2 e) {
  if (e.x < -32767.5) return vec3(0.0);
  e /= 32767.0;
  vec3 n = vec3(e, 1.0 - abs(e.x) - abs(e.y));
  if (n.z < 0.0) n.xy = (1.0 - abs(n.yx)) * vec2(n.x < 0.0 ? -1.0 : 1.0, n.y < 0.0 ? -1.0 : 1.0);
  return normalize(n);
}

vec3 displacement() {
  if (uMotion == 1) return oct(motion) * along * uStep;
  if (uMotion == 2) return move * uStep;
  if (uMotion == 3) return far_move;
  return vec3(0.0);
}

${kLight}
vec3 mapped(float value) { return texture(uMap, vec2(clamp(value, 0.0, 1.0) * 255.0 / 256.0 + 0.5 / 256.0, 0.5)).rgb; }
float share(float value) { return (value - uRange.x) / max(uRange.y - uRange.x, 1e-30); }

void main() {
  vec3 d = displacement();
  vec3 at = position + uAfter * d;
  vec4 view = modelViewMatrix * vec4(at, 1.0);
  gl_Position = projectionMatrix * view;
  gl_PointSize = clamp(uPointSize * uPixelsPerUnit / max(-view.z, 1e-20), max(uMinSize, 1.0), uMaxSize);
  bool finite = all(lessThan(abs(position), vec3(1e37)));
#ifdef FACES
  vAt = at;
  vView = view.xyz;
  vNormal = (modelViewMatrix * vec4(uAfter > 0.5 ? face_after.xyz : face_before.xyz, 0.0)).xyz;
  vInside = inside;
#ifdef PICTURE
  vInPicture = in_picture;
#endif
#else
  bool replaced = distance(position, uHole.xyz) <= uHole.w;
  if (!finite || replaced || (uHide && (any(lessThan(at, uBoxMin)) || any(greaterThan(at, uBoxMax))))) {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    gl_PointSize = 1.0;
  }
#endif

  vec3 n = oct(uAfter > 0.5 ? normal_after : normal_before);
  vec3 seen = (modelViewMatrix * vec4(n, 0.0)).xyz;
  if (dot(seen, view.xyz) > 0.0) seen = -seen;

  vec3 base = vec3(0.78, 0.80, 0.82);
  if (uColour == 1) base = rgb;
  if (uColour == 2) base = 0.5 + 0.5 * n * (dot(seen, (modelViewMatrix * vec4(n, 0.0)).xyz) < 0.0 ? -1.0 : 1.0);
  if (uColour == 3) base = mapped(share(dot(at, uHeightAxis)));
  if (uColour == 4) {
    vec3 toward = (modelViewMatrix * vec4(d, 0.0)).xyz;
    base = mapped(share(length(d) * (dot(toward, view.xyz) < 0.0 ? 1.0 : -1.0)));
  }
  if (uColour == 5) base = isnan(scalar) ? vec3(0.35) : mapped(share(scalar));

#ifdef FACES
  vColour = base;
#else
  vColour = base * (uHasNormals && dot(n, n) > 0.5 ? light(seen) : 1.0);
  if (uDim && inside < 0.5) vColour = dimmed(vColour);
#endif
}
`;

export const pointFragment = /* glsl */ `
precision mediump float;
in vec3 vColour;
out vec4 colour;
void main() {
#ifdef ROUND  // a discard costs the early depth test
  vec2 c = gl_PointCoord - 0.5;
  if (dot(c, c) > 0.25) discard;
#endif
  colour = vec4(vColour, 1.0);
}
`;

export const faceFragment = /* glsl */ `
precision highp float;
in vec3 vColour, vAt, vView, vNormal;
in float vInside;
uniform float uShade, uTone;
uniform bool uSmooth, uHide, uDim;
uniform vec3 uBoxMin, uBoxMax;
#ifdef PICTURE
uniform highp int uColour;
uniform sampler2D uPicture;
in vec2 vInPicture;
#endif
out vec4 colour;
${kLight}
void main() {
  if (uHide && (any(lessThan(vAt, uBoxMin)) || any(greaterThan(vAt, uBoxMax)))) discard;
#ifdef LINES
  vec3 base = vColour;
#else
  vec3 its = vColour;
#ifdef PICTURE  // its first row is the upper one
  if (uColour == 6) its = texture(uPicture, vec2(vInPicture.x, 1.0 - vInPicture.y)).rgb;
#endif
  bool smoothly = uSmooth && dot(vNormal, vNormal) > 0.01;
  vec3 n = normalize(smoothly ? vNormal : cross(dFdx(vView), dFdy(vView)));
  vec3 base = its * light(dot(n, vView) > 0.0 ? -n : n) * uTone;
#endif
  colour = vec4(uDim && vInside < 0.5 ? dimmed(base) : base, 1.0);
}
`;

export const screenVertex = /* glsl */ `
in vec3 position;
void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }
`;

// Eye-dome lighting (Boucheny 2009): a pixel is darkened by how far its neighbours stand in front of it, as a share of the
// distance, so that it works alike at any scale. Left and right of the divider are different pictures.
export const screenFragment = /* glsl */ `
precision highp float;
uniform sampler2D uColourImage;
uniform highp sampler2D uDepthImage;
uniform vec2 uSize, uNearFar;
uniform float uStrength, uRadius, uDivider, uFineness;  // uFineness: pixels of the image a pixel of the screen
out vec4 colour;

float depthAt(ivec2 pixel) { return texelFetch(uDepthImage, pixel, 0).r; }
float distanceOf(float depth) { return uNearFar.x * uNearFar.y / (uNearFar.y - depth * (uNearFar.y - uNearFar.x)); }

float front(ivec2 pixel, ivec2 step, float here) {
  ivec2 other = clamp(pixel + step, ivec2(0), ivec2(uSize) - 1);
  if ((float(other.x) < uDivider) != (float(pixel.x) < uDivider)) return 0.0;
  return max(0.0, 1.0 - distanceOf(depthAt(other)) * here);
}

void main() {
  ivec2 pixel = ivec2(gl_FragCoord.xy * uFineness);
  float depth = depthAt(pixel);
  if (depth >= 1.0) {
    vec2 place = gl_FragCoord.xy * uFineness / uSize - vec2(0.5, 0.58);
    vec3 back = mix(vec3(0.105, 0.125, 0.150), vec3(0.043, 0.053, 0.066), clamp(2.2 * dot(place, place), 0.0, 1.0));
    colour = vec4(back, 1.0);
    return;
  }
  float shade = 1.0;
  if (uStrength > 0.0) {
    float here = 1.0 / distanceOf(depth);
    int r = int(uRadius), q = int(0.7 * uRadius + 0.5);
    float sum = front(pixel, ivec2(r, 0), here) + front(pixel, ivec2(-r, 0), here) + front(pixel, ivec2(0, r), here) +
                front(pixel, ivec2(0, -r), here) + front(pixel, ivec2(q, q), here) + front(pixel, ivec2(-q, q), here) +
                front(pixel, ivec2(q, -q), here) + front(pixel, ivec2(-q, -q), here);
    shade = exp(-110.0 * uStrength * sum / 8.0);
  }
  colour = vec4(texelFetch(uColourImage, pixel, 0).rgb * shade, 1.0);
}
`;
