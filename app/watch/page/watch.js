// ---- Asks for the run every two seconds and shows what is new.

const kInterval = 2000;
const kUnit = [0, 1];
// Title, columns with their names, range, whether the values are rates.
const kCharts = [
  ['Episodes', [['success_rate', 'success'], ['collision_rate', 'collision'], ['timeout_rate', 'timeout']], kUnit, true],
  ['Return', [['episode_return', 'mean return']]],
  ['Episode length', [['episode_steps', 'steps']]],
  ['Simulation rate', [['steps_per_s', 'steps/s']]],
  ['Update rate', [['updates_per_s', 'updates/s']]],
  ['Critic loss', [['critic_loss', 'loss']]],
  ['Values', [['q_mean', 'critics, on what was done'], ['actor_q_mean', 'on what the actor would do']]],
  ['Gradient norms', [['critic_gradient_norm', 'critics'], ['actor_gradient_norm', 'actor']]],
  ['Replay', [['table_steps', 'steps held']]],
  ['Entropy', [['policy_entropy_nats', 'nats'], ['temperature', 'temperature']]],
  ['Constraint', [['cost_q_mean', 'cost'], ['constraint_multiplier', 'multiplier'], ['constraint_violation', 'violation']]],
  ['Model error', [['model_error', 'one step'], ['model_steps_error', 'five steps'], ['model_change', 'standing still']]],
  ['Model loss', [['model_loss', 'loss'], ['model_likelihood_nats', 'likelihood']]],
  ['Inside intervals', [['model_inside_50', 'of 50 %'], ['model_inside_90', 'of 90 %']], kUnit, true],
];

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

function showRuns(runs) {
  byId('runs').replaceChildren(...(runs.length < 2 ? [] : runs).map((run) => {
    const link = element('a', {href: `#${encodeURIComponent(run.name)}`, title: `${run.state}, ${count(run.steps)} steps`},
      `${run.name} ${percent(run.success_rate)}`);
    if (run.name === chosen()) link.setAttribute('aria-current', 'page');
    return link;
  }));
}

function last(curves, column) {
  const values = curves[column];
  return values ? values[values.length - 1] : null;
}

function showOverview(run) {
  document.title = `${run.name} · Slalom watch`;
  byId('name').textContent = run.name;
  byId('state').className = `state ${run.state}`;
  byId('state').textContent = run.state === 'training' && run.age_s > 60
    ? `training, silent for ${duration(run.age_s)}` : run.state;
  const {curves} = run;
  const cards = [
    ['success', percent(run.success_rate)],
    ['collision', percent(last(curves, 'collision_rate'))],
    ['environment steps', count(run.steps)],
    ['steps/s', count(last(curves, 'steps_per_s'))],
    ['updates', count(last(curves, 'updates'))],
    ['updates/s', count(last(curves, 'updates_per_s'))],
    ['training time', duration(run.training_s)],
    ['time left', duration(run.left_s)],
  ];
  byId('cards').replaceChildren(...cards.map(([label, figure]) => element('div', {class: 'card', 'data-card': label},
    element('span', {class: 'label'}, label), element('span', {class: 'figure'}, figure))));
  const bar = byId('done').parentElement;
  bar.hidden = run.left_s === null;
  if (!bar.hidden) byId('done').style.width = `${100 * run.training_s / (run.training_s + run.left_s || 1)}%`;
}

function showCharts(run) {
  const {curves} = run;
  const axis = byId('axis').value;
  const xs = curves[axis] || [];
  const showX = axis === 'training_s' ? duration : count;
  const figures = [];
  for (const [title, columns, range, isRate] of xs.length === 0 ? [] : kCharts) {
    const series = columns.filter(([column]) => curves[column]).map(([column, name]) => [name, curves[column]]);
    if (series.length === 0) continue;
    const showY = isRate ? (value) => `${Number((100 * value).toPrecision(3))} %` : count;
    const drawing = drawChart(series, xs, {range, showX, showY});
    addTip(drawing, series, xs, showX, showY);
    const figure = element('figure', {'data-chart': title}, element('figcaption', {}, title), drawing);
    figure.append(element('div', {class: 'key'}, ...series.map(([name], i) => {
      const swatch = element('span', {class: 'swatch'});
      swatch.style.background = kColours[i];
      return element('span', {}, swatch, name);
    })));
    figures.push(figure);
  }
  byId('charts').replaceChildren(...figures);
  byId('no-curves').hidden = figures.length > 0;
}

function showDrives(run) {
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

byId('axis').addEventListener('change', () => latest && showCharts(latest));
window.addEventListener('hashchange', () => {
  latest = null;
  update();
});
updateForEver();
