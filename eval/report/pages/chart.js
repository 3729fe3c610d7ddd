// ---- Charts of all pages: scales, lines over a number, rows of estimates.

const NUM_COLOURS = 10;  // Of page.css.
const DASHES = ['', '7 4', '2 3', '9 3 2 3'];

// How the number `index` of several agents or lines looks: colours first, then dashes.
function lookOf(index) {
  return {colour: `var(--agent-${index % NUM_COLOURS})`, dash: DASHES[Math.floor(index / NUM_COLOURS) % DASHES.length]};
}

function svgText(x, y, text, attributes = {}) {
  return svg('text', {x, y, 'font-size': 12, ...attributes}, String(text));
}

// A drawing as wide as `box`, so that its unit is a pixel; it is drawn again when the width changes.
function plotIn(box, height, width) {
  const drawing = svg('svg', {viewBox: `0 0 ${width} ${height}`, role: 'img'});
  box.replaceChildren(drawing);
  return drawing;
}

function widthOf(box) {
  return Math.max(300, Math.round(box.getBoundingClientRect().width) || 900);
}

// ---- Scales.

function linear(fromLow, fromHigh, toLow, toHigh) {
  const span = fromHigh - fromLow || 1;
  return (value) => toLow + (value - fromLow) / span * (toHigh - toLow);
}

// Round numbers, about so many: those from `low` to `high`, or from at most `low` to at least `high` if they go `around`.
function roundTicks(low, high, {about = 5, around = false} = {}) {
  const raw = Math.max(high - low, 1e-9 * Math.max(1, Math.abs(high))) / about;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw * (1 - 1e-9));
  const first = around ? Math.floor(low / step + 1e-9) : Math.ceil(low / step - 1e-9);
  const last = around ? Math.max(first + 1, Math.ceil(high / step - 1e-9)) : Math.floor(high / step + 1e-9);
  return Array.from({length: last - first + 1}, (_, k) => Number(((first + k) * step).toPrecision(12)));
}

// A horizontal axis of times up to `highest`, whose ticks are round numbers of hours, minutes or seconds.
function timeAxis(highest) {
  const [size, name] = highest > 7200 ? [3600, 'h'] : highest > 120 ? [60, 'min'] : [1, 's'];
  return {title: `training time [${name}]`, begin: 0, unit: size, show: (value) => String(Number((value / size).toPrecision(3)))};
}

// A place for each x: [function, ticks]. `axis`: as of `drawLines`.
function horizontalScale(xs, {log, marks, begin, end, unit = 1}, left, right) {
  const low = begin === undefined ? Math.min(...xs) : begin;
  const high = end === undefined ? Math.max(...xs) : end;
  const place = log ? (() => {
    const scale = linear(Math.log(low), Math.log(high), left, right);
    return (value) => scale(Math.log(value));
  })() : linear(low, high, left, right);
  const wanted = marks || roundTicks(low / unit, high / unit).map((tick) => tick * unit);
  let last = -Infinity;
  const ticks = wanted.filter((tick) => {  // Numbers do not touch each other.
    if (place(tick) - last < 44) return false;
    last = place(tick);
    return true;
  });
  return [place, ticks];
}

// The ticks of a vertical axis, which holds 0; a rate's ends at 1 and begins higher if all its values are high.
function verticalTicks(values, {isRate = true, low}) {
  if (!isRate) return roundTicks(Math.min(0, ...values), Math.max(0, ...values), {about: 4, around: true});
  const lowest = Math.min(1, ...values);
  return roundTicks(low !== undefined ? low : lowest < 0.35 ? 0 : lowest - 0.02, 1, {around: true});
}

// ---- Lines over a number.

function marker(shape, x, y, attributes) {
  const size = 4.5;
  if (shape === 'diamond') {
    return svg('path', {d: `M${x} ${y - size - 1}L${x + size + 1} ${y}L${x} ${y + size + 1}L${x - size - 1} ${y}Z`, ...attributes});
  }
  return svg('circle', {cx: x, cy: y, r: size, ...attributes});
}

function publishedText({value, deviation}, factor) {
  const number = (x) => Number((factor * x).toPrecision(4));
  return `${number(value)}${deviation === null ? '' : ` ± ${number(deviation)}`}`;
}

// The published numbers of a line as hollow diamonds with their standard deviations, and a dotted line through those of a source.
function drawPublished(drawing, line, place, y) {
  const all = line.points.flatMap(({x, name, published}) => (published || []).map((number) => ({...number, name, x: place(x), y: y(number.value)})));
  for (const source of new Set(all.map((number) => number.source))) {
    const way = all.filter((number) => number.source === source).map((number) => `${number.x} ${number.y}`).join('L');
    drawing.append(svg('path', {class: 'published-line', d: `M${way}`, stroke: line.colour}));
  }
  for (const number of all) {
    const {value, deviation} = number;
    if (deviation !== null) {
      drawing.append(svg('line', {x1: number.x, x2: number.x, y1: y(Math.max(0, value - deviation)), y2: y(Math.min(1, value + deviation)),
        stroke: line.colour, 'stroke-width': 1.2}));
    }
    const dot = marker('diamond', number.x, number.y, {class: 'published', stroke: line.colour, 'data-published': value});
    setTip(dot, `${number.source}\n${line.label}, ${number.name}: ${publishedText(number, 100)} %`);
    drawing.append(dot);
  }
}

// Draws lines over a number.
// `lines`: {label, colour, dash, points: [{x, name, estimate, published}]}, by x. A point without an estimate is a gap. A
//   level has one estimate for all x instead of points: {label, colour, level}.
// `axis`: {title, log, marks, begin, end, unit, show}. `marks`: x with ticks, else round numbers of `unit`; `show` prints one.
// `y`: {title, isRate, low, show}. `steps`: a value holds until the next point. `dots`: each point is marked and has a tip;
//   without them, one tip shows all lines where the pointer is.
function drawLines(box, lines, axis, {y: vertical = {}, steps = false, dots = !steps, height} = {}) {
  const {title = 'success', show = percent} = vertical;
  const width = widthOf(box);
  const tall = height || Math.min(380, Math.max(250, width * 0.5));
  const [left, right, top, bottom] = [46, 16, title ? 26 : 8, axis.title ? 46 : 24];
  const drawing = plotIn(box, tall, width);
  const curves = lines.filter((line) => line.points);
  const estimates = lines.flatMap((line) => (line.level ? [line.level] : line.points.map((point) => point.estimate))).filter(Boolean);
  const published = curves.flatMap((line) => line.points.flatMap((p) => (p.published || []).map(({value}) => value)));
  const rows = verticalTicks([...estimates.flatMap((numbers) => numbers.filter((number) => number !== null)), ...published], vertical);
  const isCut = vertical.isRate !== false && rows[0] > 0;
  const y = linear(rows[0], rows[rows.length - 1], tall - bottom, top);
  const [place, ticks] = horizontalScale(curves.flatMap((line) => line.points.map((p) => p.x)), axis, left + 8, width - right - 8);
  for (const row of rows) {
    drawing.append(svg('line', {x1: left, x2: width - right, y1: y(row), y2: y(row), class: 'grid'}),
      svgText(left - 8, y(row) + 4, show(row), {'text-anchor': 'end', class: 'faint'}));
  }
  if (title) drawing.append(svgText(2, 12, isCut ? `${title}, from ${show(rows[0])}` : title, {class: 'faint', 'font-size': 11}));
  for (const tick of ticks) {
    drawing.append(svg('line', {x1: place(tick), x2: place(tick), y1: tall - bottom, y2: tall - bottom + 4, class: 'axis'}),
      svgText(place(tick), tall - bottom + 18, axis.show(tick), {'text-anchor': 'middle', class: 'faint'}));
  }
  drawing.append(svg('line', {x1: left, x2: width - right, y1: tall - bottom, y2: tall - bottom, class: 'axis'}));
  if (axis.title) {
    drawing.append(svgText(width - right, tall - 8, shorten(axis.title, width / 7), {'text-anchor': 'end', class: 'faint'}));
  }
  for (const line of lines) {
    if (line.level) {
      drawLevel(drawing, line, left, width - right, y);
    } else {
      drawBand(drawing, line, place, y, steps, lines.length > 4 ? 0.08 : 0.15);
    }
  }
  for (const line of curves) drawCurve(drawing, line, place, y, steps, dots);
  for (const line of curves) drawPublished(drawing, line, place, y);
  if (!dots) addCommonTip(drawing, curves, place, axis, show, [left, top, width - right, tall - bottom]);
}

function drawLevel(drawing, line, left, right, y) {
  const level = svg('line', {class: 'line', x1: left, x2: right, y1: y(line.level[0]), y2: y(line.level[0]),
    stroke: line.colour, 'stroke-dasharray': '1 5', 'stroke-linecap': 'round'});
  setTip(level, `${line.label}\n${estimateText(line.level)}`);
  drawing.append(level);
}

// The neighbouring points for which `has` holds, in lists of two or more.
function segmentsOf(points, has) {
  const segments = [[]];
  for (const point of points) {
    if (has(point)) {
      segments[segments.length - 1].push(point);
    } else {
      segments.push([]);
    }
  }
  return segments.filter((segment) => segment.length > 1);
}

// The way through [x, y], or, in steps, along each y until the next x.
function wayThrough(points, steps) {
  return points.map(([x, y], i) => {
    const to = `${x.toFixed(1)} ${y.toFixed(1)}`;
    return steps && i > 0 ? `${x.toFixed(1)} ${points[i - 1][1].toFixed(1)}L${to}` : to;
  }).join('L');
}

function drawBand(drawing, line, place, y, steps, opacity) {
  for (const points of segmentsOf(line.points, ({estimate}) => estimate && estimate[1] !== null)) {
    const upper = wayThrough(points.map(({x, estimate}) => [place(x), y(estimate[2])]), steps);
    const lower = wayThrough(points.map(({x, estimate}) => [place(x), y(estimate[1])]), steps).split('L').reverse().join('L');
    drawing.append(svg('path', {class: 'band', d: `M${upper}L${lower}Z`, fill: line.colour, opacity}));
  }
}

function drawCurve(drawing, line, place, y, steps, dots) {
  for (const points of segmentsOf(line.points, ({estimate}) => estimate)) {
    const way = wayThrough(points.map(({x, estimate}) => [place(x), y(estimate[0])]), steps);
    drawing.append(svg('path', {class: 'line', d: `M${way}`, stroke: line.colour, 'stroke-dasharray': line.dash || ''}));
  }
  for (const {x, name, estimate} of dots ? line.points.filter((point) => point.estimate) : []) {
    const dot = svg('circle', {cx: place(x), cy: y(estimate[0]), r: 4, fill: line.colour, 'data-point': estimate[0]});
    setTip(dot, `${line.label}\n${name}: ${estimateText(estimate)}`);
    drawing.append(dot);
  }
}

// The values of all lines where the pointer is.
function addCommonTip(drawing, lines, place, axis, show, [left, top, right, bottom]) {
  const area = svg('rect', {x: left, y: top, width: right - left, height: bottom - top, class: 'hit'});
  setTip(area, (event) => {
    const box = drawing.getBoundingClientRect();
    const at = (event.clientX - box.left) / box.width * drawing.viewBox.baseVal.width;
    const nearest = lines.map((line) => line.points.reduce((best, point) =>
      (Math.abs(place(point.x) - at) < Math.abs(place(best.x) - at) ? point : best)));
    const head = nearest[0].name || `${axis.title} ${axis.show(nearest[0].x)}`;
    return [head, ...lines.map((line, i) => `${line.label} ${nearest[i].estimate ? show(nearest[i].estimate[0]) : UNKNOWN}`)].join('\n');
  });
  drawing.append(area);
}

// Draws performance profiles, `lines` of {label, colour, dash, shares}: the share of scores above each threshold. Above 100 %
// there is none by definition, so that is not drawn: a line holds until there.
function drawProfiles(box, lines, thresholds) {
  const below = thresholds.filter((threshold) => threshold < 1);
  drawLines(box, lines.map((line) => ({...line, points: [...below, 1].map((x, k) =>
    ({x, name: `above ${percent(x)} on a course`, estimate: line.shares[Math.min(k, below.length - 1)]}))})),
  {title: 'success on a course above', begin: 0, end: 1, marks: [0, 0.2, 0.4, 0.6, 0.8, 1], show: percent},
  {steps: true, y: {title: 'share of scores', low: 0}});
}

// The key below a chart. `sources`: of published numbers; empty: none are drawn.
function keyOf(lines, sources = []) {
  const sample = (node) => svg('svg', {width: 26, height: 12, viewBox: '0 0 26 12'}, ...node);
  const entries = lines.map((line) => element('span', {class: 'entry'}, sample([
    svg('line', {x1: 1, x2: 25, y1: 6, y2: 6, stroke: line.colour, 'stroke-width': 2,
      'stroke-dasharray': line.level ? '1 5' : line.dash || '', 'stroke-linecap': line.level ? 'round' : 'butt'}),
    ...(line.level ? [] : [svg('circle', {cx: 13, cy: 6, r: 3.5, fill: line.colour})])]), line.label));
  for (const source of sources) {
    entries.push(element('span', {class: 'entry'}, sample([
      svg('line', {x1: 1, x2: 25, y1: 6, y2: 6, stroke: 'var(--muted)', 'stroke-width': 1.2, 'stroke-dasharray': '2 4'}),
      marker('diamond', 13, 6, {fill: 'var(--paper)', stroke: 'var(--muted)', 'stroke-width': 1.4})]), source));
  }
  return element('div', {class: 'key'}, ...entries);
}

// ---- Rows of estimates: a mean with its interval, seeds as ticks, published numbers as diamonds.

// `rows`: {label, colour, estimate, seeds, published, tip}. `axis`: {low, high, show}.
function drawRows(box, rows, {low, high, show}) {
  const width = widthOf(box);
  const narrow = width < 520;  // Names stand above their rows.
  const longest = Math.max(...rows.map((row) => row.label.length));
  const [left, rowHeight, bottom] = narrow ? [12, 44, 26] : [Math.min(240, width * 0.36, 24 + 7 * longest), 30, 26];
  const height = rows.length * rowHeight + bottom;
  const drawing = plotIn(box, height, width);
  const x = linear(low, high, left, width - 22);
  const ticks = roundTicks(low, high);
  for (const tick of ticks) {
    drawing.append(svg('line', {x1: x(tick), x2: x(tick), y1: 2, y2: height - bottom, class: 'grid'}),
      svgText(x(tick), height - bottom + 17, show(tick), {'text-anchor': narrow && x(tick) < 30 ? 'start' : 'middle', class: 'faint'}));
  }
  rows.forEach(({label, colour, estimate, seeds = [], published = [], tip}, i) => {
    const y = i * rowHeight + (narrow ? 30 : rowHeight / 2);
    const group = svg('g', {});
    group.append(narrow ? svgText(left, y - 14, shorten(label, width / 7), {class: 'halo'}) :
      svgText(left - 10, y + 4, shorten(label, left / 7), {'text-anchor': 'end'}));
    if (!estimate) group.append(svgText(left + 4, y + 4, 'nothing yet', {class: 'faint'}));
    if (estimate && estimate[1] !== null) {
      group.append(svg('line', {x1: x(estimate[1]), x2: x(estimate[2]), y1: y, y2: y, stroke: colour, 'stroke-width': 3, opacity: 0.45}));
    }
    for (const seed of seeds.length > 1 ? seeds : []) {
      group.append(svg('line', {x1: x(seed), x2: x(seed), y1: y - 7, y2: y + 7, stroke: colour, opacity: 0.6}));
    }
    if (estimate) group.append(svg('circle', {cx: x(estimate[0]), cy: y, r: 5, fill: colour, 'data-point': estimate[0]}));
    group.append(svg('rect', {x: 0, y: i * rowHeight, width, height: rowHeight, class: 'hit'}));
    setTip(group, tip);
    drawing.append(group);
    for (const number of published) {
      const diamond = marker('diamond', x(number.value), y, {class: 'published', stroke: colour, 'data-published': number.value});
      setTip(diamond, `${label}\n${number.source}: ${publishedText(number, 100)} %`);
      drawing.append(diamond);
    }
  });
  box.dataset.drawn = 'true';
}
