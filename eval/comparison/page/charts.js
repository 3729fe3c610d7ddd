// ---- Figures, pairs and profiles of the agents.

function drawFigures(data, group) {
  const results = group.results.map((index) => data.results[index]);
  const name = (agent, i) => {
    const text = `${results[i].kind}, ${agent.seeds > 1 ? `${agent.seeds} seeds, ` : ''}${agent.episodes} episodes`;
    const overlap = results[i].training_overlap;
    return [swatch(results[i].colour), agent.label, element('span', {class: 'sub'}, text),
      ...(overlap ? [element('span', {class: 'sub caution'}, `trained on ${overlapText(results[i])}`)] : [])];
  };
  document.getElementById('figures-table').replaceChildren(...figuresTable(quantityColumns(data.quantities, group), group.agents,
    {name, colour: (i) => results[i].colour, attributes: (i) => ({'data-result': group.results[i]})}));
  document.getElementById('notes').replaceChildren(...group.notes.map((note) => element('p', {class: 'note caution'}, note)));
}

function drawProfileSection(data, group) {
  const lines = profileLines(group.agents, (i) => data.results[group.results[i]].look);
  drawProfiles(document.getElementById('profile-plot'), lines, data.thresholds);
  document.getElementById('profile-key').replaceChildren(keyOf(lines));
}

// ---- Success by course.

// From brown (no success) over a pale or dark middle to the green of success, as people who see few colours tell apart.
function successColour(rate) {
  const stops = isDark() ? [[206, 112, 36], [74, 74, 76], [28, 158, 118]] :
    [[166, 78, 8], [236, 228, 212], [0, 128, 93]];
  const place = Math.min(Math.max(rate, 0), 1) * 2;
  const i = Math.min(Math.floor(place), 1);
  const mix = stops[i].map((from, k) => Math.round(from + (place - i) * (stops[i + 1][k] - from)));
  return `rgb(${mix.join(',')})`;
}

function orderCourses(data, group, order) {
  const courses = group.courses.map((_, index) => index);
  if (order === 'set') return courses;
  const mean = courses.map((course) =>
    group.results.reduce((sum, index) => sum + successRate(data.results[index], course), 0));
  return courses.sort((a, b) => mean[a] - mean[b] || a - b);
}

function courseTip(result, group, course) {
  const letters = result.outcomes[course];
  const count = countOutcomes(letters);
  const times = result.times_cs[course].filter((_, k) => letters[k] === 'S');
  const mean = times.reduce((sum, time) => sum + time, 0) / times.length / 100;
  return `${result.label} on ${group.courses[course].name}\n${count.S} of ${letters.length} succeeded` +
    (count.C ? `, ${count.C} collided` : '') + (count.T ? `, ${count.T} timed out` : '') +
    (times.length ? `\nmean traversal ${mean.toFixed(1)} s` : '');
}

// Where the cells lie: in one row for each agent, or, where that makes them too narrow for a finger,
// in as many as it takes, with the agent's name above.
function layOutCourseMap(width, numCourses) {
  const left = width < 560 ? 90 : 150;
  const smallest = 14;
  const wrapped = width < 560 && (width - left) / numCourses < smallest;
  if (!wrapped) {
    return {left, top: 0, perRow: numCourses, cell: Math.min(46, (width - left) / numCourses), cellHeight: 26, height: 26};
  }
  const perRow = Math.floor(width / smallest);
  const numRows = Math.ceil(numCourses / perRow);
  return {left: 0, top: 20, perRow, cell: width / perRow, cellHeight: 20, height: 28 + 20 * numRows, wrapped};
}

function drawCourseMap(data, group, onCourse) {
  const box = document.getElementById('course-map');
  const width = widthOf(box);
  const results = group.results.map((index) => data.results[index]);
  const order = orderCourses(data, group, document.getElementById('course-order').value);
  const layout = layOutCourseMap(width, order.length);
  const {left, cell, cellHeight} = layout;
  const named = !layout.wrapped && cell >= 11;
  const longest = Math.max(...group.courses.map((course) => Math.min(course.name.length, 15)));
  const bottom = named ? 14 + 6 * longest : 22;
  const base = results.length * layout.height;
  const drawing = plotIn(box, base + (layout.wrapped ? 0 : bottom), width);
  results.forEach((result, row) => {
    const top = row * layout.height;
    drawing.append(layout.wrapped ? svgText(0, top + 14, shorten(result.label, width / 7)) :
      svgText(left - 8, top + 17, shorten(result.label, left / 7), {'text-anchor': 'end'}));
    order.forEach((course, place) => {
      const rate = successRate(result, course);
      const gap = cell > 6 ? 1 : 0.3;
      const x = left + (place % layout.perRow) * cell;
      const y = top + layout.top + Math.floor(place / layout.perRow) * cellHeight;
      const rect = svg('rect', {class: 'course clickable', x, y: y + 2, width: Math.max(cell - gap, 0.5),
        height: cellHeight - 4, rx: cell > 8 ? 2 : 0, fill: successColour(rate)});
      setTip(rect, courseTip(result, group, course));
      rect.addEventListener('click', () => onCourse(course, result));
      drawing.append(rect);
      if (cell >= 17) {
        const pale = isDark() || rate > 0.8 || rate < 0.12;
        drawing.append(svgText(x + cell / 2 - 0.5, y + cellHeight / 2 + 4, countOutcomes(result.outcomes[course]).S,
          {'text-anchor': 'middle', 'font-size': 10, 'pointer-events': 'none', style: `fill:${pale ? '#fff' : '#1d2530'}`}));
      }
    });
  });
  if (named) {
    order.forEach((course, column) => {
      const x = left + (column + 0.5) * cell + 3;
      drawing.append(svgText(x, base + 8, shorten(group.courses[course].name, 15),
        {class: 'faint', 'font-size': 10, 'text-anchor': 'end', transform: `rotate(-90 ${x} ${base + 8})`}));
    });
  } else if (!layout.wrapped) {
    drawing.append(svgText(left, base + 16, `${order.length} courses; point at one for its name`, {class: 'faint'}));
  }
  document.getElementById('course-note').textContent =
    `${cell >= 17 ? 'Numbers are successes; click' : 'Click'} a course to see it driven.`;
  const legend = document.getElementById('success-legend');
  legend.replaceChildren(...[0, 0.25, 0.5, 0.75, 1].map((rate) =>
    element('span', {}, swatch(successColour(rate)), percent(rate))));
}

// ---- Success by difficulty.

function drawDifficulty(data, group) {
  const box = document.getElementById('difficulty-plot');
  const measure = group.measures.find((m) => m.key === document.getElementById('measure').value);
  const results = group.results.map((index) => data.results[index]);
  if (!measure) return;
  document.getElementById('difficulty-legend').replaceChildren(
    ...results.map((result) => element('span', {}, swatch(result.colour), result.label)));
  const width = widthOf(box);
  const height = 300;
  const [left, right, top] = [46, 10, 10];
  const binWidth = (width - left - right) / measure.bins.length;
  const narrow = binWidth < 100;  // Each end of a bin has its own line, and 'courses' is said once.
  const bottom = narrow ? 56 : 44;
  const drawing = plotIn(box, height, width);
  const y = linear(0, 1, height - bottom, top);
  for (const tick of [0, 0.25, 0.5, 0.75, 1]) {
    drawing.append(svg('line', {x1: left, x2: width - right, y1: y(tick), y2: y(tick), class: 'grid'}));
    drawing.append(svgText(left - 8, y(tick) + 4, percent(tick), {'text-anchor': 'end', class: 'faint'}));
  }
  const dodge = Math.min(22, binWidth * 0.7 / results.length);
  const place = (bin, agent) => left + (bin + 0.5) * binWidth + (agent - (results.length - 1) / 2) * dodge;
  const whole = measure.bins.every((bin) => Number.isInteger(bin.low) && Number.isInteger(bin.high));
  const number = (value) => (whole || Math.abs(value) >= 100 ? value.toFixed(0) : value.toPrecision(3));
  measure.bins.forEach((bin, b) => {
    const lines = narrow ? [`${number(bin.low)} –`, number(bin.high)] : [`${number(bin.low)} – ${number(bin.high)}`];
    lines.forEach((line, k) => drawing.append(
      svgText(left + (b + 0.5) * binWidth, height - bottom + 18 + 14 * k, line, {'text-anchor': 'middle'})));
    drawing.append(svgText(left + (b + 0.5) * binWidth, height - bottom + 20 + 14 * lines.length,
      narrow ? bin.courses : `${bin.courses} courses`, {'text-anchor': 'middle', class: 'faint', 'font-size': narrow ? 10 : 11}));
  });
  if (narrow) {
    drawing.append(svgText(left - 6, height - bottom + 48, 'courses', {'text-anchor': 'end', class: 'faint', 'font-size': 10}));
  }
  results.forEach((result, agent) => {
    const points = measure.bins.map((bin, b) => `${place(b, agent)},${y(bin.rates[agent][0])}`).join(' ');
    drawing.append(svg('polyline', {points, fill: 'none', stroke: result.colour, 'stroke-width': 1.2, opacity: 0.45}));
    measure.bins.forEach((bin, b) => {
      const [rate, low, high] = bin.rates[agent];
      const x = place(b, agent);
      if (low !== null) {
        drawing.append(svg('line', {x1: x, x2: x, y1: y(low), y2: y(high), stroke: result.colour, 'stroke-width': 2, opacity: 0.6}));
      }
      const dot = svg('circle', {cx: x, cy: y(rate), r: 4.5, fill: result.colour});
      setTip(dot, `${result.label}\n${estimateText([rate, low, high])}`);
      drawing.append(dot);
    });
  });
}

// ---- Success by randomised field: a row for each bin of each field, a column for each agent.

function drawDrawnFields(data, group) {
  const figure = {key: 'success_rate', title: 'Success', unit: '%', factor: 100};
  const labels = group.results.map((index) => data.results[index].label);
  const rows = group.drawn.flatMap(({key, unit, bins}) => bins.map((bin, b) => element('tr', {'data-drawn-field': key},
    element('td', {}, ...(b === 0 ? [keyNode(key)] : [])),
    element('td', {}, unit ? `${bin.label} ${unit}` : bin.label),
    ...bin.rates.map((rate, agent) => {
      const cell = figureCell(figure, rate);
      if (rate !== null) cell.append(element('span', {class: 'sub'}, ` of ${bin.episodes[agent]}`));
      return cell;
    }))));
  document.getElementById('drawn-table').replaceChildren(scrollTable('compact', ['Field', 'Value', ...labels], rows));
}

// ---- Times.

function timesOf(result, wanted) {
  const times = [];
  result.outcomes.forEach((letters, course) => {
    [...letters].forEach((letter, k) => {
      if (wanted.includes(letter)) times.push(result.times_cs[course][k] / 100);
    });
  });
  return times.sort((a, b) => a - b);
}

function drawTimes(data, group, id, wanted) {
  const box = document.getElementById(id);
  const width = widthOf(box);
  const results = group.results.map((index) => data.results[index]);
  const all = results.map((result) => timesOf(result, wanted));
  const ticks = roundTicks(0, Math.max(1, ...all.map((times) => (times.length ? times[times.length - 1] : 0))), {around: true});
  const full = ticks[ticks.length - 1];
  const narrow = width < 460;  // Names stand above their rows.
  const [left, right, rowHeight, bottom] = narrow ? [6, 16, 62, 34] : [150, 30, 46, 34];
  const height = results.length * rowHeight + bottom;
  const drawing = plotIn(box, height, width);
  const x = linear(0, full, left, width - right);
  for (const tick of ticks) {
    drawing.append(svg('line', {x1: x(tick), x2: x(tick), y1: 4, y2: height - bottom, class: 'grid'}));
    drawing.append(svgText(x(tick), height - bottom + 16, tick, {'text-anchor': 'middle', class: 'faint'}));
  }
  drawing.append(svgText(width - right, height - 4, 'seconds', {'text-anchor': 'end', class: 'faint'}));
  const numBins = 50;
  results.forEach((result, row) => {
    const times = all[row];
    const base = (row + 1) * rowHeight - 4;
    const count = `${times.length} episodes`;
    if (narrow) {
      drawing.append(svgText(left, base - 44, shorten(`${result.label}, ${count}`, width / 7)));
    } else {
      drawing.append(svgText(left - 8, base - 12, shorten(result.label, left / 7.5), {'text-anchor': 'end'}));
      drawing.append(svgText(left - 8, base + 1, count, {'text-anchor': 'end', class: 'faint', 'font-size': 11}));
    }
    drawing.append(svg('line', {x1: left, x2: width - right, y1: base, y2: base, class: 'axis'}));
    if (times.length === 0) return;
    const counts = new Array(numBins).fill(0);
    for (const time of times) ++counts[Math.min(numBins - 1, Math.floor(time / full * numBins))];
    const tallest = Math.max(...counts);
    const barHeight = 34;
    counts.forEach((count, bin) => {
      if (count === 0) return;
      const bar = svg('rect', {x: x(bin * full / numBins) + 0.4, width: Math.max(1, (x(full) - x(0)) / numBins - 0.8),
        y: base - count / tallest * barHeight, height: count / tallest * barHeight, fill: result.colour, opacity: 0.75});
      setTip(bar, `${result.label}\n${count} episodes, ${(bin * full / numBins).toFixed(1)} to ${((bin + 1) * full / numBins).toFixed(1)} s`);
      drawing.append(bar);
    });
    const median = (times[(times.length - 1) >> 1] + times[times.length >> 1]) / 2;
    drawing.append(svg('line', {x1: x(median), x2: x(median), y1: base - barHeight - 2, y2: base + 3, class: 'mark'}));
    const side = x(median) > width - right - 40 ? -1 : 1;  // Of the mark: its number stays in the drawing.
    drawing.append(svgText(x(median) + 5 * side, base - barHeight + 6, median.toFixed(1),
      {'font-size': 11, class: 'halo', 'text-anchor': side < 0 ? 'end' : 'start'}));
  });
}
