// ---- Numbers, and one chart.

function count(value) {
  if (value === null || value === undefined) return '–';
  for (const [unit, size] of [['G', 1e9], ['M', 1e6], ['k', 1e3]]) {
    if (Math.abs(value) >= size) return `${Number((value / size).toPrecision(3))}${unit}`;
  }
  return `${Number(value.toPrecision(3))}`;
}

function percent(rate) {
  return rate === null || rate === undefined ? '–' : `${(100 * rate).toFixed(1)} %`;
}

function duration(seconds) {
  if (seconds === null || seconds === undefined) return '–';
  const whole = Math.round(seconds);
  const pad = (number) => String(number).padStart(2, '0');
  const minutes = Math.floor(whole / 60);
  if (minutes < 60) return `${minutes}:${pad(whole % 60)}`;
  return `${Math.floor(minutes / 60)}:${pad(minutes % 60)}:${pad(whole % 60)}`;
}

// Round numbers from at most `low` to at least `high`.
function ticks(low, high, about = 4) {
  const raw = Math.max(high - low, 1e-9 * Math.max(1, Math.abs(high))) / about;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 2.5, 5, 10].map((m) => m * power).find((s) => s >= raw);
  const list = [];
  for (let k = Math.floor(low / step + 1e-9); list.length < 12; ++k) {
    list.push(k * step);
    if (k * step >= high - 1e-9 * step) break;
  }
  return list;
}

const kColours = ['#0b74c4', '#d63026', '#d98e0b', '#129969', '#7f5cb8', '#8a6d3b', '#5a6675'];

// The curves of `series` ([name, values]) over `xs`. `showX` prints a place on the axis, `showY` a value.
function drawChart(series, xs, {range, showX, showY}) {
  const [width, height, left, right, top, bottom] = [400, 190, 46, 10, 8, 22];
  const values = series.flatMap(([, list]) => list.filter((value) => value !== null));
  const low = range ? range[0] : Math.min(...values);
  const high = range ? range[1] : Math.max(...values);
  const rows = ticks(low, high);
  const [yLow, yHigh] = [rows[0], Math.max(rows[rows.length - 1], rows[0] + 1e-9)];
  const xHigh = Math.max(xs[xs.length - 1], 1e-9);
  const x = (value) => left + value / xHigh * (width - left - right);
  const y = (value) => height - bottom - (value - yLow) / (yHigh - yLow) * (height - top - bottom);
  const drawing = svg('svg', {viewBox: `0 0 ${width} ${height}`, role: 'img'});
  for (const row of rows) {
    drawing.append(svg('line', {class: 'grid', x1: left, x2: width - right, y1: y(row), y2: y(row)}));
    drawing.append(svg('text', {x: left - 6, y: y(row) + 4, 'text-anchor': 'end'}, showY(row)));
  }
  for (const fraction of [0, 0.5, 1]) {
    const anchor = fraction === 0 ? 'start' : fraction === 1 ? 'end' : 'middle';
    drawing.append(svg('text', {x: x(fraction * xHigh), y: height - 5, 'text-anchor': anchor}, showX(fraction * xHigh)));
  }
  series.forEach(([, list], i) => {
    let path = '';
    let open = false;
    list.forEach((value, k) => {
      if (value !== null) path += `${open ? 'L' : 'M'}${x(xs[k]).toFixed(1)} ${y(value).toFixed(1)}`;
      open = value !== null;
    });
    drawing.append(svg('path', {class: 'curve', stroke: kColours[i], d: path}));
  });
  return drawing;
}

// The values of all series where the pointer is.
function addTip(drawing, series, xs, showX, showY) {
  const tip = document.getElementById('tip');
  drawing.addEventListener('pointermove', (event) => {
    const box = drawing.getBoundingClientRect();
    const at = ((event.clientX - box.left) / box.width * 400 - 46) / (400 - 56) * xs[xs.length - 1];
    let nearest = 0;
    xs.forEach((value, k) => {
      if (Math.abs(value - at) < Math.abs(xs[nearest] - at)) nearest = k;
    });
    tip.hidden = false;
    tip.textContent = [showX(xs[nearest]), ...series.map(([name, list]) =>
      `${name} ${list[nearest] === null ? '–' : showY(list[nearest])}`)].join('\n');
    tip.style.left = `${Math.min(event.clientX + 14, window.innerWidth - tip.offsetWidth - 8)}px`;
    tip.style.top = `${Math.max(4, event.clientY - tip.offsetHeight - 8)}px`;
  });
  drawing.addEventListener('pointerleave', () => {
    tip.hidden = true;
  });
}
