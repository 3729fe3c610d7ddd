// ---- The section of one score: its table, and figures of what no axis shows.

const QUANTITIES = [
  {key: 'success_rate', title: 'Success', unit: '%', factor: 100},
  {key: 'collision_rate', title: 'Collision', unit: '%', factor: 100},
  {key: 'survival_time_s', title: 'Survival', unit: 's', factor: 1},
  {key: 'traversal_time_s', title: 'Traversal', unit: 's', factor: 1},
];

const INTERQUARTILE = {key: 'iqm', title: 'IQM', unit: '%', factor: 100};
const WORST = {key: 'worst', title: 'Worst 5 %', unit: '%', factor: 100};
const AREA = {key: 'area', title: '', unit: '', factor: 100};

function seedsNode({seeds, planned, episodes}, isPlanner = false) {
  const text = seeds === planned ? (isPlanner ? 'planner' : plural(seeds, 'seed')) : `${seeds} of ${planned} seeds`;
  return element('span', {class: seeds === planned ? 'sub' : 'sub partial'}, episodes > 0 ? `${text}, ${episodes} episodes` : text);
}

function trainingCells({steps, imagined, training_s}) {
  return [element('td', {'data-title': 'Steps'}, count(steps),
    ...(imagined === null ? [] : [element('span', {class: 'sub'}, `+ ${count(imagined)} imagined`)])),
  element('td', {'data-title': 'Training'}, duration(training_s))];
}

function scoreTable(page, score) {
  const figures = [QUANTITIES[0], INTERQUARTILE, WORST, ...QUANTITIES.slice(1)];
  const head = [page.rowHead(), ...figures.map(figureTitle), 'Steps', 'Training'];
  const rows = score.rows.map((row) => {
    const agent = element('td', {class: 'agent', 'data-title': page.rowHead()}, swatch(lookOf(row.row).colour), page.data.rows[row.row].name,
      seedsNode(row, page.data.rows[row.row].is_planner));
    const cells = QUANTITIES.map((quantity) => {
      const cell = figureCell(quantity, row.figures[quantity.key].estimate, {'data-score': score.name, 'data-row': row.row});
      for (const published of row.published[quantity.key]) {
        cell.append(element('span', {class: 'sub'}, `${published.source}: `,
          element('span', {class: 'published-value'}, publishedText(published, quantity.factor))));
      }
      return cell;
    });
    return element('tr', {}, agent, cells[0], figureCell(INTERQUARTILE, row.iqm), figureCell(WORST, row.worst),
      ...cells.slice(1), ...trainingCells(row));
  });
  return scrollTable('figures-table', head, rows);
}

// A chart with its heading and key, drawn whenever the page is.
function addChart(page, section, name, caption, lines, draw) {
  const box = element('div', {class: 'plot', 'data-figure': name});
  section.append(element('figure', {}, ...(caption ? [element('figcaption', {}, caption)] : []), box, ...(lines ? [keyOf(lines)] : [])));
  page.onDraw(() => draw(box));
}

function addDots(page, section, score) {
  const onAxis = new Set(numericAxes(page.data).flatMap(({a}) =>
    page.data.rows.map((row, r) => (row.labels.length > a ? r : -1))));
  const rows = score.rows.filter((row) => !onAxis.has(row.row)).map((row) => {
    const {estimate} = row.figures.success_rate;
    const label = page.rowTitle(row.row);
    const seeds = row.seed_success;
    return {label, colour: lookOf(row.row).colour, estimate, seeds, published: row.published.success_rate,
      tip: `${label}\n${estimateText(estimate)}${seeds.length > 1 ? `\nseeds: ${seeds.map((s) => percent(s, 1)).join(', ')}` : ''}`};
  });
  if (rows.length < 2) return;
  section.append(element('h3', {}, 'Success'));
  addChart(page, section, 'dots', rows.some((row) => row.published.length > 0) ?
    'Dots are means, bars 95 % intervals, ticks seeds, diamonds published numbers.' :
    'Dots are means, bars 95 % intervals, ticks seeds.', null, (box) =>
    drawRows(box, rows, {low: 0, high: 1, show: percent}));
}

function addCurves(page, section, score) {
  if (score.curves.length === 0) return;
  const lines = (key) => score.curves.filter((curve) => curve.points.every((point) => point[key] !== null)).map((curve) => ({
    label: page.rowTitle(curve.row), ...lookOf(curve.row),
    points: curve.points.map((point) => ({x: point[key], estimate: point.success,
      name: `${count(point.steps)} steps${point.seconds === null ? '' : `, ${duration(point.seconds)}`}`}))}));
  section.append(element('h3', {}, 'Sample efficiency'));
  const pair = element('div', {class: 'pair'});
  section.append(pair);
  addChart(page, pair, 'steps', 'Success over environment steps', null, (box) =>
    drawLines(box, lines('steps'), {title: 'environment steps', begin: 0, show: count}));
  if (lines('seconds').length > 0) {
    addChart(page, pair, 'seconds', 'Success over training time', null, (box) =>
      drawLines(box, lines('seconds'), timeAxis(Math.max(...lines('seconds').flatMap((line) => line.points.map(({x}) => x))))));
  }
  section.append(keyOf(lines('steps')));
  const rows = score.curves.map((curve) => element('tr', {},
    element('td', {class: 'wrap'}, page.rowTitle(curve.row), seedsNode({...curve, episodes: 0})),
    figureCell(AREA, curve.area_over_steps), figureCell(AREA, curve.area_over_seconds)));
  const head = ['Area under the curve [%]', 'over steps', 'over seconds'];
  section.append(scrollTable('compact', head, rows), element('p', {class: 'note'}, 'The area is the mean height of the curve from its first to its last snapshot.'));
}

function addProfiles(page, section, score) {
  if (score.profiles.length === 0) return;
  const lines = score.profiles.map((profile) => ({label: page.rowTitle(profile.row), ...lookOf(profile.row), shares: profile.shares}));
  section.append(element('h3', {}, 'Performance profile'));
  addChart(page, section, 'profile', 'Share of courses and seeds with more success than the number below', lines, (box) =>
    drawProfiles(box, lines, page.data.thresholds));
}

function addPairs(page, section, score) {
  if (score.pairs.length === 0 && score.pairs_note === '') return;
  section.append(element('h3', {}, 'Row against row'));
  if (score.pairs.length > 0) {
    const rows = score.pairs.map((pair) => {
      const [value, low, high] = pair.difference;
      return element('tr', {'data-pair': `${pair.first} ${pair.second}`},
        element('td', {class: 'wrap'}, page.rowTitle(pair.first), element('span', {class: 'sub'}, `against ${page.rowTitle(pair.second)}`)),
        element('td', {}, element('span', {class: 'value'}, signed(100 * value)),
          element('span', {class: 'sub'}, low === null ? '' : `${signed(100 * low)} to ${signed(100 * high)}`)),
        element('td', {'data-p': pair.p}, pText(pair.p)), element('td', {}, pText(pair.training_p)),
        element('td', {class: 'wrap', 'data-verdict': pair.verdict}, pair.verdict), element('td', {}, percent(pair.improvement[0])));
    });
    const head = ['', 'Difference [points]', 'p, courses', 'p, trainings', 'Verdict', 'Better on a course'];
    section.append(element('p', {class: 'note'}, 'Success of one row minus that of the other on the same courses and starts. ' +
      'p-values are of permutation tests, corrected by Holm for the number of pairs: over courses for these trained policies, ' +
      'over trainings for the two ways to train. Few seeds cannot give a small one. The verdict is that of the trainings, ' +
      'or that of the courses for two planners.'),
    scrollTable('compact', head, rows));
  }
  if (score.pairs_note) section.append(element('p', {class: 'note'}, score.pairs_note));
}

function addScoreSection(page, score) {
  if (score.rows.length === 0) return;
  const section = page.addSection(`score-${score.name}`, score.label, score.label);
  section.append(element('p', {class: 'note'}, `Courses: ${score.courses}. ${score.protocol}`), scoreTable(page, score));
  if (score.best_row) section.append(element('p', {class: 'note', 'data-best': 'true'}, score.best_row));
  if (score.overlap) section.append(element('p', {class: 'note'}, score.overlap));
  addDots(page, section, score);
  addCurves(page, section, score);
  addProfiles(page, section, score);
  addPairs(page, section, score);
}
