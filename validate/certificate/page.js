// The film is one animated WebP, which plays without any of this.  With it the same bytes are taken apart into
// their frames, so that the motion can be paused and scrubbed, with a cursor in every plot.
(async () => {
  "use strict";
  const film = document.getElementById("film");
  if (!film || !window.createImageBitmap) return;
  const bytes = Uint8Array.from(atob(film.src.slice(film.src.indexOf(",") + 1)), (c) => c.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  const word = (at) => String.fromCharCode(...bytes.subarray(at, at + 4));
  const stills = [];
  for (let at = 12; at + 8 <= bytes.length; ) {
    const size = view.getUint32(at + 4, true);
    if (word(at) === "ANMF") {
      const image = bytes.subarray(at + 8 + 16, at + 8 + size);
      const head = new Uint8Array(12);
      head.set([82, 73, 70, 70, 0, 0, 0, 0, 87, 69, 66, 80]); // RIFF....WEBP
      new DataView(head.buffer).setUint32(4, image.length + 4, true);
      stills.push(new Blob([head, image], { type: "image/webp" }));
    }
    at += 8 + size + (size % 2);
  }
  let frames;
  try {
    frames = await Promise.all(stills.map((still) => createImageBitmap(still)));
  } catch {
    return;
  }
  if (frames.length < 2) return;

  const screen = document.getElementById("screen");
  const controls = document.querySelector(".controls");
  const play = document.getElementById("play");
  const scrub = document.getElementById("scrub");
  const now = document.getElementById("now");
  const start = Number(controls.dataset.start);
  const end = Number(controls.dataset.end);
  const pace = 1000 * Number(controls.dataset.pace);
  const plots = [...document.querySelectorAll("svg.plot")];
  const context = screen.getContext("2d");
  const show = (k) => {
    context.drawImage(frames[k], 0, 0, screen.width, screen.height);
    const share = k / (frames.length - 1);
    scrub.value = k;
    now.textContent = `${(start + share * (end - start)).toFixed(3)} s`;
    scrub.setAttribute("aria-valuetext", now.textContent);
    for (const plot of plots) {
      const cursor = plot.querySelector(".cursor");
      const x = Number(plot.dataset.x0) + share * (Number(plot.dataset.x1) - Number(plot.dataset.x0));
      cursor.setAttribute("x1", x);
      cursor.setAttribute("x2", x);
      cursor.style.visibility = "visible";
    }
  };
  let playing = false;
  let last = 0;
  let shown = 0;
  const tick = (time) => {
    if (!playing) return;
    if (time - last >= pace) {
      const steps = Math.min(frames.length, Math.floor((time - last) / pace));
      last += steps * pace;
      if (time - last > pace) last = time;
      shown = (shown + steps) % frames.length;
      show(shown);
    }
    requestAnimationFrame(tick);
  };
  const run = (on) => {
    playing = on;
    play.textContent = on ? "Pause" : "Play";
    play.setAttribute("aria-pressed", String(on));
    if (on) {
      last = performance.now();
      requestAnimationFrame(tick);
    }
  };
  play.addEventListener("click", () => run(!playing));
  scrub.addEventListener("input", () => {
    run(false);
    shown = Number(scrub.value);
    show(shown);
  });
  film.closest("picture").hidden = true;
  screen.hidden = false;
  controls.hidden = false;
  show(0);
  run(!window.matchMedia("(prefers-reduced-motion: reduce)").matches);
})();
