// ---- The page of a run: live, where it asks for the run every two seconds, or with the run's data in it.

const kInterval = 2000;
// Title and columns with their names and colours; `isRate`: from 0 to 1. An agent's colours where there are none.
const kOutcomes = [['success_rate', 'success', 'var(--success)'], ['collision_rate', 'collision', 'var(--collision)'],
  ['timeout_rate', 'timeout', 'var(--timeout)']];
const kCharts = [
  {title: 'Training episodes', columns: kOutcomes, isRate: true},
  {title: 'Return', columns: [['episode_return', 'mean return']]},
  {title: 'Episode length', columns: [['episode_steps', 'steps']]},
  {title: 'Simulation rate', columns: [['steps_per_s', 'steps/s']]},
  {title: 'Update rate', columns: [['updates_per_s', 'updates/s']]},
  {title: 'Critic loss', columns: [['critic_loss', 'loss']]},
  {title: 'Values', columns: [['q_mean', 'critics, on what was done'], ['actor_q_mean', 'on what the actor would do']]},
  {title: 'Gradient norms', columns: [['critic_gradient_norm', 'critics'], ['actor_gradient_norm', 'actor']]},
  {title: 'Learning rates', columns: [['critic_learning_rate', 'critics'], ['actor_learning_rate', 'actor']]},
  {title: 'Replay', columns: [['table_steps', 'steps held']]},
  {title: 'Entropy', columns: [['policy_entropy_nats', 'nats'], ['temperature', 'temperature']]},
  {title: 'Constraint', columns: [['cost_q_mean', 'cost'], ['constraint_multiplier', 'multiplier'], ['constraint_violation', 'violation']]},
  {title: 'Model error', columns: [['model_error', 'one step'], ['model_steps_error', 'five steps'], ['model_change', 'standing still']]},
  {title: 'Model loss', columns: [['model_loss', 'loss'], ['model_likelihood_nats', 'likelihood']]},
  {title: 'Inside intervals', columns: [['model_inside_50', 'of 50 %'], ['model_inside_90', 'of 90 %']], isRate: true},
];
const kScores = {title: 'Test scores, 95 % intervals', columns: kOutcomes, isRate: true, dots: true};

const byId = (id) => document.getElementById(id);
let shownPicture = '';
let latest = null;

function fail(text) {
  byId('errors').hidden = text === '';
  byId('errors').textContent = text;
}

function chosen() {
  return decodeURIComponent(location.hash.slice(1));
}

// "training, stage walls (2 of 3)"
function stateOf(run) {
  return run.state + (run.stage === '' ? '' : `, stage ${run.stage}`) +
    (run.state === 'training' && run.age_s > 60 ? `, silent for ${duration(run.age_s)}` : '');
}

function showRuns(runs) {
  byId('runs').replaceChildren(...(runs.length < 2 ? [] : runs).map((run) => {
    const link = element('a', {href: `#${encodeURIComponent(run.name)}`, title: `${stateOf(run)}, ${count(run.steps)} steps`},
      `${run.name} ${percent(run.success_rate, 1)}`);
    if (run.name === chosen()) link.setAttribute('aria-current', 'page');
    return link;
  }));
}

function last(curves, column) {
  const values = curves[column];
  return values ? values[values.length - 1] : null;
}

function showOverview(run) {
  document.title = `${run.name} · Slalom run`;
  byId('name').textContent = run.name;
  byId('state').hidden = !run.state;
  byId('state').className = `state ${run.state}`;
  byId('state').textContent = run.state ? stateOf(run) : '';
  const {curves} = run;
  const cards = [
    ...(run.scores.success_rate ? [['test score', percent(last(run.scores, 'success_rate'), 1)]] : []),
    ['success', percent(run.success_rate, 1)],
    ['collision', percent(last(curves, 'collision_rate'), 1)],
    ['environment steps', count(run.steps)],
    ['steps/s', count(last(curves, 'steps_per_s'))],
    ['updates', count(last(curves, 'updates'))],
    ['updates/s', count(last(curves, 'updates_per_s'))],
    ['training time', duration(run.training_s)],
    ...(run.left_s === null ? [] : [['time left', duration(run.left_s)]]),
  ];
  byId('cards').replaceChildren(...cards.map(([label, figure]) => element('div', {class: 'card', 'data-card': label},
    element('span', {class: 'label'}, label), element('span', {class: 'figure'}, figure))));
  const bar = byId('done').parentElement;
  bar.hidden = run.left_s === null;
  if (!bar.hidden) byId('done').style.width = `${100 * run.training_s / (run.training_s + run.left_s || 1)}%`;
}

// The lines of a chart over column `axis`; empty: nothing of it is known.
function linesOf({columns}, table, axis) {
  const xs = table[axis] || [];
  return columns.filter(([column]) => table[column]).map(([column, label, colour], i) => ({
    label,
    colour: colour || lookOf(i).colour,
    points: xs.map((x, k) => {
      const value = table[column][k];
      const [low, high] = column === 'success_rate' && table.success_low ? [table.success_low[k], table.success_high[k]] : [null, null];
      return {x, name: axis === 'training_s' ? duration(x) : count(x), estimate: value === null ? null : [value, low, high]};
    }).filter((point) => point.x !== null),
  })).filter((line) => line.points.length > 0);
}

function showCharts(run) {
  const axis = byId('axis').value;
  const charts = [{...kScores, table: run.scores}, ...kCharts.map((chart) => ({...chart, table: run.curves}))]
    .map((chart) => ({...chart, lines: linesOf(chart, chart.table, axis)})).filter(({lines}) => lines.length > 0);
  const figures = charts.map(({title, lines}) =>
    element('figure', {'data-chart': title}, element('figcaption', {}, title), element('div', {class: 'plot'}), keyOf(lines)));
  byId('charts').replaceChildren(...figures);
  byId('no-curves').hidden = figures.length > 0;
  charts.forEach(({lines, isRate = false, dots = false}, i) => {
    const highest = Math.max(...lines.flatMap((line) => line.points.map(({x}) => x)));
    const scale = axis === 'training_s' ? timeAxis(highest) : {title: byId('axis').selectedOptions[0].textContent, begin: 0, show: count};
    drawLines(figures[i].querySelector('.plot'), lines, scale,
      {y: {title: '', isRate, low: 0, show: isRate ? percent : count}, dots, height: 210});
  });
}

function showDrives(run) {
  byId('drives').hidden = !run.drives;
  if (!run.drives) return;
  byId('drives-note').textContent = run.drives.note;
  const picture = byId('drives-picture');
  const address = run.drives.number ? `/run/${encodeURIComponent(run.name)}.svg?${run.drives.number}` : '';
  picture.hidden = address === '';
  if (address !== '' && address !== shownPicture) picture.src = address;
  shownPicture = address;
}

function showFacts(run) {
  byId('facts').hidden = run.facts.length === 0;
  byId('facts-table').replaceChildren(...run.facts.map(([name, value]) =>
    element('tr', {}, element('td', {}, name), element('td', {}, value))));
  byId('changes').hidden = run.changes.length === 0;
  byId('changes-table').replaceChildren(...run.changes.map(([key, value]) =>
    element('tr', {'data-change': key}, element('td', {}, keyNode(key)), element('td', {}, element('code', {}, value)))));
}

function show(run) {
  latest = run;
  showOverview(run);
  showCharts(run);
  showDrives(run);
  showFacts(run);
  document.body.dataset.ready = 'true';
}

async function ask(path) {
  return fetch(path, {cache: 'no-store'});
}

async function update() {
  try {
    const {runs} = await (await ask('/runs.json')).json();
    if (chosen() === '' && runs.length > 0) {
      const newest = runs.reduce((best, run) => (run.age_s < best.age_s ? run : best));
      history.replaceState(null, '', `#${encodeURIComponent(newest.name)}`);
    }
    showRuns(runs);
    if (chosen() === '') {
      fail('There is no run here any more.');
      return;
    }
    const answer = await ask(`/run/${encodeURIComponent(chosen())}.json`);
    if (answer.status === 404) {
      fail(`The run ${chosen()} is no longer there${latest ? '; this is what it was.' : '.'}`);
      return;
    }
    if (!answer.ok) throw new Error(await answer.text());
    show(await answer.json());
    fail('');
  } catch (error) {
    fail(`slalom watch does not answer (${error.message}); asking again.`);
  }
}

async function updateForEver() {
  if (!document.hidden || latest === null) await update();
  setTimeout(updateForEver, kInterval);
}

const kInside = readData();
if (kInside === null) {
  window.addEventListener('hashchange', () => {
    latest = null;
    update();
  });
  updateForEver();
} else {
  show(kInside);
}
byId('axis').addEventListener('change', () => latest && showCharts(latest));
redrawOnChange(() => latest && showCharts(latest));
