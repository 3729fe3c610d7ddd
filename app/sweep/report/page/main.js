// ---- The page of a sweep: a section for each score, then what failed and what is missing.

const MAX_MISSING = 100;  // Lines of the list; report.csv has all.
const LOG_RATIO = 20;
const AREA = {key: 'area', title: '', unit: '', factor: 100};

class Page {
  constructor(data) {
    this.data = data;
    this.drawings = [];
    document.title = `${data.title} · Slalom sweep`;
    document.getElementById('title').textContent = data.title;
    document.getElementById('warnings').append(...data.warnings.map((text) => element('p', {class: 'warning'}, text)));
    document.getElementById('provenance').append(...data.provenance.map(([name, value]) =>
      element('tr', {}, element('td', {}, name), element('td', {}, value))));
    for (const score of data.scores) this.addScore(score);
    this.addFailures();
    this.addMissing();
    this.draw();
    redrawOnChange(() => this.draw());
  }

  addSection(id, title) {
    const section = element('section', {id, class: 'long'}, element('h2', {}, title));
    document.getElementById('main').append(section);
    document.getElementById('links').append(element('a', {href: `#${id}`}, shorten(title, 28)));
    return section;
  }

  // A chart with its caption and key, drawn whenever the page is.
  addChart(section, name, caption, draw, key = []) {
    const box = element('div', {class: 'plot', 'data-figure': name});
    section.append(element('figure', {}, element('figcaption', {}, caption), box, ...key));
    this.drawings.push(() => draw(box));
  }

  draw() {
    for (const draw of this.drawings) draw();
  }

  addScore(score) {
    const {agents, protocol, notes, pairs} = score.group;
    if (agents.length === 0) return;
    const section = this.addSection(`score-${score.name}`, score.label);
    const look = (i) => lookOf(agents[i].row);
    section.append(element('p', {class: 'note'}, `Courses: ${score.courses}. ${protocol}`), this.scoreTable(score.group, look));
    section.append(...notes.map((note) => element('p', {class: 'note', 'data-note': 'true'}, note)));
    this.addSuccess(section, agents, look);
    if (score.curves.length > 0) this.addCurves(section, score.curves, agents);
    const profiles = profileLines(agents, look);
    if (profiles.length > 0) {
      section.append(element('h3', {}, 'Performance profile'));
      this.addChart(section, 'profile', 'Share of courses and seeds with more success than the number below',
        (box) => drawProfiles(box, profiles, this.data.thresholds), [keyOf(profiles)]);
    }
    if (pairs.length > 0) {
      section.append(element('h3', {}, 'Row against row'), element('p', {class: 'note'}, PAIR_NOTE),
        pairTable(score.group, agents.map(({label}) => label)));
    }
  }

  scoreTable(group, look) {
    const {agents} = group;
    const name = ({label, seeds, planned, episodes, is_trained: isTrained}, i) => {
      const text = seeds < planned ? `${seeds} of ${planned} seeds` : isTrained ? plural(seeds, 'seed') : 'planner';
      return [swatch(look(i).colour), label, element('span', {class: seeds < planned ? 'sub partial' : 'sub'},
        episodes > 0 ? `${text}, ${episodes} episodes` : text)];
    };
    const parts = figuresTable(quantityColumns(this.data.quantities, group), agents,
      {head: 'Row', name, colour: (i) => look(i).colour});
    return element('div', {class: 'scroll'}, element('table', {class: 'figures-table'}, ...parts));
  }

  // Success over each axis whose labels are numbers, and that of each row if there is none.
  addSuccess(section, agents, look) {
    const axes = this.data.axes.map((name, a) => ({name, lines: axisLines(agents, this.data.axes, a)}))
      .filter(({lines}) => lines.some(({points}) => points));
    for (const {name, lines} of axes) this.addAxis(section, name, lines);
    if (axes.length > 0 || agents.length < 2) return;
    const rows = agents.map((agent, i) => {
      const {estimate, seeds} = agent.figures.success_rate;
      return {label: agent.label, colour: look(i).colour, estimate, seeds, published: publishedOf(agent, 'success_rate'),
        tip: `${agent.label}\n${estimateText(estimate)}${seeds.length > 1 ? `\nseeds: ${seeds.map((s) => percent(s, 1)).join(', ')}` : ''}`};
    });
    this.addChart(section, 'dots', 'Success: means, 95 % intervals, seeds as ticks, published numbers as diamonds', (box) =>
      drawRows(box, rows, {low: 0, high: 1, show: percent}));
  }

  addAxis(section, name, lines) {
    const points = lines.flatMap((line) => line.points || []);
    const marks = [...new Set(points.map(({x}) => x))].sort((x, y) => x - y);
    const axis = {title: name, log: marks[0] > 0 && marks[marks.length - 1] / marks[0] > LOG_RATIO, marks,
      show: (value) => points.find(({x}) => x === value).text};  // As the plan writes it.
    const sources = [...new Set(points.flatMap(({published}) => published.map(({source}) => source)))];
    this.addChart(section, 'axis', `Success over ${name}. Bands are 95 % intervals, diamonds published numbers.`, (box) =>
      drawLines(box, lines, axis), [keyOf(lines, sources)]);
  }

  addCurves(section, curves, agents) {
    const lines = (key) => curves.filter(({points}) => points.every((point) => point[key] !== null)).map((curve) => ({
      label: agents[curve.agent].label, ...lookOf(agents[curve.agent].row), points: curve.points.map((point) => ({x: point[key], estimate: point.success,
        name: `${count(point.steps)} steps${point.seconds === null ? '' : `, ${duration(point.seconds)}`}`}))}));
    const pair = element('div', {class: 'pair'});
    section.append(element('h3', {}, 'Sample efficiency'), pair);
    this.addChart(pair, 'steps', 'Success over environment steps', (box) =>
      drawLines(box, lines('steps'), {title: 'environment steps', begin: 0, show: count}));
    const timed = lines('seconds');
    if (timed.length > 0) {
      this.addChart(pair, 'seconds', 'Success over training time', (box) =>
        drawLines(box, timed, timeAxis(Math.max(...timed.flatMap(({points}) => points.map(({x}) => x))))));
    }
    const rows = curves.map((curve) => element('tr', {}, element('td', {class: 'wrap'}, agents[curve.agent].label,
      element('span', {class: 'sub'}, `${curve.seeds} of ${plural(curve.planned, 'seed')}`)),
    figureCell(AREA, curve.area_over_steps), figureCell(AREA, curve.area_over_seconds)));
    section.append(keyOf(lines('steps')), scrollTable('compact', ['Area under the curve [%]', 'over steps', 'over seconds'], rows),
      element('p', {class: 'note'}, 'The area is the mean height of the curve from its first to its last snapshot.'));
  }

  addFailures() {
    if (this.data.failures.length === 0) return;
    const section = this.addSection('failures', 'Failures');
    for (const {cell, id, what, log} of this.data.failures) {
      section.append(element('h3', {}, cell), element('p', {class: 'note'}, `cells/${id}: ${what}`));
      if (log) section.append(element('pre', {class: 'log'}, log));
    }
  }

  addMissing() {
    const {missing} = this.data;
    if (missing.length === 0) return;
    const section = this.addSection('missing', 'Missing evaluations');
    section.append(element('ul', {class: 'missing'}, ...missing.slice(0, MAX_MISSING).map((text) => element('li', {}, text))));
    if (missing.length > MAX_MISSING) {
      section.append(element('p', {class: 'note'}, `And ${missing.length - MAX_MISSING} more, which report.csv lists.`));
    }
  }
}

// Lines of success over axis `a`, one for each combination of the other labels. Rows without the axis are levels. None if
// labels are no numbers, or there is one number.
function axisLines(agents, axes, a) {
  const labels = agents.filter((agent) => agent.labels.length > a).map((agent) => agent.labels[a]);
  const isNumber = (label) => label.trim() !== '' && Number.isFinite(Number(label));
  if (!labels.every(isNumber) || new Set(labels.map(Number)).size < 2) return [];
  const lines = new Map();
  for (const agent of agents) {
    const {label, labels: own} = agent;
    const {estimate} = agent.figures.success_rate;
    const published = publishedOf(agent, 'success_rate');
    if (estimate === null && published.length === 0) continue;
    if (own.length <= a) {
      lines.set(label, {label, level: estimate});
      continue;
    }
    const others = own.filter((_, i) => i !== a).join(' / ');
    if (!lines.has(others)) lines.set(others, {label: others || 'success', points: []});
    lines.get(others).points.push({x: Number(own[a]), text: own[a], name: `${axes[a]} ${own[a]}`, estimate, published});
  }
  return [...lines.values()].filter(({level}) => level !== null).map((line, i) => {
    if (line.points) line.points.sort((p, q) => p.x - q.x);
    return {...line, ...lookOf(i)};
  });
}

new Page(readData());
document.body.dataset.ready = 'true';
