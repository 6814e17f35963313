"use strict";
// Plays the film embedded in the page. The picture of a moment depends only on `now`.
// Cells are numbered as users see them; a border of cells around the floor holds parking bays.

const film = JSON.parse(document.getElementById("film").textContent);
const $ = (id) => document.getElementById(id);
const TICKS = film.last - film.first + 1;
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 20, 50, 100]; // 1 is ten ticks per second
const ONE_WAY = 1; // detail of cells
const [X0, Y0, X1, Y1] = film.box;
const MARGIN = 34, RIGHT = 8; // pixels of charts over time; the range of the slider's thumb lies between
const MIN_ROW = 7, MAX_ROW = 14; // pixels of a robot's row
const SIDES = [[1, 0], [0, 1], [-1, 0], [0, -1]]; // east, south, west, north

let now = 0; // ticks since the first, with a fraction while playing
let playing = false;
let speed = film.speed;
let selected = film.follow;
let following = selected >= 0;
let theme = film.theme;
let scale = 1, left = 0, top_ = 0; // pixels per cell; the cell at the upper left of the map
let columns = null, looks = null;
const changing = {}; // by kind and cell: whether it is there at first, and the ticks of changes

async function inflated(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

function summed(buffer, rows) { // turns differences along each row into values
  const values = new Int32Array(buffer), length = rows ? values.length / rows : 0;
  for (let row = 0; row < rows; row++)
    for (let k = 1, at = row * length + 1; k < length; k++, at++) values[at] += values[at - 1];
  return values;
}

async function unpacked() {
  const out = {}, rows = { figures: film.figures.length, full: 1, changes: 2, shut: 1, gates: 2 };
  for (const [name, text] of Object.entries(film.columns))
    out[name] = summed(await inflated(text), rows[name] ?? film.robots);
  return out;
}

const of = (name, robot, tick) => columns[name][robot * TICKS + tick];
function showTimes() { // a bar for each part of the robots' time
  for (const [name, share, colour] of film.time_shares) {
    const [term, value, bar] = ["dt", "dd", "i"].map((tag) => document.createElement(tag));
    term.textContent = name;
    value.textContent = share;
    bar.style.background = colour;
    bar.style.width = share.replace(" ", "");
    $("times").append(term, value, bar);
  }
}

const figure = (name, tick) => columns.figures[film.figures.indexOf(name) * TICKS + tick];
const colours = () => film.colours[theme];
const tickNow = () => Math.min(TICKS - 1, Math.floor(now));

function changingCells(first, changes) {
  const cells = new Map(Array.from(first, (cell) => [cell, { first: true, ticks: [] }])), count = changes.length / 2;
  for (let k = 0; k < count; k++) {
    const cell = changes[count + k];
    if (!cells.has(cell)) cells.set(cell, { first: false, ticks: [] });
    cells.get(cell).ticks.push(changes[k]);
  }
  return cells;
}

function isThere({ first, ticks }, tick) { // an odd number of changes inverts the first state
  let low = 0, high = ticks.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (ticks[middle] <= tick) low = middle + 1; else high = middle;
  }
  return first !== (low % 2 === 1);
}

function placeOf(robot) { // [x, y] in cells, or null while it is off the floor
  const k = tickNow(), x = of("x", robot, k), y = of("y", robot, k);
  if (x === -1 && y === -1) return null;
  const next = Math.min(TICKS - 1, k + 1), part = now - k;
  let x2 = of("x", robot, next), y2 = of("y", robot, next);
  const far = Math.abs(x2 - x) + Math.abs(y2 - y) > film.parts; // else towed
  if ((x2 === -1 && y2 === -1) || far) { x2 = x; y2 = y; }
  return [(x + (x2 - x) * part) / film.parts, (y + (y2 - y) * part) / film.parts];
}

// The floor

function drawCell(ctx, look, x, y, size) {
  const kind = film.kinds[look & film.kind_mask], detail = look >> film.detail_shift;
  const colour = colours().looks[look];
  if (kind === "wall") {
    ctx.fillStyle = detail ? colours().inside : colour;
    ctx.fillRect(x, y, size + 0.5, size + 0.5);
    return;
  }
  ctx.fillStyle = colours().floor;
  ctx.fillRect(x, y, size + 0.5, size + 0.5);
  ctx.fillStyle = ctx.strokeStyle = colour;
  const middle = [x + size / 2, y + size / 2];
  if (kind === "floor") {
    if (detail >= ONE_WAY && detail < ONE_WAY + 4 && size >= 8) chevron(ctx, ...middle, size * 0.16, detail - ONE_WAY);
    else ctx.fillRect(middle[0] - size * 0.04, middle[1] - size * 0.04, size * 0.08, size * 0.08);
  } else if (kind === "track" || kind === "turntable") {
    ctx.lineWidth = Math.max(1, size * 0.12);
    for (let side = 0; side < 4; side++) if (detail & (1 << side)) line(ctx, ...middle, SIDES[side], size / 2);
    if (kind === "turntable") ring(ctx, ...middle, size * 0.3);
  } else if (kind === "storage") {
    ctx.lineWidth = Math.max(0.5, size * 0.04);
    ctx.strokeRect(x + size * 0.08, y + size * 0.08, size * 0.84, size * 0.84);
  } else {
    ctx.globalAlpha = 0.55;
    ctx.fillRect(x + size * 0.06, y + size * 0.06, size * 0.88, size * 0.88);
    ctx.globalAlpha = 1;
    ctx.fillStyle = colours().text;
    if (size >= 14 && film.letters[kind]) word(ctx, ...middle, size * 0.45, film.letters[kind]);
  }
}

function chevron(ctx, x, y, r, direction) {
  const [dx, dy] = SIDES[direction];
  ctx.lineWidth = Math.max(1, r * 0.4);
  ctx.beginPath();
  ctx.moveTo(x - dx * r - dy * r, y - dy * r + dx * r);
  ctx.lineTo(x + dx * r, y + dy * r);
  ctx.lineTo(x - dx * r + dy * r, y - dy * r - dx * r);
  ctx.stroke();
}

function line(ctx, x, y, [dx, dy], length) {
  ctx.beginPath();
  ctx.moveTo(x, y);
  ctx.lineTo(x + dx * length, y + dy * length);
  ctx.stroke();
}

function ring(ctx, x, y, r) {
  ctx.beginPath();
  ctx.arc(x, y, r, 0, 7);
  ctx.stroke();
}

function word(ctx, x, y, high, text) {
  ctx.font = `${Math.round(high)}px system-ui, sans-serif`;
  ctx.textAlign = "center";
  ctx.textBaseline = "middle";
  ctx.fillText(text, x, y);
}

const lookAt = (x, y) => looks[(y + 1) * film.stride + x + 1];

let kept = null; // the floor, drawn once for views of many cells

function keptFloor() {
  const size = Math.max(2, Math.min(16, Math.floor(4096 / Math.max(X1 - X0, Y1 - Y0))));
  if (kept && kept.theme === theme) return kept;
  const canvas = document.createElement("canvas");
  canvas.width = (X1 - X0) * size;
  canvas.height = (Y1 - Y0) * size;
  const ctx = canvas.getContext("2d");
  for (let y = Y0; y < Y1; y++)
    for (let x = X0; x < X1; x++) drawCell(ctx, lookAt(x, y), (x - X0) * size, (y - Y0) * size, size);
  kept = { canvas, size, theme };
  return kept;
}

function drawFloor(ctx, width, height) {
  const x0 = Math.max(X0, Math.floor(left)), y0 = Math.max(Y0, Math.floor(top_));
  const x1 = Math.min(X1, Math.ceil(left + width / scale));
  const y1 = Math.min(Y1, Math.ceil(top_ + height / scale));
  if ((x1 - x0) * (y1 - y0) > 5000) {
    const { canvas, size } = keptFloor();
    ctx.imageSmoothingEnabled = scale < size;
    ctx.drawImage(canvas, (X0 - left) * scale, (Y0 - top_) * scale, (X1 - X0) * scale, (Y1 - Y0) * scale);
  } else {
    for (let y = y0; y < y1; y++)
      for (let x = x0; x < x1; x++)
        drawCell(ctx, lookAt(x, y), (x - left) * scale, (y - top_) * scale, scale);
  }
}

function cellSeen(cell, width, height) {
  const x = ((cell % film.stride) - 1 - left) * scale, y = (Math.floor(cell / film.stride) - 1 - top_) * scale;
  return x < -scale || y < -scale || x > width || y > height ? null : [x, y];
}

function cellsSeen(kind, width, height, paint) {
  const k = tickNow();
  for (const [cell, changes] of changing[kind]) {
    const place = cellSeen(cell, width, height);
    if (place && isThere(changes, k)) paint(...place);
  }
}

// Signs of doors, lifts and closings, and names.
function drawPlaces(ctx, width, height) {
  if (scale < film.detailed) return;
  for (const [cell, shapes] of film.places) {
    const place = cellSeen(cell, width, height);
    if (place) for (const shape of shapes) drawShape(ctx, ...place, scale, shape);
  }
}

function drawLoads(ctx, width, height) {
  ctx.fillStyle = colours().load;
  cellsSeen("full", width, height, (x, y) => ctx.fillRect(x + scale * 0.2, y + scale * 0.2, scale * 0.6, scale * 0.6));
}

function drawShut(ctx, width, height) {
  ctx.strokeStyle = colours().fault;
  ctx.lineWidth = Math.max(1, scale * 0.07);
  cellsSeen("shut", width, height, (x, y) => {
    ctx.strokeRect(x + scale * 0.06, y + scale * 0.06, scale * 0.88, scale * 0.88);
    cross(ctx, x + scale / 2, y + scale / 2, scale * 0.38);
  });
}

// Robots

// The shapes of a mark are those of pictures of pixels; lengths are in cells.
function drawRobot(ctx, x, y, size, mark, name) {
  const shapes = film.marks[mark];
  if (size < film.detailed) return drawSmallRobot(ctx, x, y, size, shapes);
  for (const shape of shapes) drawShape(ctx, x - size / 2, y - size / 2, size, shape);
  const high = size * Math.min(0.4, 0.9 / (String(name).length + 0.5));
  if (name === "" || high < film.legible) return;
  ctx.fillStyle = colours().floor;
  ctx.font = `600 ${Math.round(high)}px system-ui, sans-serif`;
  ctx.textAlign = "center";
  ctx.textBaseline = "middle";
  ctx.fillText(name, x, y);
}

function drawSmallRobot(ctx, x, y, size, shapes) {
  const r = Math.max(size * 0.46, 2.5), load = shapes.some(([, colour]) => colour === "load");
  drawShape(ctx, x, y, r, ["disc", shapes[0][1], 0, 0, 0, 1]);
  if (load) drawShape(ctx, x, y, r, ["disc", "load", 0, 0, 0, 0.5]);
}

function drawShape(ctx, x, y, size, [kind, colour, width, ...at]) {
  const [a, b, c, d, ...rest] = at.map((length) => length * size);
  ctx.fillStyle = ctx.strokeStyle = colours()[colour];
  if (kind === "word") {
    if (c >= film.legible) word(ctx, x + a, y + b, c, width);
    return;
  }
  ctx.lineWidth = width * size;
  ctx.beginPath();
  if (kind === "box") ctx.rect(x + a, y + b, c, d);
  else if (kind === "disc") ctx.arc(x + a, y + b, c, 0, 7);
  else {
    ctx.moveTo(x + a, y + b);
    ctx.lineTo(x + c, y + d);
    for (let at = 0; at < rest.length; at += 2) ctx.lineTo(x + rest[at], y + rest[at + 1]);
  }
  if (width) ctx.stroke(); else ctx.fill();
}

function cross(ctx, x, y, r) {
  ctx.beginPath();
  for (const side of [-1, 1]) {
    ctx.moveTo(x - r, y - r * side);
    ctx.lineTo(x + r, y + r * side);
  }
  ctx.stroke();
}

function drawRobots(ctx, width, height) {
  const k = tickNow();
  for (let robot = 0; robot < film.robots; robot++) {
    const place = placeOf(robot);
    if (!place) continue;
    const x = (place[0] + 0.5 - left) * scale, y = (place[1] + 0.5 - top_) * scale;
    if (x < -scale || y < -scale || x > width + scale || y > height + scale) continue;
    drawRobot(ctx, x, y, scale, of("mark", robot, k), robot);
    if (robot === selected) {
      ctx.strokeStyle = colours().selected;
      ctx.lineWidth = 2;
      ring(ctx, x, y, Math.max(scale * 0.6, 7));
    }
  }
}

function drawWait(ctx) { // a line from the selected robot to its blocker
  if (selected < 0) return;
  const blocker = of("blocker", selected, tickNow());
  if (of("cause", selected, tickNow()) === 0 || blocker < 0) return;
  const from = placeOf(selected), to = placeOf(blocker);
  if (!from || !to) return;
  ctx.strokeStyle = colours().waiting;
  ctx.lineWidth = 2;
  ctx.setLineDash([4, 3]);
  ctx.beginPath();
  ctx.moveTo((from[0] + 0.5 - left) * scale, (from[1] + 0.5 - top_) * scale);
  ctx.lineTo((to[0] + 0.5 - left) * scale, (to[1] + 0.5 - top_) * scale);
  ctx.stroke();
  ctx.setLineDash([]);
}

// Text

const number = (value) => value.toLocaleString("en-US", { maximumFractionDigits: 1 });

function timeWords(tick) {
  const { size, name } = film.unit, ticks = `tick ${number(tick)}`;
  return size === 1 ? ticks : `${ticks}, ${number(tick * size)} ${name}`;
}

function robotWords() {
  if (selected < 0) return ["No robot is chosen: click one."];
  const k = tickNow(), code = of("cause", selected, k), words = [];
  const doing = film.doing[of("doing", selected, k)];
  if (code === 0) words.push(doing);
  else {
    const blocker = of("blocker", selected, k), cell = of("wanted", selected, k);
    const at = cell < 0 ? "its next cell" : `(${(cell % film.stride) - 1}, ${Math.floor(cell / film.stride) - 1})`;
    const sentence = film.causes[code].text
      .replaceAll("{robot}", `robot ${selected}`)
      .replaceAll("{blocker}", blocker < 0 ? "no robot" : `robot ${blocker}`)
      .replaceAll("{cell}", at);
    const waited = of("waited", selected, k);
    words.push(`has been ${doing} for ${number(waited)} tick${waited === 1 ? "" : "s"}: ${film.causes[code].name}`, sentence);
  }
  const place = placeOf(selected);
  words.push(place ? `at (${Math.round(place[0])}, ${Math.round(place[1])})` : "off the floor");
  if (film.battery) words.push(`battery ${of("charge", selected, k)} %`);
  return words;
}

let written = "";

function write() {
  const k = tickNow(), robots = robotWords();
  const figures = [
    `${number(figure("working", k))} working`, `${number(figure("waiting", k))} waiting`,
    `${number(figure("delivered", k))} of ${number(figure("orders", k))} orders done`,
  ];
  if (figure("circling", k)) figures.push(`${number(figure("circling", k))} in a wait cycle`);
  const all = [timeWords(film.first + k), ...figures, ...robots, selected, following, theme].join("|");
  $("play").textContent = playing ? "pause" : "play";
  if (all === written) return;
  written = all;
  $("figures").textContent = figures.join("   ·   ");
  $("tick").textContent = timeWords(film.first + k);
  $("time").value = k;
  const head = document.createElement("h2");
  head.textContent = selected < 0 ? "Robot" : `Robot ${selected}${following ? ", followed" : ""}`;
  $("robot").replaceChildren(head, ...robots.map((text) => {
    const line = document.createElement("p");
    line.textContent = text;
    return line;
  }));
}

function drawKey() {
  const head = document.createElement("h2");
  head.textContent = "Robots";
  const rows = film.states.flatMap((words, state) => {
    if (!film.battery && (state === 2 || state === 5)) return [];
    const sign = document.createElement("canvas"), text = document.createElement("span");
    sign.width = sign.height = 44;
    drawRobot(sign.getContext("2d"), 22, 22, 40, film.key[state], "");
    text.textContent = words;
    return [sign, text];
  });
  $("key").replaceChildren(head, ...rows);
}

function drawCurve() { // waiting robots by tick, with a mark at the present
  const canvas = $("curve"), ctx = sized(canvas), width = canvas.clientWidth, height = canvas.clientHeight;
  ctx.clearRect(0, 0, width, height);
  let most = 1;
  for (let k = 0; k < TICKS; k++) most = Math.max(most, figure("waiting", k));
  ctx.fillStyle = colours().waiting;
  const long = width - MARGIN - RIGHT;
  for (let x = 0; x < long; x++) {
    const from = Math.floor((x / long) * TICKS), to = Math.max(from + 1, Math.floor(((x + 1) / long) * TICKS));
    let peak = 0;
    for (let k = from; k < to && k < TICKS; k++) peak = Math.max(peak, figure("waiting", k));
    ctx.fillRect(x + MARGIN, height - (peak / most) * (height - 14), 1, (peak / most) * (height - 14));
  }
  ctx.fillStyle = colours().text;
  ctx.font = "11px system-ui, sans-serif";
  ctx.fillText(`robots that wait, at most ${number(most)}`, MARGIN, 10);
  drawNow(ctx, width, height);
}

function drawNow(ctx, width, height) { // a mark at the present
  ctx.fillStyle = colours().cursor;
  ctx.fillRect(MARGIN + (now / Math.max(1, TICKS - 1)) * (width - MARGIN - RIGHT) - 1, 0, 2, height);
}

// The timeline: a row for each robot, in the colours of its states; many rows scroll.

function rowHeight() {
  return Math.max(MIN_ROW, Math.min(MAX_ROW, Math.floor((innerHeight * 0.3) / film.robots)));
}

function mostFrequent(robot, from, to) { // state in some ticks
  const counts = new Array(film.states.length).fill(0);
  for (let k = from; k < to; k++) counts[of("mark", robot, k) & 7]++;
  return counts.indexOf(Math.max(...counts));
}

function stretches(robot, long) { // [first pixel, state] of each stretch in one state
  const out = [];
  for (let x = 0; x < long; x++) {
    const from = Math.floor((x / long) * TICKS), to = Math.max(from + 1, Math.floor(((x + 1) / long) * TICKS));
    const state = mostFrequent(robot, from, to);
    if (!out.length || out[out.length - 1][1] !== state) out.push([x, state]);
  }
  return out;
}

const stretchesOf = []; // by robot; empty after the width has changed
let stretchesLong = 0;

function drawTimeline() {
  const frame = $("rows"), canvas = $("timeline"), row = rowHeight();
  if (frame.hidden) return;
  const shown = Math.min(film.robots * row, Math.floor(parseFloat(getComputedStyle(frame).maxHeight)));
  canvas.style.height = `${shown}px`;
  $("rest").style.height = `${film.robots * row - shown}px`;
  const ctx = sized(canvas), width = canvas.clientWidth, long = width - MARGIN - RIGHT;
  if (long !== stretchesLong) { stretchesOf.length = 0; stretchesLong = long; }
  ctx.clearRect(0, 0, width, shown);
  ctx.font = "10px system-ui, sans-serif";
  ctx.textAlign = "right";
  ctx.textBaseline = "middle";
  const first = Math.floor(frame.scrollTop / row), step = row < 11 ? 5 : 1;
  for (let robot = first; robot < film.robots && robot * row < frame.scrollTop + shown; robot++) {
    const y = robot * row - frame.scrollTop, parts = stretchesOf[robot] ??= stretches(robot, long);
    parts.forEach(([x, state], at) => {
      ctx.fillStyle = colours().states[state];
      ctx.fillRect(MARGIN + x, y, (parts[at + 1]?.[0] ?? long) - x, row - 1);
    });
    ctx.fillStyle = colours().text;
    if (robot % step === 0 || robot === selected) ctx.fillText(robot, MARGIN - 5, Math.max(5, y + row / 2));
    ctx.strokeStyle = colours().selected;
    ctx.lineWidth = 2;
    if (robot === selected) ctx.strokeRect(MARGIN - 1, y - 1, long + 2, row + 1);
  }
  drawNow(ctx, width, shown);
}

function showRow() { // scrolls to the row of the selected robot
  const frame = $("rows"), top = selected * rowHeight();
  if (selected >= 0 && (top < frame.scrollTop || top + rowHeight() > frame.scrollTop + frame.clientHeight))
    frame.scrollTop = top - frame.clientHeight / 2;
}

const tickAt = (x, canvas) => Math.round(((x - MARGIN) / (canvas.clientWidth - MARGIN - RIGHT)) * (TICKS - 1));

function listenToTimeline() {
  const canvas = $("timeline"), robotIn = (event) => Math.floor((event.offsetY + $("rows").scrollTop) / rowHeight());
  canvas.addEventListener("click", (event) => {
    goTo(tickAt(event.offsetX, canvas));
    choose(robotIn(event), false);
  });
  canvas.addEventListener("pointermove", (event) => {
    const k = Math.max(0, Math.min(TICKS - 1, tickAt(event.offsetX, canvas))), robot = robotIn(event);
    if (robot < film.robots) canvas.title = `robot ${robot}, ${timeWords(film.first + k)}: ${film.states[of("mark", robot, k) & 7]}`;
  });
  $("rows").addEventListener("scroll", drawTimeline);
  $("robots").addEventListener("click", () => {
    $("rows").hidden = !$("rows").hidden;
    $("robots").setAttribute("aria-pressed", String(!$("rows").hidden));
    draw();
  });
}

// The view

function sized(canvas) {
  const dense = window.devicePixelRatio || 1;
  const width = Math.round(canvas.clientWidth * dense), height = Math.round(canvas.clientHeight * dense);
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  const ctx = canvas.getContext("2d");
  ctx.setTransform(dense, 0, 0, dense, 0, 0);
  return ctx;
}

function fit() {
  const { clientWidth: width, clientHeight: height } = $("map");
  scale = Math.max(0.5, Math.min(width / (X1 - X0 + 0.5), height / (Y1 - Y0 + 0.5)));
  left = (X0 + X1 - width / scale) / 2;
  top_ = (Y0 + Y1 - height / scale) / 2;
}

function zoom(factor, x, y) { // the point (x, y) of the map stays where it is
  const next = Math.max(0.5, Math.min(160, scale * factor));
  left += x / scale - x / next;
  top_ += y / scale - y / next;
  scale = next;
}

function centre() {
  const place = following && selected >= 0 ? placeOf(selected) : null;
  if (!place) return;
  left = within(place[0] + 0.5, $("map").clientWidth / scale, X0, X1);
  top_ = within(place[1] + 0.5, $("map").clientHeight / scale, Y0, Y1);
}

function within(middle, shown, low, high) { // the start of a view that shows as little as possible beyond the floor
  if (shown >= high - low) return (low + high - shown) / 2;
  return Math.max(low, Math.min(high - shown, middle - shown / 2));
}

function draw() {
  const canvas = $("map"), ctx = sized(canvas), width = canvas.clientWidth, height = canvas.clientHeight;
  centre();
  ctx.fillStyle = colours().void;
  ctx.fillRect(0, 0, width, height);
  drawFloor(ctx, width, height);
  drawPlaces(ctx, width, height);
  drawLoads(ctx, width, height);
  drawShut(ctx, width, height);
  drawWait(ctx);
  drawRobots(ctx, width, height);
  drawTimeline();
  drawCurve();
  write();
}

let before = 0;

function frame(at) {
  if (playing) {
    now = Math.min(TICKS - 1, now + ((at - before) / 1000) * 10 * speed);
    if (now >= TICKS - 1) playing = false;
    draw();
    requestAnimationFrame(frame);
  }
  before = at;
}

function play(on) {
  if (on && now >= TICKS - 1) now = 0;
  playing = on;
  draw();
  if (on) requestAnimationFrame((at) => { before = at; requestAnimationFrame(frame); });
}

function goTo(tick) {
  playing = false;
  now = Math.max(0, Math.min(TICKS - 1, tick));
  draw();
}

function choose(robot, follow = following) {
  selected = robot;
  following = follow && robot >= 0;
  if (following && scale < 12) scale = 24;
  showRow();
  draw();
}

function showTheme() {
  for (const name of ["floor", "void", "text", "dim", "cursor"])
    document.documentElement.style.setProperty(`--${name}`, colours()[name]);
  $("theme").textContent = theme === "dark" ? "light" : "dark";
  drawKey();
  draw();
}

function otherTheme() {
  theme = theme === "dark" ? "light" : "dark";
  showTheme();
}

function setSpeed(value) {
  speed = value;
  $("speed").value = String(value);
}

function otherSpeed(step) {
  const faster = SPEEDS.find((one) => one > speed), slower = SPEEDS.findLast((one) => one < speed);
  setSpeed((step > 0 ? faster : slower) ?? speed);
}

function listenToKeys() {
  const pan = (dx, dy) => { following = false; left += (dx * 60) / scale; top_ += (dy * 60) / scale; draw(); };
  const zoomIn = (factor) => { zoom(factor, $("map").clientWidth / 2, $("map").clientHeight / 2); draw(); };
  const step = (ticks) => goTo(tickNow() + ticks);
  const actions = { // letters and signs mean what they mean in the viewer
    " ": () => play(!playing), ArrowLeft: (e) => step(e.shiftKey ? -100 : -1),
    ArrowRight: (e) => step(e.shiftKey ? 100 : 1), Home: () => goTo(0), End: () => goTo(TICKS - 1),
    "<": () => otherSpeed(-1), ">": () => otherSpeed(1), "+": () => zoomIn(1.25), "=": () => zoomIn(1.25),
    "-": () => zoomIn(0.8), h: () => pan(-1, 0), j: () => pan(0, 1), k: () => pan(0, -1), l: () => pan(1, 0),
    0: () => { following = false; fit(); draw(); }, T: otherTheme, Escape: () => choose(-1),
    ")": () => choose((selected + 1) % film.robots), "(": () => choose((Math.max(selected, 0) + film.robots - 1) % film.robots),
    f: () => choose(selected, !following),
  };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || !actions[event.key]) return;
    if (event.target.matches("select") || (event.key === " " && event.target.matches("button"))) return;
    event.preventDefault();
    actions[event.key](event);
  });
}

function robotAt(x, y) {
  let best = -1, least = Math.max(0.7, 12 / scale);
  for (let robot = 0; robot < film.robots; robot++) {
    const place = placeOf(robot);
    const far = place ? Math.hypot(place[0] + 0.5 - left - x / scale, place[1] + 0.5 - top_ - y / scale) : Infinity;
    if (far < least) { best = robot; least = far; }
  }
  return best;
}

function listenToPointer() {
  const map = $("map"), held = new Map();
  let moved = 0;
  map.addEventListener("pointerdown", (event) => {
    map.setPointerCapture(event.pointerId);
    held.set(event.pointerId, [event.offsetX, event.offsetY]);
    moved = 0;
  });
  map.addEventListener("pointermove", (event) => {
    const last = held.get(event.pointerId);
    if (!last) return;
    const [dx, dy] = [event.offsetX - last[0], event.offsetY - last[1]];
    moved += Math.abs(dx) + Math.abs(dy);
    if (held.size === 2) pinch(event, last);
    else if (moved > 4) { following = false; left -= dx / scale; top_ -= dy / scale; }
    held.set(event.pointerId, [event.offsetX, event.offsetY]);
    draw();
  });
  const pinch = (event, last) => {
    const other = [...held].find(([id]) => id !== event.pointerId)[1];
    const was = Math.hypot(last[0] - other[0], last[1] - other[1]);
    const is = Math.hypot(event.offsetX - other[0], event.offsetY - other[1]);
    if (was > 0 && is > 0) zoom(is / was, (event.offsetX + other[0]) / 2, (event.offsetY + other[1]) / 2);
  };
  map.addEventListener("pointerup", (event) => {
    held.delete(event.pointerId);
    if (moved <= 4) choose(robotAt(event.offsetX, event.offsetY), true);
  });
  map.addEventListener("pointercancel", (event) => held.delete(event.pointerId));
  map.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(-event.deltaY * 0.002), event.offsetX, event.offsetY);
    draw();
  }, { passive: false });
}

function listen() {
  listenToKeys();
  listenToPointer();
  listenToTimeline();
  const time = $("time");
  time.min = 0;
  time.max = TICKS - 1;
  time.addEventListener("input", () => goTo(Number(time.value)));
  const seek = (event) => goTo(tickAt(event.offsetX, $("curve")));
  $("curve").addEventListener("pointerdown", seek);
  $("curve").addEventListener("pointermove", (event) => event.buttons && seek(event));
  $("play").addEventListener("click", () => play(!playing));
  $("fit").addEventListener("click", () => { following = false; fit(); draw(); });
  $("theme").addEventListener("click", otherTheme);
  for (const value of [...new Set([...SPEEDS, speed])].sort((a, b) => a - b))
    $("speed").add(new Option(`×${value}`, String(value)));
  $("speed").addEventListener("change", () => setSpeed(Number($("speed").value)));
  setSpeed(speed);
  new ResizeObserver(draw).observe($("map"));
}

// film.html#tick=120&robot=3&play=1 opens at that tick, with that robot, and plays.
function readAddress() {
  const asked = new URLSearchParams(location.hash.slice(1));
  const robot = Number(asked.get("robot") ?? selected);
  if (Number.isInteger(robot) && robot < film.robots) selected = robot;
  following = selected >= 0;
  if (asked.has("tick")) now = Math.max(0, Math.min(TICKS - 1, Number(asked.get("tick")) - film.first || 0));
  play(asked.has("play"));
}

async function begin() {
  columns = await unpacked();
  looks = new Uint8Array(await inflated(film.looks));
  changing.full = changingCells(columns.full, columns.changes);
  changing.shut = changingCells(columns.shut, columns.gates);
  listen();
  fit();
  showTheme();
  showTimes();
  readAddress();
  addEventListener("hashchange", readAddress);
  if (following && scale < 12) scale = 24;
  draw();
  document.body.dataset.ready = "true";
}

begin().catch((error) => {
  $("figures").textContent = `This browser cannot play the film: ${error.message}`;
});
