// ---- The page of `slalom compare`: scores, differences and profiles of agents.

const ROW = 40;  // Height of a row of dots: a line of text above a whisker.

const SCORES = [
  {key: 'success_rate', box: 'success-plot', title: 'Success', unit: '%', factor: 100, full: 100, seeds: true},
  {key: 'success_rate_iqm', box: 'iqm-plot', title: 'Success, IQM', unit: '%', factor: 100, full: 100},
  {key: 'collision_rate', box: 'collision-plot', title: 'Collision', unit: '%', factor: 100, full: 100},
  {key: 'traversal_time_s', box: 'traversal-plot', title: 'Traversal', unit: 's', factor: 1},
];

function colourOf(index) {
  return `var(--agent-${index % 10})`;
}

function withTitle(node, text) {
  node.append(svg('title', {}, text));
  return node;
}

function estimateText(estimate, factor, sign) {
  if (estimate === null) return '–';
  const text = (value) => {
    const shown = (factor * value).toFixed(1).replace(/^-0\.0$/, '0.0');
    return sign && factor * value > 0.05 ? `+${shown}` : shown;
  };
  if (estimate[1] === null) return text(estimate[0]);
  return `${text(estimate[0])} (${text(estimate[1])} ${sign ? 'to' : '–'} ${text(estimate[2])})`;
}

function pText(p) {
  if (p === null) return '–';
  return p < 0.001 ? '< 0.001' : p.toFixed(3);
}

// Ticks at round numbers from `low` to `high`.
function ticksBetween(low, high, about) {
  const raw = Math.max(high - low, 1e-9) / about;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw);
  const ticks = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k) ticks.push(k * step);
  return {ticks, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9))};
}

// Rows of dots with whiskers. A row: {label, colour, estimate, dots (numbers), tip}, in the unit of
// the axis; `zero`: where a dashed line stands.
function drawRows(box, rows, axis) {
  const width = widthOf(box);
  const height = rows.length * ROW + 26;
  const drawing = plotIn(box, height, width);
  const x = linear(axis.low, axis.high, 8, width - 8);
  const {ticks, digits} = ticksBetween(axis.low, axis.high, width < 420 ? 4 : 6);
  for (const tick of ticks) {
    drawing.append(svg('line', {x1: x(tick), x2: x(tick), y1: 0, y2: height - 20, class: 'grid'}));
    const anchor = x(tick) < 20 ? 'start' : x(tick) > width - 20 ? 'end' : 'middle';
    drawing.append(svgText(x(tick), height - 5, tick.toFixed(digits), {class: 'faint', 'text-anchor': anchor}));
  }
  if (axis.zero !== undefined) {
    drawing.append(svg('line', {x1: x(axis.zero), x2: x(axis.zero), y1: 0, y2: height - 20, class: 'zero'}));
  }
  rows.forEach((row, index) => {
    const top = index * ROW;
    const y = top + 29;
    const group = svg('g', {});
    group.append(svgText(8, top + 15, shorten(row.label, Math.floor((width - 16) / 6.6))));
    if (row.estimate) {
      const [value, low, high] = row.estimate;
      if (low !== null) {
        group.append(svg('line', {x1: x(low), x2: x(high), y1: y, y2: y, stroke: row.colour, 'stroke-width': 3, opacity: 0.5}));
      }
      for (const dot of row.dots || []) {
        group.append(svg('circle', {cx: x(dot), cy: y, r: 2.5, fill: 'none', stroke: row.colour}));
      }
      group.append(svg('circle', {cx: x(value), cy: y, r: 5, fill: row.colour, 'data-value': value}));
    } else {
      group.append(svgText(8, y + 4, 'none', {class: 'faint'}));
    }
    group.append(svg('rect', {x: 0, y: top, width, height: ROW, class: 'hit'}));
    drawing.append(withTitle(group, row.tip));
  });
  box.dataset.drawn = 'true';
}

// The range of an axis around everything that the rows show.
function rangeOf(rows, always) {
  const shown = rows.flatMap((row) => [...(row.estimate || []), ...(row.dots || [])])
    .filter((value) => value !== null).concat(always);
  const low = Math.min(...shown);
  const high = Math.max(...shown);
  const margin = 0.04 * (high - low) || 1;
  return {low: low - margin, high: high + margin};
}

function drawScores(data) {
  for (const score of SCORES) {
    const box = document.getElementById(score.box);
    const scaled = (value) => (value === null ? null : score.factor * value);
    const rows = data.agents.map((agent, index) => {
      const estimate = agent[score.key];
      const seeds = agent.seed_success.length;
      return {
        label: agent.label,
        colour: colourOf(index),
        estimate: estimate && estimate.map(scaled),
        dots: score.seeds && seeds > 1 ? agent.seed_success.map(scaled) : [],
        tip: `${agent.label}, ${seeds} seed${seeds === 1 ? '' : 's'}\n${score.title} ${estimateText(estimate, score.factor)} ${score.unit}` +
          (score.seeds && seeds > 1 ? `\nSeeds: ${agent.seed_success.map((rate) => (100 * rate).toFixed(1)).join(', ')}` : ''),
      };
    });
    if (rows.every((row) => !row.estimate)) {
      box.parentElement.hidden = true;
      continue;
    }
    const axis = score.full ? {low: 0, high: score.full} : rangeOf(rows, []);
    drawRows(box, rows, axis);
  }
}

function drawPairs(data) {
  const section = document.getElementById('pairs');
  section.hidden = data.pairs.length === 0;
  if (section.hidden) return;
  const name = (pair) => `${data.agents[pair.first].label} − ${data.agents[pair.second].label}`;
  const rowsOf = (key, what, sign) => data.pairs.map((pair) => ({
    label: key === 'difference' ? name(pair) : name(pair).replace(' − ', ' over '),
    colour: colourOf(pair.first),
    estimate: pair[key].map((value) => (value === null ? null : 100 * value)),
    tip: `${name(pair)}\n${what} ${estimateText(pair[key], 100, sign)}\np ${pText(pair.p)}, corrected ${pText(pair.p_holm)}`,
  }));
  const differences = rowsOf('difference', 'Difference [points]', true);
  drawRows(document.getElementById('difference-plot'), differences, {...rangeOf(differences, [0]), zero: 0});
  drawRows(document.getElementById('improvement-plot'), rowsOf('improvement', 'First better [%]', false),
    {low: 0, high: 100, zero: 50});
  const titles = ['First', 'Second', 'Difference [points]', 'First better [%]', 'p of these policies', 'Corrected',
    'p of the trainings', 'Corrected'];
  const rows = data.pairs.map((pair) => element('tr', {},
    element('td', {title: data.agents[pair.first].label}, data.agents[pair.first].label),
    element('td', {title: data.agents[pair.second].label}, data.agents[pair.second].label),
    element('td', {'data-difference': pair.difference[0]}, estimateText(pair.difference, 100, true)),
    element('td', {}, estimateText(pair.improvement, 100, false)),
    ...['p', 'p_holm', 'training_p', 'training_p_holm'].map((key) => element('td', {}, pText(pair[key])))));
  document.getElementById('pair-table').replaceChildren(
    element('thead', {}, element('tr', {}, ...titles.map((title) => element('th', {}, title)))),
    element('tbody', {}, ...rows));
}

function drawProfiles(data) {
  document.getElementById('profile-legend').replaceChildren(
    ...data.agents.map((agent, index) => element('span', {}, swatch(colourOf(index)), agent.label)));
  const box = document.getElementById('profile-plot');
  const width = widthOf(box);
  const height = Math.min(380, Math.max(260, 0.5 * width));
  const drawing = plotIn(box, height, width);
  const x = linear(0, 1, 44, width - 12);
  const y = linear(0, 1, height - 42, 8);
  for (let k = 0; k <= 5; ++k) {
    const part = k / 5;
    drawing.append(svg('line', {x1: x(0), x2: x(1), y1: y(part), y2: y(part), class: 'grid'}));
    drawing.append(svgText(38, y(part) + 4, percent(part), {class: 'faint', 'text-anchor': 'end'}));
    drawing.append(svgText(x(part), height - 24, percent(part), {class: 'faint', 'text-anchor': 'middle'}));
  }
  drawing.append(svgText((x(0) + x(1)) / 2, height - 6, 'success rate on a course above', {class: 'faint', 'text-anchor': 'middle'}));
  const places = data.thresholds;
  const bands = svg('g', {});
  const lines = svg('g', {});
  const dots = svg('g', {});
  drawing.append(bands, lines, dots);
  data.agents.forEach((agent, index) => {
    const colour = colourOf(index);
    const at = (part) => agent.profile.map((share) => (share[part] === null ? share[0] : share[part]));
    const path = (shares) => shares.map((share, k) => `${x(places[k]).toFixed(1)},${y(share).toFixed(1)}`);
    bands.append(svg('polygon', {points: [...path(at(1)), ...path(at(2)).reverse()].join(' '), fill: colour, opacity: 0.13}));
    lines.append(svg('polyline', {points: path(at(0)).join(' '), fill: 'none', stroke: colour, 'stroke-width': 2}));
    agent.profile.forEach((share, k) => dots.append(withTitle(
      svg('circle', {cx: x(places[k]), cy: y(share[0]), r: 3.5, fill: colour}),
      `${agent.label}\n${estimateText(share, 100)} % of its scores are above ${percent(places[k])}`)));
  });
  box.dataset.drawn = 'true';
}

function drawNumbers(data) {
  const titles = ['Agent', 'Seeds', ...SCORES.map((score) => `${score.title} [${score.unit}]`)];
  const rows = data.agents.map((agent, index) => element('tr', {},
    element('td', {class: 'agent', title: agent.files.join('\n')}, swatch(colourOf(index)), agent.label),
    element('td', {}, String(agent.files.length)),
    ...SCORES.map((score) => element('td', {'data-figure': score.key,
      'data-value': agent[score.key] === null ? '' : agent[score.key][0]}, estimateText(agent[score.key], score.factor)))));
  document.getElementById('agent-table').replaceChildren(
    element('thead', {}, element('tr', {}, ...titles.map((title) => element('th', {}, title)))),
    element('tbody', {}, ...rows));
}

function main() {
  const data = JSON.parse(document.getElementById('data').textContent);
  const draw = () => {
    drawScores(data);
    drawPairs(data);
    drawProfiles(data);
  };
  document.getElementById('title').textContent = `comparison on ${data.title}`;
  document.getElementById('lead').textContent =
    `${data.num_courses} course${data.num_courses === 1 ? '' : 's'}. ${data.protocol}`;
  document.getElementById('notes').replaceChildren(
    ...data.notes.map((note) => element('p', {class: 'note caution'}, note)));
  document.getElementById('provenance').textContent =
    `Made of ${data.agents.flatMap((agent) => agent.files).join(', ')}.`;
  drawNumbers(data);
  draw();
  new Theme(draw);
  let width = window.innerWidth;
  window.addEventListener('resize', () => {
    if (window.innerWidth === width) return;
    width = window.innerWidth;
    draw();
  });
  document.body.dataset.ready = 'true';
}

window.addEventListener('error', (event) => {
  const errors = document.getElementById('errors');
  errors.hidden = false;
  errors.textContent += `${event.message}\n`;
});
main();
