// ---- Agents that were compared (eval/comparison/printers.h, JsonOf): their figures, pairs and profiles.

// The quantities that a group shows, in order. A title begins with a capital.
function quantityColumns(quantities, {columns}) {
  return columns.map((key) => quantities.find((quantity) => quantity.key === key))
    .map((quantity) => ({...quantity, title: quantity.title[0].toUpperCase() + quantity.title.slice(1)}));
}

// A strip with an estimate, its interval and, if there are several, the seeds.
function drawWhisker(estimate, seeds, factor, full, colour) {
  const width = 104;
  const x = linear(0, full, 4, width - 4);
  const drawing = svg('svg', {width, height: 12, viewBox: `0 0 ${width} 12`});
  drawing.append(svg('line', {x1: x(0), x2: x(full), y1: 6, y2: 6, stroke: 'var(--grid)', 'stroke-width': 2}));
  const [value, low, high] = estimate.map((number) => (number === null ? null : factor * number));
  if (low !== null) {
    drawing.append(svg('line', {x1: x(low), x2: x(high), y1: 6, y2: 6, stroke: colour, 'stroke-width': 3, opacity: 0.45}));
  }
  for (const seed of seeds.length > 1 ? seeds : []) {
    drawing.append(svg('line', {x1: x(factor * seed), x2: x(factor * seed), y1: 1, y2: 11, stroke: colour, opacity: 0.6}));
  }
  drawing.append(svg('circle', {cx: x(value), cy: 6, r: 4, fill: colour}));
  return drawing;
}

// The published numbers of a quantity of an agent: {source, value, deviation}.
function publishedOf({published}, key) {
  return (published && published[key]) || [];
}

function trainingCell({steps, imagined, training_s: seconds}) {
  return element('td', {'data-title': 'Training'}, `${count(steps)} steps`, ...(isKnown(imagined) ?
    [element('span', {class: 'sub'}, `+ ${count(imagined)} imagined`)] : []), element('span', {class: 'sub'}, duration(seconds)));
}

// A table with a line for each agent. `name(agent, i)`: nodes of its first cell; `colour(i)`.
function figuresTable(columns, agents, {head = 'Agent', name, colour, attributes = () => ({})}) {
  const shown = columns.filter(({key}) => agents.some((agent) => agent.figures[key].estimate !== null));
  // Where a strip ends: at the largest value that there can be, or else at the highest of the column.
  const fullOf = ({key, factor, limit}) => (limit !== null ? factor * limit : Math.max(1e-9, ...agents
    .flatMap((agent) => [...(agent.figures[key].estimate || []), ...agent.figures[key].seeds]).map((number) => factor * number)));
  const hasTraining = agents.some((agent) => agent.steps !== undefined);
  const titles = [head, ...shown.map((quantity) => element('span', {}, figureTitle(quantity),
    element('span', {class: 'sub'}, `strips 0 – ${Number(fullOf(quantity).toPrecision(3))}`))), ...(hasTraining ? ['Training'] : [])];
  const rows = agents.map((agent, i) => element('tr', {}, element('td', {class: 'agent', title: agent.label, 'data-title': head}, ...name(agent, i)),
    ...shown.map((quantity) => {
      const {estimate, seeds} = agent.figures[quantity.key];
      const cell = figureCell(quantity, estimate, attributes(i));
      if (estimate !== null) cell.append(drawWhisker(estimate, seeds, quantity.factor, fullOf(quantity), colour(i)));
      cell.append(...publishedOf(agent, quantity.key).map((number) => element('span', {class: 'sub'}, `${number.source}: `,
        element('span', {class: 'published-value'}, publishedText(number, quantity.factor)))));
      return cell;
    }), ...(hasTraining ? [trainingCell(agent)] : [])));
  return tableParts(titles, rows);
}

// The rows of a table of pairs, with the verdicts of the comparison. `labels`: of the agents.
function pairTable({pairs}, labels) {
  const rows = pairs.map((pair) => {
    const [value, low, high] = pair.differences.success_rate;
    return element('tr', {'data-pair': `${pair.first} ${pair.second}`},
      element('td', {class: 'wrap'}, labels[pair.first], element('span', {class: 'sub'}, `against ${labels[pair.second]}`)),
      element('td', {'data-value': value}, element('span', {class: 'value'}, signed(100 * value)),
        element('span', {class: 'sub'}, low === null ? '' : `${signed(100 * low)} to ${signed(100 * high)}`)),
      element('td', {'data-p': pair.p_corrected}, pText(pair.p_corrected)), element('td', {}, pText(pair.training_p_corrected)),
      element('td', {class: 'wrap', 'data-verdict': pair.verdict}, pair.verdict), element('td', {}, percent(pair.improvement[0])));
  });
  return scrollTable('compact', ['', 'Difference [points]', 'p of these policies', 'p of the trainings', 'Verdict', 'First better on a course'], rows);
}

const PAIR_NOTE = 'Success of one agent minus that of the other on the same courses. p-values are of permutation tests, corrected by ' +
  'Holm for the number of pairs: over courses for these policies, over trainings for the two ways to train. Few seeds cannot give ' +
  'a small one. The verdict is that of the trainings, or that of the courses where nothing was trained.';

// The lines of `drawProfiles`. `look(i)`: colour and dash of an agent.
function profileLines(agents, look) {
  return agents.map((agent, i) => ({label: agent.label, ...look(i), shares: agent.profile})).filter(({shares}) => shares.length > 0);
}
