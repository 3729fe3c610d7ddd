// ---- Charts that the sections share: lines with bands, and dots with intervals.

const NUM_COLOURS = 10;  // Of page.css.
const DASHES = ['', '7 4', '2 3', '9 3 2 3'];

// How the number `index` of several lines looks: colours first, then dashes.
function lookOf(index) {
  return {colour: `var(--agent-${index % NUM_COLOURS})`, dash: DASHES[Math.floor(index / NUM_COLOURS) % DASHES.length]};
}

function count(value) {
  for (const [unit, size] of [['G', 1e9], ['M', 1e6], ['k', 1e3]]) {
    if (Math.abs(value) >= size) return `${Number((value / size).toPrecision(3))}${unit}`;
  }
  return `${Number(value.toPrecision(3))}`;
}

function duration(seconds) {
  const whole = Math.round(seconds);
  const two = (number) => String(number).padStart(2, '0');
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return `${Math.floor(whole / 60)}:${two(whole % 60)} min`;
  return `${Math.floor(whole / 3600)}:${two(Math.floor(whole / 60) % 60)} h`;
}

// An axis of times up to `highest`, whose ticks are round numbers of hours, minutes or seconds.
function timeAxis(highest) {
  const [size, name] = highest > 7200 ? [3600, 'h'] : highest > 120 ? [60, 'min'] : [1, 's'];
  return {title: `training time [${name}]`, begin: 0, unit: size, show: (value) => String(Number((value / size).toPrecision(3)))};
}

// "74.2 % (70.1 – 78.0 %)" of [value, low, high].
function estimateText([value, low, high], digits = 1) {
  return percent(value, digits) + (low === null ? '' : ` (${(100 * low).toFixed(digits)} – ${percent(high, digits)})`);
}

function publishedText({value, deviation}, factor) {
  const number = (x) => Number((factor * x).toPrecision(4));
  return `${number(value)}${deviation === null ? '' : ` ± ${number(deviation)}`}`;
}

// Where the axis of a rate begins: at 0, or higher if all numbers are high.
function lowestTick(values) {
  const low = Math.min(...values);
  return low < 0.35 ? 0 : Math.floor((low - 0.02) * 10) / 10;
}

// A place for each x: [function, ticks]. `marks`: x that should have ticks, or none for round numbers of units.
function horizontalScale(xs, {log, marks, begin, unit = 1}, left, right) {
  const [low, high] = [begin === undefined ? Math.min(...xs) : begin, Math.max(...xs)];
  const place = log ? (() => {
    const scale = linear(Math.log(low), Math.log(high), left, right);
    return (value) => scale(Math.log(value));
  })() : linear(low, high, left, right);
  const wanted = marks || niceTicks(high / unit).map((tick) => tick * unit).filter((tick) => tick >= low && tick <= high);
  let last = -Infinity;
  const ticks = wanted.filter((tick) => {  // Numbers do not touch each other.
    if (place(tick) - last < 44) return false;
    last = place(tick);
    return true;
  });
  return [place, ticks];
}

function marker(shape, x, y, attributes) {
  const size = 4.5;
  if (shape === 'diamond') {
    return svg('path', {d: `M${x} ${y - size - 1}L${x + size + 1} ${y}L${x} ${y + size + 1}L${x - size - 1} ${y}Z`, ...attributes});
  }
  return svg('circle', {cx: x, cy: y, r: size, ...attributes});
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

// Lines over a number. `lines`: {label, colour, dash, points: [{x, name, estimate, published}]}; a level has one estimate
// for all x instead: {label, colour, level}. `axis`: {title, log, marks, begin, unit, show}. `steps`: a value holds until
// the next point.
function drawLines(box, lines, axis, {steps = false, yTitle = 'success'} = {}) {
  const width = widthOf(box);
  const height = Math.min(380, Math.max(250, width * 0.5));
  const [left, right, top, bottom] = [46, 16, 26, 46];
  const drawing = plotIn(box, height, width);
  const curves = lines.filter((line) => line.points);
  const estimates = lines.flatMap((line) => (line.level ? [line.level] : line.points.map((point) => point.estimate))).filter(Boolean);
  const published = curves.flatMap((line) => line.points.flatMap((p) => (p.published || []).map(({value}) => value)));
  const lowest = lowestTick([...estimates.map(([value, low]) => (low === null ? value : low)), ...published]);
  const y = linear(lowest, 1, height - bottom, top);
  const [place, ticks] = horizontalScale(curves.flatMap((line) => line.points.map((p) => p.x)), axis, left + 8, width - right - 8);
  const step = lowest > 0.65 ? 0.05 : lowest > 0.25 ? 0.1 : 0.2;
  for (let tick = Math.round(lowest / step) * step; tick < 1 + step / 2; tick += step) {
    if (tick < lowest - 1e-9) continue;
    drawing.append(svg('line', {x1: left, x2: width - right, y1: y(tick), y2: y(tick), class: 'grid'}),
      svgText(left - 8, y(tick) + 4, percent(tick), {'text-anchor': 'end', class: 'faint'}));
  }
  drawing.append(svgText(2, 12, yTitle, {class: 'faint', 'font-size': 11}));
  for (const tick of ticks) {
    drawing.append(svg('line', {x1: place(tick), x2: place(tick), y1: height - bottom, y2: height - bottom + 4, class: 'axis'}),
      svgText(place(tick), height - bottom + 18, axis.show(tick), {'text-anchor': 'middle', class: 'faint'}));
  }
  drawing.append(svg('line', {x1: left, x2: width - right, y1: height - bottom, y2: height - bottom, class: 'axis'}),
    svgText(width - right, height - 8, shorten(axis.title, width / 7), {'text-anchor': 'end', class: 'faint'}));
  for (const line of lines) {
    if (line.level) {
      drawLevel(drawing, line, left, width - right, y);
    } else {
      drawBand(drawing, line, place, y, steps, lines.length > 4 ? 0.08 : 0.15);
    }
  }
  for (const line of curves) drawCurve(drawing, line, place, y, steps);
  for (const line of curves) drawPublished(drawing, line, place, y);
}

function drawLevel(drawing, line, left, right, y) {
  const level = svg('line', {class: 'line', x1: left, x2: right, y1: y(line.level[0]), y2: y(line.level[0]),
    stroke: line.colour, 'stroke-dasharray': '1 5', 'stroke-linecap': 'round'});
  setTip(level, `${line.label}\n${estimateText(line.level)}`);
  drawing.append(level);
}

// The way through [x, y], or, in steps, along each y until the next x.
function wayThrough(points, steps) {
  return points.map(([x, y], i) => (steps && i > 0 ? `${x} ${points[i - 1][1]}L${x} ${y}` : `${x} ${y}`)).join('L');
}

function drawBand(drawing, line, place, y, steps, opacity) {
  const points = line.points.filter(({estimate}) => estimate && estimate[1] !== null);
  if (points.length < 2) return;
  const upper = wayThrough(points.map(({x, estimate}) => [place(x), y(estimate[2])]), steps);
  const lower = wayThrough(points.map(({x, estimate}) => [place(x), y(estimate[1])]), steps).split('L').reverse().join('L');
  drawing.append(svg('path', {class: 'band', d: `M${upper}L${lower}Z`, fill: line.colour, opacity}));
}

// In steps, points are not marked but show their values where the pointer is.
function drawCurve(drawing, line, place, y, steps) {
  const points = line.points.filter(({estimate}) => estimate);
  if (points.length === 0) return;
  const way = wayThrough(points.map(({x, estimate}) => [place(x), y(estimate[0])]), steps);
  drawing.append(svg('path', {class: 'line', d: `M${way}`, stroke: line.colour, 'stroke-dasharray': line.dash}));
  for (const {x, name, estimate} of points) {
    const dot = svg('circle', {cx: place(x), cy: y(estimate[0]), ...(steps ? {r: 9, fill: 'transparent'} :
      {r: 4, fill: line.colour, 'data-point': estimate[0]})});
    setTip(dot, `${line.label}\n${name}: ${estimateText(estimate)}`);
    drawing.append(dot);
  }
}

// The key below a chart. `sources`: of published numbers; empty: none are drawn.
function keyOf(lines, sources) {
  const sample = (node) => svg('svg', {width: 26, height: 12, viewBox: '0 0 26 12'}, ...node);
  const entries = lines.map((line) => element('span', {class: 'entry'}, sample([
    svg('line', {x1: 1, x2: 25, y1: 6, y2: 6, stroke: line.colour, 'stroke-width': 2,
      'stroke-dasharray': line.level ? '1 5' : line.dash, 'stroke-linecap': line.level ? 'round' : 'butt'}),
    ...(line.level ? [] : [svg('circle', {cx: 13, cy: 6, r: 3.5, fill: line.colour})])]), line.label));
  for (const source of sources) {
    entries.push(element('span', {class: 'entry'}, sample([
      svg('line', {x1: 1, x2: 25, y1: 6, y2: 6, stroke: 'var(--muted)', 'stroke-width': 1.2, 'stroke-dasharray': '2 4'}),
      marker('diamond', 13, 6, {fill: 'var(--paper)', stroke: 'var(--muted)', 'stroke-width': 1.4})]), source));
  }
  return element('div', {class: 'key'}, ...entries);
}

// Success of each row: seeds as faint dots, mean and interval, the published number as a diamond.
function drawDots(box, rows) {
  const width = widthOf(box);
  const narrow = width < 520;  // Names stand above their rows.
  const [left, rowHeight, bottom] = narrow ? [8, 44, 26] : [Math.min(240, width * 0.3), 30, 26];
  const height = rows.length * rowHeight + bottom;
  const drawing = plotIn(box, height, width);
  const x = linear(0, 1, left, width - 22);
  for (const tick of [0, 0.2, 0.4, 0.6, 0.8, 1]) {
    drawing.append(svg('line', {x1: x(tick), x2: x(tick), y1: 2, y2: height - bottom, class: 'grid'}),
      svgText(x(tick), height - bottom + 17, percent(tick), {'text-anchor': tick === 0 && narrow ? 'start' : 'middle', class: 'faint'}));
  }
  rows.forEach(({label, colour, estimate, seeds, published}, i) => {
    const y = i * rowHeight + (narrow ? 30 : rowHeight / 2);
    drawing.append(narrow ? svgText(left, y - 14, shorten(label, width / 7)) :
      svgText(left - 10, y + 4, shorten(label, left / 7), {'text-anchor': 'end'}));
    if (!estimate) {
      drawing.append(svgText(x(0) + 4, y + 4, 'nothing yet', {class: 'faint'}));
      return;
    }
    const [value, low, high] = estimate;
    if (low !== null) {
      drawing.append(svg('line', {x1: x(low), x2: x(high), y1: y, y2: y, stroke: colour, 'stroke-width': 3, opacity: 0.45}));
    }
    for (const seed of seeds.length > 1 ? seeds : []) {
      drawing.append(svg('line', {x1: x(seed), x2: x(seed), y1: y - 7, y2: y + 7, stroke: colour, opacity: 0.6}));
    }
    const dot = svg('circle', {cx: x(value), cy: y, r: 5, fill: colour, 'data-point': value});
    setTip(dot, `${label}\n${estimateText(estimate)}${seeds.length > 1 ? `\nseeds: ${seeds.map((s) => percent(s, 1)).join(', ')}` : ''}`);
    drawing.append(dot);
    for (const number of published) {
      const diamond = marker('diamond', x(number.value), y, {class: 'published', stroke: colour, 'data-published': number.value});
      setTip(diamond, `${label}\n${number.source}: ${publishedText(number, 100)} %`);
      drawing.append(diamond);
    }
  });
}
