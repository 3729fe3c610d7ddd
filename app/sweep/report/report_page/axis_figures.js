// ---- Success over the axes whose labels are numbers.

const MAX_LINES = 8;  // Of one figure with several scores.
const LOG_RATIO = 20;

function isNumber(label) {
  return label !== undefined && label.trim() !== '' && Number.isFinite(Number(label));
}

// The numbers of axis `a`; none: it has other labels, or a single number.
function numbersOf(data, a) {
  const labels = data.rows.filter((row) => row.labels.length > a).map((row) => row.labels[a]);
  if (!labels.every(isNumber)) return [];
  const numbers = [...new Set(labels.map(Number))].sort((x, y) => x - y);
  return numbers.length < 2 ? [] : numbers;
}

function numericAxes(data) {
  return data.axes.map((name, a) => ({a, name, numbers: numbersOf(data, a)})).filter(({numbers}) => numbers.length > 0);
}

// One line for each score and combination of the other labels. Rows without the axis are levels.
function axisLines(data, scores, a) {
  const lines = new Map();
  for (const score of scores) {
    for (const row of score.rows) {
      const {estimate} = row.figures.success_rate;
      const published = row.published.success_rate;
      if (estimate === null && published.length === 0) continue;
      const {name, labels} = data.rows[row.row];
      const others = labels.filter((_, i) => i !== a);
      const label = [...others, ...(scores.length > 1 || others.length === 0 ? [score.label] : [])].join(' / ');
      if (labels.length <= a) {
        if (estimate === null) continue;
        lines.set(`${score.name} ${name}`, {label: scores.length > 1 ? `${name} / ${score.label}` : name, level: estimate});
        continue;
      }
      const key = JSON.stringify([score.name, others]);
      if (!lines.has(key)) lines.set(key, {label, points: []});
      lines.get(key).points.push({x: Number(labels[a]), name: `${data.axes[a]} ${labels[a]}`, estimate, published});
    }
  }
  return [...lines.values()].map((line, i) => {
    if (line.points) line.points.sort((p, q) => p.x - q.x);
    return {...line, ...lookOf(i)};
  });
}

function sourcesOf(lines) {
  return [...new Set(lines.flatMap((line) => (line.points || []).flatMap((point) => point.published.map(({source}) => source))))];
}

// The figures of one axis: one for all scores, or one for each where there would be too many lines.
function axisFigures(data, {a, name, numbers}) {
  const shown = data.scores.filter((score) => score.rows.some((row) => row.seeds > 0));
  const together = axisLines(data, shown, a).length <= MAX_LINES;
  const positive = numbers[0] > 0;
  const axis = {title: name, log: positive && numbers[numbers.length - 1] / numbers[0] > LOG_RATIO, marks: numbers,
    show: (value) => data.rows.map((row) => row.labels[a]).find((label) => Number(label) === value)};  // As the plan writes it.
  return (together ? [shown] : shown.map((score) => [score])).map((scores) => ({
    title: together ? '' : scores[0].label, lines: axisLines(data, scores, a), axis}))
    .filter(({lines}) => lines.some((line) => line.points));
}

function addAxisSections(page) {
  for (const found of numericAxes(page.data)) {
    const figures = axisFigures(page.data, found);
    if (figures.length === 0) continue;
    const section = page.addSection(`axis-${found.a}`, `Success over ${found.name}`, found.name);
    for (const {title, lines, axis} of figures) {
      const box = element('div', {class: 'plot', 'data-figure': 'axis'});
      const figure = element('figure', {}, ...(title ? [element('figcaption', {}, title)] : []), box, keyOf(lines, sourcesOf(lines)));
      section.append(figure);
      page.onDraw(() => drawLines(box, lines, axis));
    }
    section.append(element('p', {class: 'note'}, 'Bands are 95 % intervals.' +
      (figures.some(({lines}) => sourcesOf(lines).length > 0) ? ' Diamonds are published numbers with their standard deviations.' : '')));
  }
}
