"use strict";
// A viewer for posed vehicles in WebGL 1, without libraries. Coordinates are the camera's: x right, y down, z forward.
(() => {
  let errors = 0;
  const body = document.body;
  body.dataset.errors = "0";
  addEventListener("error", () => { body.dataset.errors = String(++errors); });
  const $ = (id) => document.getElementById(id);
  const data = JSON.parse($("data").textContent);
  const canvas = $("canvas");
  const gl = canvas.getContext("webgl", { antialias: true, alpha: false });

  const hash = new URLSearchParams(location.hash.slice(1));
  const state = {
    frame: 0, selected: -1, outside: hash.get("view") !== "camera", playing: 0,
    yaw: 0.5, pitch: 0.45, distance: 25, target: [0, 0, 15],
    zoom: 1, shift: [0, 0],
    hidden: new Set(), show: { models: true, boxes: true, truth: true, image: true, grid: true }, opacity: 1,
  };

  // ---- Matrices: 16 numbers, column by column ------------------------------------------------------------------
  const multiply = (a, b) => {
    const out = new Float32Array(16);
    for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++) {
      let sum = 0;
      for (let k = 0; k < 4; k++) sum += a[k * 4 + r] * b[c * 4 + k];
      out[c * 4 + r] = sum;
    }
    return out;
  };
  const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => { const n = Math.hypot(a[0], a[1], a[2]) || 1; return [a[0] / n, a[1] / n, a[2] / n]; };
  // Takes the vehicle frame, stretched by `scale`, to the camera frame; `r` holds the rotation's rows.
  const placed = (r, t, s) => new Float32Array([
    r[0] * s[0], r[3] * s[0], r[6] * s[0], 0, r[1] * s[1], r[4] * s[1], r[7] * s[1], 0,
    r[2] * s[2], r[5] * s[2], r[8] * s[2], 0, t[0], t[1], t[2], 1]);
  const identity = new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
  const apply = (m, p) => [0, 1, 2, 3].map((r) => m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r]);

  const eye = () => {
    const { yaw, pitch, distance, target } = state;
    const level = distance * Math.cos(pitch);
    return [target[0] - level * Math.sin(yaw), target[1] - distance * Math.sin(pitch), target[2] - level * Math.cos(yaw)];
  };
  const axes = () => {
    const from = eye(), forward = unit(subtract(state.target, from));
    const right = unit(cross([0, 1, 0], forward));
    return { from, forward, right, down: cross(forward, right) };
  };
  const aspect = () => canvas.width / Math.max(1, canvas.height);
  // Clip coordinates of points in the camera frame; depth runs from 0.1 m to 500 m.
  const viewProjection = () => {
    const near = 0.1, far = 500, a = (far + near) / (far - near), b = -2 * far * near / (far - near);
    if (state.outside) {
      const { from, forward, right, down } = axes();
      const view = new Float32Array([
        right[0], down[0], forward[0], 0, right[1], down[1], forward[1], 0, right[2], down[2], forward[2], 0,
        -dot(right, from), -dot(down, from), -dot(forward, from), 1]);
      const f = 1 / Math.tan(0.4);
      return multiply(new Float32Array([f / aspect(), 0, 0, 0, 0, -f, 0, 0, 0, 0, a, 1, 0, 0, b, 0]), view);
    }
    const c = data.frames[state.frame].camera, ratio = c.w / c.h;
    const sx = state.zoom * Math.min(1, ratio / aspect()), sy = state.zoom * Math.min(1, aspect() / ratio);
    return new Float32Array([
      sx * 2 * c.fx / c.w, 0, 0, 0, 0, -sy * 2 * c.fy / c.h, 0, 0,
      sx * (2 * (c.cx + 0.5) / c.w - 1) + state.shift[0], -sy * (2 * (c.cy + 0.5) / c.h - 1) + state.shift[1], a, 1,
      0, 0, b, 0]);
  };

  // ---- Programs and meshes -------------------------------------------------------------------------------------
  const program = (vertex, fragment) => {
    const p = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(p, shader);
    }
    gl.linkProgram(p);
    if (!gl.getProgramParameter(p, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(p));
    const at = (name) => gl.getUniformLocation(p, name);
    return { p, at, attribute: (name) => gl.getAttribLocation(p, name) };
  };
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  let solid, lines, picture, lineBuffer, quadBuffer;
  const meshes = new Map();
  const mesh = (name) => {
    if (meshes.has(name)) return meshes.get(name);
    const model = data.models[name];
    if (!model) return null;
    const positions = new Float32Array(bytes(model.positions));
    const faces = new Uint32Array(bytes(model.faces)), parts = new Uint8Array(bytes(model.parts));
    const flat = new Float32Array(parts.length * 21);
    for (let f = 0; f < parts.length; f++) {
      const corner = [0, 1, 2].map((i) => { const v = 3 * faces[3 * f + i]; return [positions[v], positions[v + 1], positions[v + 2]]; });
      const normal = unit(cross(subtract(corner[1], corner[0]), subtract(corner[2], corner[0])));
      corner.forEach((p, i) => flat.set([...p, ...normal, parts[f]], (3 * f + i) * 7));
    }
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, flat, gl.STATIC_DRAW);
    const made = { buffer, count: parts.length * 3, extent: model.extent };
    meshes.set(name, made);
    return made;
  };
  const textures = new Map();
  const texture = (frame) => {
    if (!frame.image) return null;
    if (textures.has(frame)) return textures.get(frame);
    textures.set(frame, null);
    const image = new Image();
    image.onload = () => {
      const made = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, made);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, gl.RGB, gl.UNSIGNED_BYTE, image);
      for (const wrap of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, wrap, gl.CLAMP_TO_EDGE);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
      textures.set(frame, made);
      draw();
    };
    image.onerror = () => { throw new Error("an image of this page cannot be shown"); };
    image.src = frame.image;
    return null;
  };
  const makePrograms = () => {
    solid = program(
      `attribute vec3 place, normal; attribute float part; uniform mat4 clip, model; uniform vec3 colors[30];
       uniform float visible[30]; uniform vec3 light; varying vec3 color; varying float seen;
       void main() {
         int i = int(part + 0.5); vec3 n = normalize((model * vec4(normal, 0.0)).xyz);
         color = colors[i] * (0.45 + 0.55 * abs(dot(n, light))); seen = visible[i];
         gl_Position = clip * model * vec4(place, 1.0);
       }`,
      `precision mediump float; varying vec3 color; varying float seen; uniform float opacity; uniform vec3 tint;
       void main() { if (seen < 0.5) discard; gl_FragColor = vec4(mix(color, tint, 0.25 * step(0.01, tint.r)), opacity); }`);
    lines = program(
      "attribute vec3 place; uniform mat4 clip; void main() { gl_Position = clip * vec4(place, 1.0); }",
      "precision mediump float; uniform vec4 color; void main() { gl_FragColor = color; }");
    picture = program(
      `attribute vec3 place; attribute vec2 at; uniform mat4 clip; varying vec2 where;
       void main() { where = at; gl_Position = clip * vec4(place, 1.0); }`,
      `precision mediump float; varying vec2 where; uniform sampler2D photo; uniform float opacity;
       void main() { gl_FragColor = vec4(texture2D(photo, where).rgb, opacity); }`);
    lineBuffer = gl.createBuffer();
    quadBuffer = gl.createBuffer();
  };

  // ---- Drawing -------------------------------------------------------------------------------------------------
  const drawLines = (clip, points, color) => {
    gl.useProgram(lines.p);
    gl.bindBuffer(gl.ARRAY_BUFFER, lineBuffer);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(points.flat()), gl.DYNAMIC_DRAW);
    const place = lines.attribute("place");
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 12, 0);
    gl.uniformMatrix4fv(lines.at("clip"), false, clip);
    gl.uniform4fv(lines.at("color"), color);
    gl.drawArrays(gl.LINES, 0, points.length);
  };
  const corners = (vehicle) => {
    const [w, h, l] = vehicle.extent, m = placed(vehicle.rotation, vehicle.translation, [1, 1, 1]);
    return [...Array(8).keys()].map((i) =>
      apply(m, [(i & 1 ? 0.5 : -0.5) * w, i & 2 ? -h : 0, (i & 4 ? 0.5 : -0.5) * l]).slice(0, 3));
  };
  const boxLines = (vehicle) => {
    const c = corners(vehicle), pairs = [];
    for (let i = 0; i < 8; i++) for (const bit of [1, 2, 4]) if (!(i & bit)) pairs.push(c[i], c[i | bit]);
    // A mark on the front face tells where the vehicle looks.
    const middle = (a, b) => [0, 1, 2].map((k) => 0.5 * (a[k] + b[k]));
    pairs.push(c[4], middle(c[6], c[7]), c[5], middle(c[6], c[7]));
    return pairs;
  };
  const imageCorners = (camera, depth) => [[-0.5, -0.5], [camera.w - 0.5, -0.5], [camera.w - 0.5, camera.h - 0.5], [-0.5, camera.h - 0.5]]
    .map(([u, v]) => [(u - camera.cx) / camera.fx * depth, (v - camera.cy) / camera.fy * depth, depth]);
  const drawPicture = (clip, frame, depth, opacity) => {
    const photo = texture(frame);
    if (!photo) return;
    const c = imageCorners(frame.camera, depth);
    const quad = [[...c[0], 0, 0], [...c[1], 1, 0], [...c[2], 1, 1], [...c[0], 0, 0], [...c[2], 1, 1], [...c[3], 0, 1]];
    gl.useProgram(picture.p);
    gl.bindBuffer(gl.ARRAY_BUFFER, quadBuffer);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(quad.flat()), gl.DYNAMIC_DRAW);
    const [place, at] = [picture.attribute("place"), picture.attribute("at")];
    gl.enableVertexAttribArray(place);
    gl.enableVertexAttribArray(at);
    gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 20, 0);
    gl.vertexAttribPointer(at, 2, gl.FLOAT, false, 20, 12);
    gl.bindTexture(gl.TEXTURE_2D, photo);
    gl.uniformMatrix4fv(picture.at("clip"), false, clip);
    gl.uniform1f(picture.at("opacity"), opacity);
    gl.drawArrays(gl.TRIANGLES, 0, 6);
    gl.disableVertexAttribArray(at);
  };
  const drawModel = (clip, vehicle, chosen) => {
    const found = mesh(vehicle.model);
    if (!found) return;
    const scale = [0, 1, 2].map((i) => vehicle.extent[i] / found.extent[i]);
    gl.useProgram(solid.p);
    gl.bindBuffer(gl.ARRAY_BUFFER, found.buffer);
    [["place", 3, 0], ["normal", 3, 12], ["part", 1, 24]].forEach(([name, size, offset]) => {
      const at = solid.attribute(name);
      gl.enableVertexAttribArray(at);
      gl.vertexAttribPointer(at, size, gl.FLOAT, false, 28, offset);
    });
    gl.uniformMatrix4fv(solid.at("clip"), false, clip);
    gl.uniformMatrix4fv(solid.at("model"), false, placed(vehicle.rotation, vehicle.translation, scale));
    const colors = new Float32Array(90).fill(0.6), visible = new Float32Array(30).fill(1);
    for (const part of data.parts) {
      colors.set(part.color.map((value) => value / 255), part.id * 3);
      if (state.hidden.has(part.id)) visible[part.id] = 0;
    }
    gl.uniform3fv(solid.at("colors"), colors);
    gl.uniform1fv(solid.at("visible"), visible);
    gl.uniform3fv(solid.at("light"), unit([0.35, -0.8, -0.5]));
    gl.uniform3fv(solid.at("tint"), chosen ? [1, 1, 1] : [0, 0, 0]);
    gl.uniform1f(solid.at("opacity"), state.opacity);
    gl.drawArrays(gl.TRIANGLES, 0, found.count);
    ["normal", "part"].forEach((name) => gl.disableVertexAttribArray(solid.attribute(name)));
  };
  const ground = (frame) => {
    const heights = [...frame.vehicles, ...frame.truths].map((v) => v.translation[1]).sort((a, b) => a - b);
    return heights.length ? heights[heights.length >> 1] : 1.6;
  };
  const grid = (frame) => {
    const y = ground(frame), points = [];
    for (let x = -30; x <= 30; x += 5) points.push([x, y, 0], [x, y, 80]);
    for (let z = 0; z <= 80; z += 5) points.push([-30, y, z], [30, y, z]);
    return points;
  };
  const draw = () => {
    if (!solid) return;
    const width = canvas.clientWidth * devicePixelRatio | 0, height = canvas.clientHeight * devicePixelRatio | 0;
    if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
    const frame = data.frames[state.frame], clip = viewProjection(), { show } = state;
    gl.viewport(0, 0, width, height);
    gl.clearColor(0.086, 0.094, 0.114, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.disable(gl.DEPTH_TEST);
    if (!state.outside && show.image) drawPicture(clip, frame, 10, 1);
    if (state.outside && show.grid) drawLines(clip, grid(frame), [0.35, 0.38, 0.44, 0.6]);
    gl.enable(gl.DEPTH_TEST);
    if (show.models) frame.vehicles.forEach((vehicle, i) => drawModel(clip, vehicle, i === state.selected));
    if (show.boxes) frame.vehicles.forEach((vehicle, i) =>
      drawLines(clip, boxLines(vehicle), i === state.selected ? [1, 0.84, 0.04, 1] : [1, 1, 1, 0.9]));
    if (show.truth) frame.truths.forEach((truth) => drawLines(clip, boxLines(truth), [0.24, 0.94, 0.4, 1]));
    if (state.outside) {
      const c = imageCorners(frame.camera, 3), o = [0, 0, 0];
      drawLines(clip, [o, c[0], o, c[1], o, c[2], o, c[3], c[0], c[1], c[1], c[2], c[2], c[3], c[3], c[0]], [0.5, 0.75, 1, 1]);
      if (show.image) drawPicture(clip, frame, 3, 0.85);
    }
    labels(clip, frame);
  };
  const labels = (clip, frame) => {
    const holder = $("labels");
    holder.textContent = "";
    frame.vehicles.forEach((vehicle, i) => {
      const top = [...vehicle.translation], r = vehicle.rotation, h = vehicle.extent[1] + 0.3;
      [0, 1, 2].forEach((k) => { top[k] -= r[3 * k + 1] * h; });
      const [x, y, , w] = apply(clip, top);
      if (w < 0.1) return;
      const label = document.createElement("span");
      label.textContent = String(i + 1);
      label.className = i === state.selected ? "chosen" : "";
      label.style.left = `${(x / w * 0.5 + 0.5) * canvas.clientWidth}px`;
      label.style.top = `${(0.5 - y / w * 0.5) * canvas.clientHeight}px`;
      holder.append(label);
    });
  };

  // ---- Picking: the nearest cuboid on the ray through a point of the canvas --------------------------------------
  const ray = (x, y) => {
    const nx = 2 * x / canvas.clientWidth - 1, ny = 1 - 2 * y / canvas.clientHeight;
    if (state.outside) {
      const { from, forward, right, down } = axes(), t = Math.tan(0.4);
      return { from, along: [0, 1, 2].map((k) => forward[k] + nx * t * aspect() * right[k] - ny * t * down[k]) };
    }
    const m = viewProjection();
    return { from: [0, 0, 0], along: [(nx - m[8]) / m[0], (ny - m[9]) / m[5], 1] };
  };
  const pick = (x, y) => {
    const { from, along } = ray(x, y);
    let best = -1, nearest = Infinity;
    data.frames[state.frame].vehicles.forEach((vehicle, i) => {
      const r = vehicle.rotation, [w, h, l] = vehicle.extent, o = subtract(from, vehicle.translation);
      const inside = (v) => [0, 1, 2].map((k) => r[k] * v[0] + r[3 + k] * v[1] + r[6 + k] * v[2]);
      const [p, d] = [inside(o), inside(along)], low = [-w / 2, -h, -l / 2], high = [w / 2, 0, l / 2];
      let [enter, leave] = [0, Infinity];
      for (let k = 0; k < 3; k++) {
        const [a, b] = [(low[k] - p[k]) / d[k], (high[k] - p[k]) / d[k]];
        enter = Math.max(enter, Math.min(a, b));
        leave = Math.min(leave, Math.max(a, b));
      }
      if (enter <= leave && enter < nearest) { nearest = enter; best = i; }
    });
    return best;
  };

  // ---- Panels --------------------------------------------------------------------------------------------------
  const row = (table, name, value) => {
    const line = table.insertRow();
    line.insertCell().textContent = name;
    line.insertCell().textContent = value;
  };
  const panel = () => {
    const frame = data.frames[state.frame], list = $("vehicles");
    $("name").textContent = `${frame.name} (${state.frame + 1} of ${data.frames.length})`;
    $("slider").value = String(state.frame);
    list.textContent = "";
    frame.vehicles.forEach((vehicle, i) => {
      const button = document.createElement("button");
      button.textContent = `${i + 1} ${vehicle.model}, ${Math.hypot(...vehicle.translation).toFixed(1)} m`;
      button.setAttribute("aria-pressed", String(i === state.selected));
      button.onclick = () => select(i === state.selected ? -1 : i);
      list.append(button);
    });
    if (!frame.vehicles.length) list.textContent = "no vehicle";
    const table = $("facts"), vehicle = frame.vehicles[state.selected];
    table.textContent = "";
    if (vehicle) vehicle.facts.forEach(([name, value]) => row(table, name, value));
    $("hint").hidden = Boolean(vehicle);
    body.dataset.frame = String(state.frame);
    body.dataset.selected = String(state.selected);
  };
  const select = (i) => { state.selected = i; panel(); draw(); };
  const goto = (i) => {
    state.frame = Math.max(0, Math.min(data.frames.length - 1, i));
    state.selected = -1;
    panel();
    draw();
  };
  const home = () => {
    const places = data.frames[state.frame].vehicles.map((v) => v.translation);
    const mean = (k) => places.reduce((sum, p) => sum + p[k], 0) / Math.max(1, places.length);
    // Far enough behind to see the camera too.
    state.target = places.length ? [0.5 * mean(0), mean(1), 0.5 * mean(2)] : [0, 1, 6];
    state.distance = Math.max(12, 1.9 * state.target[2]);
    [state.yaw, state.pitch, state.zoom, state.shift] = [-0.7, 0.5, 1, [0, 0]];
  };
  const setView = (outside) => {
    state.outside = outside;
    $("outside").setAttribute("aria-pressed", String(outside));
    $("inside").setAttribute("aria-pressed", String(!outside));
    home();
    draw();
  };
  const controls = () => {
    const slider = $("slider");
    slider.max = String(data.frames.length - 1);
    $("time").hidden = data.frames.length < 2;
    slider.oninput = () => goto(Number(slider.value));
    $("play").onclick = () => {
      if (state.playing) { clearInterval(state.playing); state.playing = 0; }
      else state.playing = setInterval(() => goto((state.frame + 1) % data.frames.length), 200);
      $("play").textContent = state.playing ? "Stop" : "Play";
    };
    $("outside").onclick = () => setView(true);
    $("inside").onclick = () => setView(false);
    for (const name of Object.keys(state.show)) $(`show-${name}`).onchange = (event) => { state.show[name] = event.target.checked; draw(); };
    $("opacity").oninput = (event) => { state.opacity = Number(event.target.value); draw(); };
    const used = new Set();
    for (const model of Object.values(data.models)) new Uint8Array(bytes(model.parts)).forEach((part) => used.add(part));
    const boxes = data.parts.filter((part) => used.has(part.id)).map((part) => {
      const label = document.createElement("label"), box = document.createElement("input"), swatch = document.createElement("i");
      box.type = "checkbox";
      box.checked = true;
      box.onchange = () => { if (box.checked) state.hidden.delete(part.id); else state.hidden.add(part.id); draw(); };
      swatch.style.background = `rgb(${part.color.join(",")})`;
      label.append(box, swatch, part.name);
      $("parts").append(label);
      return box;
    });
    const all = (checked) => { for (const box of boxes) { box.checked = checked; box.onchange(); } };
    $("parts-all").onclick = () => all(true);
    $("parts-none").onclick = () => all(false);
  };
  const pointer = () => {
    let last = null, moved = 0;
    canvas.onpointerdown = (event) => { last = [event.clientX, event.clientY]; moved = 0; canvas.setPointerCapture(event.pointerId); };
    canvas.onpointermove = (event) => {
      if (!last) return;
      const [dx, dy] = [event.clientX - last[0], event.clientY - last[1]];
      last = [event.clientX, event.clientY];
      moved += Math.abs(dx) + Math.abs(dy);
      if (!state.outside) {
        state.shift = [state.shift[0] + 2 * dx / canvas.clientWidth, state.shift[1] - 2 * dy / canvas.clientHeight];
      } else if (event.shiftKey || event.buttons & 2) {
        const { right, down } = axes(), step = state.distance / canvas.clientHeight;
        state.target = state.target.map((value, k) => value - step * (dx * right[k] + dy * down[k]));
      } else {
        state.yaw += 0.006 * dx;
        state.pitch = Math.max(-0.2, Math.min(1.55, state.pitch + 0.006 * dy));
      }
      draw();
    };
    canvas.onpointerup = (event) => {
      if (last && moved < 4) {
        const area = canvas.getBoundingClientRect();
        select(pick(event.clientX - area.left, event.clientY - area.top));
      }
      last = null;
    };
    canvas.onpointercancel = () => { last = null; };
    canvas.oncontextmenu = (event) => event.preventDefault();
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const factor = Math.exp(0.001 * event.deltaY);
      if (state.outside) state.distance = Math.max(1, Math.min(300, state.distance * factor));
      else state.zoom = Math.max(0.5, Math.min(30, state.zoom / factor));
      draw();
    }, { passive: false });
    addEventListener("keydown", (event) => {
      if (event.target instanceof HTMLInputElement && event.target.type === "range") return;
      if (event.key === "ArrowRight") goto(state.frame + 1);
      if (event.key === "ArrowLeft") goto(state.frame - 1);
      if (event.key === "c") setView(!state.outside);
    });
    addEventListener("resize", draw);
  };

  controls();
  goto(Number(hash.get("frame")) || 0);
  function start() {
    if (!gl) {
      $("no-webgl").hidden = false;
      body.dataset.state = "no-webgl";
      return;
    }
    makePrograms();
    pointer();
    setView(state.outside);
    if (hash.has("select")) select(Number(hash.get("select")));
    body.dataset.state = "ready";
  }
  start();
})();
