"use strict";
// The page of `stc steer`: draws the motion by WebGL, sends what is dragged, and shows each new motion as it comes.
(() => {
  const $ = (id) => document.getElementById(id);
  const stage = $("stage"), canvas = $("view"), handles = $("handles");
  const gl = canvas.getContext("webgl2", { antialias: true });
  const lose = (text) => { $("lost").textContent = text; $("lost").hidden = !text; };
  if (!gl) lose("This browser offers no WebGL, which the picture is drawn with. The sliders work all the same.");

  // ------------------------------------------------------------------ small linear algebra: columns, as WebGL has them
  const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => { const l = Math.hypot(...a) || 1; return a.map((x) => x / l); };
  const times = (a, b) => {
    const c = new Float32Array(16);
    for (let i = 0; i < 4; i++) for (let j = 0; j < 4; j++)
      for (let k = 0; k < 4; k++) c[4 * j + i] += a[4 * k + i] * b[4 * j + k];
    return c;
  };
  const rigid = (p, q) => {
    const [w, x, y, z] = q;
    return new Float32Array([
      1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y), 0,
      2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x), 0,
      2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y), 0,
      p[0], p[1], p[2], 1]);
  };

  // ------------------------------------------------------------------ what is shown
  let scene = null, motion = null, state = {}, meshes = [], paths = [];
  let selected = null, playing = true, time = 0, last = 0, held = null, dirty = true;
  const camera = { centre: [0, 0, 0.3], distance: 2.5, azimuth: 90, elevation: -12, found: false };
  // Milliseconds from a change until its motion, or a later one's, was drawn: read by the measurement.
  const steering = (window.steering = { latencies: [], received: [], solved: [], motions: 0, sent: 0, errors: [] });
  const asked = new Map();
  window.addEventListener("error", (event) => steering.errors.push(String(event.message)));

  // ------------------------------------------------------------------ WebGL
  const program = gl && (() => {
    const make = (kind, text) => {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      return shader;
    };
    const made = gl.createProgram();
    gl.attachShader(made, make(gl.VERTEX_SHADER, `#version 300 es
      layout(location = 0) in vec3 vertex; layout(location = 1) in vec3 normal;
      uniform mat4 place, view; out vec3 n, p;
      void main() { vec4 w = place * vec4(vertex, 1.0); p = w.xyz; n = mat3(place) * normal; gl_Position = view * w; }`));
    gl.attachShader(made, make(gl.FRAGMENT_SHADER, `#version 300 es
      precision highp float; in vec3 n, p; uniform vec4 colour; uniform vec3 eye; uniform int kind; out vec4 result;
      void main() {
        vec3 m = normalize(n); if (dot(m, eye - p) < 0.0) m = -m;
        float light = 0.42 + 0.45 * max(0.0, dot(m, normalize(vec3(-0.35, -0.55, 0.9)))) + 0.18 * max(0.0, dot(m, normalize(eye - p)));
        vec4 c = colour;
        if (kind == 1) { vec2 f = fract(p.xy / 0.4); bool odd = (f.x < 0.5) != (f.y < 0.5);
          c.rgb *= odd ? 0.93 : 1.0; c.a *= 1.0 - smoothstep(3.0, 6.0, length(p.xy - eye.xy)); }
        result = kind == 2 ? c : vec4(c.rgb * light, c.a); }`));
    gl.linkProgram(made);
    const at = {};
    for (const name of ["place", "view", "colour", "eye", "kind"]) at[name] = gl.getUniformLocation(made, name);
    return { made, at };
  })();
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  const upload = (vertices, normals, faces) => {
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    [vertices, normals].forEach((values, slot) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(slot);
      gl.vertexAttribPointer(slot, 3, gl.FLOAT, false, 0, 0);
    });
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    return { array, count: faces.length };
  };
  const trail = gl && (() => {
    const array = gl.createVertexArray(), buffer = gl.createBuffer();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.vertexAttrib3f(1, 0, 0, 1);
    gl.bindVertexArray(null);
    return { array, buffer };
  })();

  const look = () => {
    const width = stage.clientWidth, height = stage.clientHeight - $("time").offsetHeight;
    const a = camera.azimuth * Math.PI / 180, e = camera.elevation * Math.PI / 180;
    const ahead = [Math.cos(a) * Math.cos(e), Math.sin(a) * Math.cos(e), Math.sin(e)];
    const right = [Math.sin(a), -Math.cos(a), 0], up = cross(right, ahead);
    const eye = add(camera.centre, ahead, -camera.distance);
    const slope = Math.tan(22.5 * Math.PI / 180) * Math.max(1, 0.9 * height / Math.max(1, width));
    return { width, height, ahead, right, up, eye, slope };
  };
  const project = (p, v) => {
    const r = sub(p, v.eye), depth = dot(r, v.ahead), scale = v.height / (2 * v.slope * depth);
    return [v.width / 2 + dot(r, v.right) * scale, v.height / 2 - dot(r, v.up) * scale, depth];
  };
  const ray = (x, y, v) => {
    const s = 2 * v.slope / v.height;
    return unit(add(add(v.ahead, v.right, (x - v.width / 2) * s), v.up, -(y - v.height / 2) * s));
  };

  const pose = (instant) => {
    const { start, end, instants, data } = motion, bodies = scene.bodies;
    const share = end > start ? Math.min(1, Math.max(0, (instant - start) / (end - start))) * (instants - 1) : 0;
    const k = Math.min(instants - 2, Math.floor(share)), s = share - k, found = [];
    for (let b = 0; b < bodies; b++) {
      const i = 7 * (k * bodies + b), j = i + 7 * bodies, p = [], q = [];
      let same = 0;
      for (let c = 3; c < 7; c++) same += data[i + c] * data[j + c];
      for (let c = 0; c < 3; c++) p.push((1 - s) * data[i + c] + s * data[j + c]);
      for (let c = 3; c < 7; c++) q.push((1 - s) * data[i + c] + (same < 0 ? -s : s) * data[j + c]);
      found.push(rigid(p, unit(q)));
    }
    return found;
  };
  const draw = () => {
    if (!gl || !scene || !motion) return;
    const ratio = Math.min(2, window.devicePixelRatio || 1), v = look();
    const w = Math.round(stage.clientWidth * ratio), h = Math.round(stage.clientHeight * ratio);
    if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
    const dark = matchMedia("(prefers-color-scheme: dark)").matches;
    gl.clearColor(...(dark ? [0.1, 0.12, 0.15, 1] : [0.9, 0.93, 0.96, 1]));
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.viewport(0, h - Math.round(v.height * ratio), w, Math.round(v.height * ratio));
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    const near = 0.02 * camera.distance, far = 20 * camera.distance + 20, y = 1 / v.slope, x = y * v.height / v.width;
    const lens = new Float32Array([x, 0, 0, 0, 0, y, 0, 0, 0, 0, (near + far) / (near - far), -1, 0, 0, 2 * near * far / (near - far), 0]);
    const turn = new Float32Array([v.right[0], v.up[0], -v.ahead[0], 0, v.right[1], v.up[1], -v.ahead[1], 0,
      v.right[2], v.up[2], -v.ahead[2], 0, -dot(v.right, v.eye), -dot(v.up, v.eye), dot(v.ahead, v.eye), 1]);
    const { made, at } = program;
    gl.useProgram(made);
    gl.uniformMatrix4fv(at.view, false, times(lens, turn));
    gl.uniform3fv(at.eye, v.eye);
    const paint = (poses, tint, floors) => {
      for (const geom of scene.geoms) {
        if (geom.floor !== floors || (tint && geom.body === 0)) continue;
        gl.uniformMatrix4fv(at.place, false, times(poses[geom.body], geom.place));
        gl.uniform4fv(at.colour, tint || (geom.floor ? (dark ? [0.35, 0.38, 0.42, 1] : [0.86, 0.88, 0.9, 1]) : geom.colour));
        gl.uniform1i(at.kind, geom.floor ? 1 : 0);
        gl.bindVertexArray(meshes[geom.mesh].array);
        gl.drawElements(gl.TRIANGLES, meshes[geom.mesh].count, gl.UNSIGNED_INT, 0);
      }
    };
    const now = pose(time);
    paint(now, null, true);
    paint(now, null, false);
    gl.uniform1i(at.kind, 2);
    gl.uniformMatrix4fv(at.place, false, rigid([0, 0, 0], [1, 0, 0, 0]));
    gl.uniform4fv(at.colour, dark ? [0.45, 0.7, 1, 0.9] : [0.1, 0.4, 0.85, 0.8]);
    gl.bindVertexArray(trail.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, trail.buffer);
    for (const path of paths) {
      gl.bufferData(gl.ARRAY_BUFFER, path, gl.DYNAMIC_DRAW);
      gl.drawArrays(gl.LINE_STRIP, 0, path.length / 3);
    }
    if (selected !== null && motion.frames[selected] !== undefined && Math.abs(time - motion.frames[selected]) > 1e-3) {
      gl.depthMask(false);
      paint(pose(motion.frames[selected]), [0.25, 0.55, 1, 0.3], false);
      gl.depthMask(true);
    }
    gl.bindVertexArray(null);
    place(v);
  };

  // ------------------------------------------------------------------ handles
  const place = (v) => {
    scene.handles.forEach((handle, k) => {
      const [x, y, depth] = project(motion.handles[k], v);
      const shown = String(handle.frame) === selected && depth > 0;
      handle.button.hidden = !shown;
      if (shown) handle.button.style.transform = `translate(${x}px, ${y}px)`;
    });
    const line = $("line");
    line.style.visibility = held && held.target ? "visible" : "hidden";
    if (held && held.target) {
      const [x1, y1] = project(motion.handles[held.index], v), [x2, y2] = project(held.target, v);
      for (const [name, value] of [["x1", x1], ["y1", y1], ["x2", x2], ["y2", y2]]) line.setAttribute(name, value);
    }
  };
  const show = (k) => {
    const { names, knobs, label } = scene.handles[k];
    const told = names.length > 4 ? "" : names.map((name, i) => `${knobs[i]} = ${+motion.values[name].toPrecision(5)}`).join(", ");
    $("value").textContent = [label.includes(":") ? label.split(":")[0] : label, told].filter(Boolean).join(": ");
  };
  const target = (x, y) => {
    const v = look(), start = held.from, way = ray(x, y, v);
    // Feet go along the floor, unless it is seen from the side; all else along the picture.
    const flat = scene.handles[held.index].kind === "foot" && Math.abs(v.ahead[2]) > 0.15;
    const normal = flat ? [0, 0, 1] : v.ahead;
    const share = dot(sub(start, v.eye), normal) / dot(way, normal);
    return share > 0 && share < 50 * camera.distance ? add(v.eye, way, share) : null;
  };
  const inside = (event) => { const box = stage.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
  const grip = (button, index) => {
    button.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      event.stopPropagation();
      button.setPointerCapture(event.pointerId);
      button.focus({ preventScroll: true });
      const [x, y] = inside(event), v = look(), at = project(motion.handles[index], v);
      held = { index, from: motion.handles[index], off: [x - at[0], y - at[1]], target: null };
      button.classList.add("held");
      show(index);
    });
    button.addEventListener("pointermove", (event) => {
      if (!held || held.index !== index || !button.hasPointerCapture(event.pointerId)) return;
      const [x, y] = inside(event), found = target(x - held.off[0], y - held.off[1]);
      if (!found) return;
      held.target = found;
      dirty = true;
      send({ type: "drag", handle: scene.handles[index].key, target: found });
    });
    const end = () => {
      if (!held || held.index !== index) return;
      held = null;
      dirty = true;
      button.classList.remove("held");
      $("value").textContent = "";
      tell({ type: "release" });
    };
    button.addEventListener("pointerup", end);
    button.addEventListener("pointercancel", end);
    button.addEventListener("keydown", (event) => {
      const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
      const way = ways[event.key];
      if (!way) return;
      event.preventDefault();
      const v = look(), step = event.shiftKey ? 0.05 : 0.01;
      send({ type: "drag", handle: scene.handles[index].key,
        target: add(add(motion.handles[index], v.right, way[0] * step), v.up, way[1] * step) });
      tell({ type: "release" });
      show(index);
    });
  };
  // How many pixels a metre has on the picture where the camera looks: for the measurement.
  steering.pixels = () => { const v = look(); return v.height / (2 * v.slope * camera.distance); };
  const choose = (frame) => {
    selected = String(frame);
    for (const button of $("keyframes").children) button.setAttribute("aria-pressed", String(button.dataset.frame === selected));
    dirty = true;
  };

  // ------------------------------------------------------------------ the connection
  let socket = null, number = 0;
  const tell = (message) => { if (socket && socket.readyState === 1) socket.send(JSON.stringify(message)); };
  const send = (message) => {
    number += 1;
    steering.sent = number;
    asked.set(number, { begin: performance.now(), seen: false });
    tell({ ...message, number });
  };
  const arrived = (told, data) => {
    const came = performance.now();
    motion = { ...told, data };
    if (time < told.start || time > told.end) time = told.start;
    const bodies = scene.bodies;
    paths = scene.followed.map((b) => {
      const path = new Float32Array(3 * told.instants);
      for (let k = 0; k < told.instants; k++) for (let c = 0; c < 3; c++) path[3 * k + c] = data[7 * (k * bodies + b) + c];
      return path;
    });
    if (!camera.found) frame();
    draw();
    if (gl) gl.finish();
    const now = performance.now();
    steering.motions += 1;
    for (const [k, entry] of asked) if (k <= told.number) {
      if (k === told.number && !entry.seen) { steering.latencies.push(now - entry.begin); steering.received.push(came - entry.begin); }
      if (k === told.number && told.solved) steering.solved.push(now - entry.begin);
      entry.seen = true;
      if (k < told.number || told.solved) asked.delete(k);
    }
    for (const slider of scene.sliders) slider.follow(told.values[slider.name]);
    if (held) show(held.index);
  };
  const frame = () => {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (let k = 0; k < motion.instants; k++) for (let b = 1; b < scene.bodies; b++) for (let c = 0; c < 3; c++) {
      const value = motion.data[7 * (k * scene.bodies + b) + c];
      low[c] = Math.min(low[c], value);
      high[c] = Math.max(high[c], value);
    }
    camera.centre = low.map((value, c) => 0.5 * (value + high[c]));
    camera.distance = 1.5 * Math.hypot(...sub(high, low)) + 0.5;
    camera.found = true;
  };
  const badge = (id, text, kind) => { $(id).textContent = text; $(id).className = `badge ${kind}`; };
  const told = (message) => {
    state = message;
    $("undo").disabled = !message.undo;
    $("redo").disabled = !message.redo;
    $("message").textContent = message.message;
    if (message.busy) badge("solved", "solving", "wait");
    else if (message.message) badge("solved", "not as asked: the last solution is shown", "bad");
    else badge("solved", "solved", "good");
    const verdict = message.verdict;
    if (!verdict || message.busy) badge("verdict", "", "");
    else if (verdict === "judging") badge("verdict", "MuJoCo is judging", "wait");
    else if (verdict === "passed") badge("verdict", "MuJoCo: passed", "good");
    else badge("verdict", `MuJoCo: ${verdict}`, "bad");
  };
  const setUp = (message) => {
    scene = message;
    document.title = `${message.name}: stc steer`;
    $("name").textContent = message.name;
    $("file").textContent = message.file || message.name;
    if (gl) meshes = message.meshes.map((mesh) => upload(
      new Float32Array(bytes(mesh.vertices)), new Float32Array(bytes(mesh.normals)), new Uint32Array(bytes(mesh.faces))));
    for (const geom of message.geoms) geom.place = rigid(geom.position, geom.rotation);
    handles.replaceChildren();
    message.handles.forEach((handle, index) => {
      const button = document.createElement("button");
      button.className = `handle ${handle.kind}`;
      button.setAttribute("aria-label", `${handle.label}: drag, or use the arrow keys`);
      button.title = handle.label;
      button.dataset.key = handle.key;
      button.hidden = true;
      handle.button = button;
      grip(button, index);
      handles.append(button);
    });
    const frames = [...new Set(message.handles.map((handle) => handle.frame))].sort((a, b) => a - b);
    $("keyframes").replaceChildren(...frames.map((at) => {
      const button = document.createElement("button");
      button.textContent = `Frame ${at}`;
      button.dataset.frame = String(at);
      button.addEventListener("click", () => { choose(at); if (motion) { run(false); time = motion.frames[at]; } });
      return button;
    }));
    const best = message.handles.filter((handle) => handle.kind === "place").pop() || message.handles[message.handles.length - 1];
    if (frames.length) choose(frames.includes(Number(selected)) && selected !== null ? selected : best.frame);
    $("sliders").replaceChildren();
    $("structural").lastElementChild.replaceChildren();
    for (const slider of message.sliders) {
      const row = document.createElement("div"), label = document.createElement("label"), note = document.createElement("small");
      const range = document.createElement("input"), entry = document.createElement("input");
      row.className = "slider";
      label.textContent = slider.label;
      label.htmlFor = `n:${slider.name}`;
      entry.id = label.htmlFor;
      entry.type = "number";
      entry.step = "any";
      Object.assign(range, { type: "range", min: slider.low, max: slider.high, step: slider.structural ? 1 : "any" });
      range.setAttribute("aria-label", `${slider.label}, slider`);
      note.textContent = slider.note;
      const digits = slider.high - slider.low;
      const change = (value) => { entry.value = value; send({ type: "turn", name: slider.name, value: Number(value) }); };
      range.addEventListener("input", () => {
        const step = 10 ** (Math.floor(Math.log10(digits)) - 3);
        change(slider.structural ? range.value : +(Math.round(Number(range.value) / step) * step).toPrecision(12));
      });
      range.addEventListener("change", () => tell({ type: "release" }));
      entry.addEventListener("change", () => {
        if (entry.value !== "" && Number.isFinite(Number(entry.value))) { change(entry.value); tell({ type: "release" }); }
      });
      slider.follow = (value) => {
        if (slider.first === undefined) slider.first = value;
        row.classList.toggle("changed", value !== slider.first);
        if (document.activeElement !== range) range.value = value;
        if (document.activeElement !== entry && document.activeElement !== range) entry.value = value;
      };
      row.append(label, range, entry, note);
      (slider.structural ? $("structural").lastElementChild : $("sliders")).append(row);
      $("structural").hidden = $("structural").hidden && !slider.structural;
    }
  };
  const colour = (text) => {
    $("diff").replaceChildren(...text.split("\n").map((line) => {
      const row = document.createElement("span");
      row.className = /^\+(?!\+\+)/.test(line) ? "added" : /^-(?!--)/.test(line) ? "removed" : "";
      row.textContent = `${line}\n`;
      return row;
    }));
  };
  const connect = () => {
    const here = new URL(location.href);
    socket = new WebSocket(`${here.protocol === "https:" ? "wss" : "ws"}://${here.host}/steer${here.search}`);
    socket.binaryType = "arraybuffer";
    socket.onmessage = ({ data }) => {
      if (typeof data !== "string") {
        const length = new DataView(data).getUint32(0, true);
        arrived(JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length))), new Float32Array(data, 4 + length));
        return;
      }
      const message = JSON.parse(data);
      if (message.type === "scene") { lose(gl ? "" : $("lost").textContent); setUp(message); }
      else if (message.type === "state") told(message);
      else if (message.type === "changes") {
        colour(message.text || "Nothing has changed.");
        $("confirm").disabled = !message.text;
        $("outcome").textContent = "";
        $("dialog").showModal();
      } else if (message.type === "written" || message.type === "refused") {
        $("outcome").textContent = message.text;
        $("outcome").className = message.type === "written" ? "good" : "bad";
        $("confirm").disabled = message.type === "written";
      }
    };
    socket.onclose = () => {
      badge("solved", "not connected", "bad");
      lose("The connection to `stc steer` is gone: it has ended, or this browser is one too many. Trying again.");
      setTimeout(connect, 1500);
    };
  };

  // ------------------------------------------------------------------ controls
  const run = (on) => {
    playing = on;
    $("play").textContent = on ? "Pause" : "Play";
    $("play").setAttribute("aria-pressed", String(on));
  };
  $("play").addEventListener("click", () => run(!playing));
  $("scrub").addEventListener("input", () => {
    run(false);
    if (motion) time = motion.start + Number($("scrub").value) * (motion.end - motion.start);
    dirty = true;
  });
  $("undo").addEventListener("click", () => tell({ type: "undo" }));
  $("redo").addEventListener("click", () => tell({ type: "redo" }));
  $("write").addEventListener("click", () => tell({ type: "changes" }));
  $("confirm").addEventListener("click", () => { $("outcome").textContent = "solving the text once more"; tell({ type: "write" }); });
  $("cancel").addEventListener("click", () => $("dialog").close());
  document.addEventListener("keydown", (event) => {
    if (event.target instanceof HTMLInputElement && event.target.type === "number") return;
    const key = event.key.toLowerCase(), control = event.ctrlKey || event.metaKey;
    if (control && (key === "y" || (key === "z" && event.shiftKey))) tell({ type: "redo" });
    else if (control && key === "z") tell({ type: "undo" });
    else if (key === " " && event.target === document.body) run(!playing);
    else return;
    event.preventDefault();
  });
  const fingers = new Map();
  stage.addEventListener("pointerdown", (event) => {
    if (event.target !== canvas) return;
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  stage.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const dx = event.clientX - before[0], dy = event.clientY - before[1], v = look();
    const pixel = 2 * v.slope * camera.distance / v.height;
    if (fingers.size === 2) {
      const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
      const was = Math.hypot(before[0] - other[0], before[1] - other[1]);
      const is = Math.hypot(event.clientX - other[0], event.clientY - other[1]);
      if (was > 1 && is > 1) camera.distance *= was / is;
      camera.centre = add(add(camera.centre, v.right, -0.5 * dx * pixel), v.up, 0.5 * dy * pixel);
    } else if (event.shiftKey || event.buttons === 2 || event.buttons === 4) {
      camera.centre = add(add(camera.centre, v.right, -dx * pixel), v.up, dy * pixel);
    } else {
      camera.azimuth -= 0.4 * dx;
      camera.elevation = Math.max(-89, Math.min(25, camera.elevation - 0.3 * dy));
    }
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    dirty = true;
  });
  const lift = (event) => fingers.delete(event.pointerId);
  stage.addEventListener("pointerup", lift);
  stage.addEventListener("pointercancel", lift);
  stage.addEventListener("contextmenu", (event) => event.preventDefault());
  stage.addEventListener("wheel", (event) => {
    event.preventDefault();
    camera.distance *= Math.exp(0.001 * event.deltaY);
    dirty = true;
  }, { passive: false });
  new ResizeObserver(() => { dirty = true; }).observe(stage);

  const tick = (now) => {
    const passed = Math.min(100, now - last) / 1000;
    last = now;
    if (motion && playing && motion.end > motion.start) {
      time += passed;
      if (time > motion.end + 0.5) time = motion.start;  // rests at the end for a moment
      dirty = true;
    }
    if (motion && dirty) {
      dirty = false;
      const at = Math.min(time, motion.end);
      $("scrub").value = motion.end > motion.start ? (at - motion.start) / (motion.end - motion.start) : 0;
      $("now").textContent = `${at.toFixed(2)} s`;
      draw();
    }
    requestAnimationFrame(tick);
  };
  requestAnimationFrame(tick);
  connect();
})();
