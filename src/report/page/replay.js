// The tool at work on a sheet, as far as a time: by the lengths and speeds of the machine profile, with what remains of the
// estimate of the job spread evenly over the lifts of the tool.

class Replay {
  constructor(view, payload) {
    this.view = view;
    const { paths } = view.header;
    this.points = payload.places(paths.points, view.header.grid);
    const runs = payload.integers(paths.runs);
    const operations = payload.integers(paths.operations);
    const parts = payload.integers(paths.parts);
    const joined = payload.integers(paths.joined);
    this.moves = [];
    let first = 0;
    let last = [0, 0];
    runs.forEach((count, i) => {
      const start = this.at(first);
      const feed = scene.operations[operations[i]].feed || scene.rapid;
      let length = 0;
      for (let k = first + 1; k < first + count; k++) {
        const [a, b] = [this.at(k - 1), this.at(k)];
        length += Math.hypot(b[0] - a[0], b[1] - a[1]);
      }
      const travel = Math.hypot(start[0] - last[0], start[1] - last[1]);
      const lift = joined[i] ? 0 : 1;
      this.moves.push({ first, count, operation: operations[i], part: parts[i], length, lift, work: length / feed, travel: travel / scene.rapid });
      first += count;
      last = this.at(first - 1);
    });
    this.moving = this.moves.reduce((sum, it) => sum + it.work + it.travel, 0);
    this.lifts = this.moves.reduce((sum, it) => sum + it.lift, 0);
    this.time = null;
  }

  at(i) {
    return [this.points[2 * i], this.points[2 * i + 1]];
  }

  /** Times of all moves, `pause` seconds for a lift. */
  clock(pause) {
    let time = 0;
    for (const move of this.moves) {
      move.begin = time;
      time += move.lift * pause + move.travel;
      move.down = time;
      time += move.work;
      move.end = time;
    }
    this.seconds = time;
  }

  /** Shows the sheet at a time, or whole without the tool where it is null. */
  show(time) {
    this.time = time;
    this.view.element.classList.toggle("replaying", time !== null);
    this.draw();
  }

  draw() {
    const { over, element, header, box, height } = this.view;
    const scale = Math.min(2, window.devicePixelRatio || 1);
    const [w, h] = [Math.round(element.clientWidth * scale), Math.round(element.clientHeight * scale)];
    if (over.width !== w || over.height !== h) [over.width, over.height] = [w, h];
    const context = over.getContext("2d");
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, w, h);
    if (this.time === null || !header.paths) return;
    const { size, left, top } = this.view.scale();
    const unit = scale / size;
    context.setTransform(unit, 0, 0, -unit, scale * left - box[0] * unit, scale * top + (height - box[1]) * unit);
    context.lineJoin = context.lineCap = "round";
    let tool = null;
    for (const move of this.moves) {
      if (move.begin > this.time) break;
      const working = this.time >= move.down;
      const share = working ? Math.min(1, (this.time - move.down) / Math.max(1e-9, move.work)) : 0;
      if (working) tool = this.stroke(context, move, share, size);
      else tool = this.between(move);
    }
    if (!tool) return;
    context.beginPath();
    context.arc(tool[0], tool[1], 6 * size, 0, 7);
    context.fillStyle = css(SELECTED);
    context.fill();
    context.lineWidth = 2 * size;
    context.strokeStyle = "white";
    context.stroke();
  }

  stroke(context, move, share, size) {
    const cutting = scene.operations[move.operation].name.startsWith("cut");
    context.strokeStyle = cutting ? css(SELECTED) : scene.operations[move.operation].color;
    context.lineWidth = (cutting ? 2.4 : 1.6) * size;
    context.beginPath();
    let tool = this.at(move.first);
    context.moveTo(...tool);
    let left = share * move.length;
    for (let k = move.first + 1; k < move.first + move.count && left > 0; k++) {
      const to = this.at(k);
      const step = Math.hypot(to[0] - tool[0], to[1] - tool[1]);
      const part = step > left ? left / step : 1;
      tool = [tool[0] + part * (to[0] - tool[0]), tool[1] + part * (to[1] - tool[1])];
      context.lineTo(...tool);
      left -= step;
    }
    context.stroke();
    return tool;
  }

  between(move) {
    const before = this.moves[this.moves.indexOf(move) - 1];
    const from = before ? this.at(before.first + before.count - 1) : [0, 0];
    const to = this.at(move.first);
    const share = (this.time - move.begin) / Math.max(1e-9, move.down - move.begin);
    return [from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])];
  }

  /** What the tool does at the moment. */
  words() {
    const move = this.moves.findLast((it) => it.begin <= this.time);
    if (!move) return "";
    if (this.time < move.down) return "moving";
    const part = move.part > 0 ? ` · part ${this.view.parts[move.part - 1].name}` : "";
    return `${scene.operations[move.operation].name.replace("-", " ")}${part}`;
  }
}

/** The slider, the button and the clock under the sheets. */
function replayControls(host, replays) {
  if (replays.length === 0) return { use: () => {} };
  const total = report.route?.seconds_estimate ?? 0;
  const moving = replays.reduce((sum, it) => sum + it.moving, 0);
  const lifts = replays.reduce((sum, it) => sum + it.lifts, 0);
  const pause = Math.max(0, total - moving) / Math.max(1, lifts);
  replays.forEach((it) => it.clock(pause));
  let current = null;
  let playing = false;
  let before = 0;
  const slider = make("input", { type: "range", id: "time", min: 0, max: 1000, step: 1, value: 1000, "aria-label": "Time of the replay" });
  const button = make("button", { type: "button", class: "play", id: "play", "aria-label": "Play the toolpath" }, "▶");
  const clock = make("output", { class: "clock", for: "time" });
  const say = (time) => {
    clock.textContent = time === null ? `${duration(current.seconds)} on the machine` : `${duration(time)} · ${current.words()}`;
    slider.setAttribute("aria-valuetext", clock.textContent);
  };
  const show = (time) => {
    const done = time === null || time >= current.seconds;
    current.show(done ? null : time);
    slider.value = done ? 1000 : Math.round((1000 * time) / current.seconds);
    say(done ? null : time);
    if (done) stop();
  };
  const stop = () => {
    playing = false;
    button.textContent = "▶";
    button.setAttribute("aria-label", "Play the toolpath");
  };
  const frame = (now) => {
    if (!playing) return;
    // A sheet is over in half a minute, however long it takes.
    const step = ((now - before) / 1000) * Math.max(1, current.seconds / 30);
    before = now;
    show((current.time ?? 0) + step);
    if (playing) requestAnimationFrame(frame);
  };
  button.addEventListener("click", () => {
    if (playing) return stop();
    playing = true;
    button.textContent = "❚❚";
    button.setAttribute("aria-label", "Pause the replay");
    before = performance.now();
    if (current.time === null) show(0);
    requestAnimationFrame(frame);
  });
  slider.addEventListener("input", () => {
    stop();
    show((slider.value / 1000) * current.seconds);
  });
  host.append(button, slider, clock);
  return {
    use: (replay) => {
      stop();
      current?.show(null);
      current = replay;
      show(null);
    },
  };
}
