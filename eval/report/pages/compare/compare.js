// ---- The page of `slalom compare`: scores, differences and profiles of agents.

const SCORES = [
  {key: 'success_rate', box: 'success-plot', title: 'Success', unit: '%', factor: 100, full: 100, seeds: true},
  {key: 'success_rate_iqm', box: 'iqm-plot', title: 'Success, IQM', unit: '%', factor: 100, full: 100},
  {key: 'collision_rate', box: 'collision-plot', title: 'Collision', unit: '%', factor: 100, full: 100},
  {key: 'traversal_time_s', box: 'traversal-plot', title: 'Traversal', unit: 's', factor: 1},
];

function scaled(estimate, factor) {
  return estimate && estimate.map((value) => (value === null ? null : factor * value));
}

function numberOnAxis(tick) {
  return String(tick).replace('-', '−');
}

// The ends of an axis around `low`, `high` and everything that the rows show.
function rangeOf(rows, low, high) {
  const shown = rows.flatMap((row) => row.estimate || []).filter((value) => value !== null);
  const margin = 0.04 * (Math.max(high, ...shown) - Math.min(low, ...shown)) || 1;
  return {low: Math.min(low, ...shown.map((value) => value - margin)), high: Math.max(high, ...shown.map((value) => value + margin)),
    show: numberOnAxis};
}

function drawScores(data) {
  for (const {key, box, title, unit, factor, full, seeds} of SCORES) {
    const rows = data.agents.map((agent, index) => {
      const count = agent.seed_success.length;
      const perSeed = seeds && count > 1 ? agent.seed_success.map((rate) => factor * rate) : [];
      return {
        label: agent.label,
        colour: lookOf(index).colour,
        estimate: scaled(agent[key], factor),
        seeds: perSeed,
        tip: `${agent.label}, ${plural(count, 'seed')}\n${title} ${estimateText(agent[key], {factor, unit: ` ${unit}`})}` +
          (perSeed.length > 0 ? `\nSeeds: ${perSeed.map((rate) => rate.toFixed(1)).join(', ')}` : ''),
      };
    });
    const node = document.getElementById(box);
    node.parentElement.hidden = rows.every((row) => !row.estimate);
    if (!node.parentElement.hidden) drawRows(node, rows, full ? {low: 0, high: full, show: numberOnAxis} : rangeOf(rows, 0, 0));
  }
}

function drawPairs(data) {
  document.getElementById('pairs').hidden = data.pairs.length === 0;
  if (data.pairs.length === 0) return;
  const points = {unit: '', sign: true};
  const chance = {unit: ''};
  const rowsOf = (key, sign, what, format) => data.pairs.map((pair) => {
    const name = `${data.agents[pair.first].label} ${sign} ${data.agents[pair.second].label}`;
    return {
      label: name,
      colour: lookOf(pair.first).colour,
      estimate: scaled(pair[key], 100),
      tip: `${name}\n${what} ${estimateText(pair[key], format)}\np ${pText(pair.p)}, corrected ${pText(pair.p_holm)}`,
    };
  });
  const differences = rowsOf('difference', '−', 'Difference [points]', points);
  drawRows(document.getElementById('difference-plot'), differences, {...rangeOf(differences, 0, 0), zero: 0});
  drawRows(document.getElementById('improvement-plot'), rowsOf('improvement', 'over', 'First better [%]', chance),
    {low: 0, high: 100, zero: 50, show: numberOnAxis});
  const titles = ['First', 'Second', 'Difference [points]', 'First better [%]', 'p of these policies', 'Corrected',
    'p of the trainings', 'Corrected'];
  document.getElementById('pair-table').replaceChildren(...tableParts(titles, data.pairs.map((pair) => element('tr', {},
    element('td', {class: 'agent'}, data.agents[pair.first].label),
    element('td', {class: 'agent'}, data.agents[pair.second].label),
    element('td', {'data-difference': pair.difference[0]}, estimateText(pair.difference, points)),
    element('td', {}, estimateText(pair.improvement, chance)),
    ...['p', 'p_holm', 'training_p', 'training_p_holm'].map((key) => element('td', {}, pText(pair[key])))))));
}

function drawProfileSection(data) {
  const lines = data.agents.map((agent, index) => ({label: agent.label, ...lookOf(index), shares: agent.profile}));
  const box = document.getElementById('profile-plot');
  drawProfiles(box, lines, data.thresholds);
  box.dataset.drawn = 'true';
  document.getElementById('profile-key').replaceChildren(keyOf(lines));
}

function drawNumbers(data) {
  const titles = ['Agent', ...SCORES.map(figureTitle)];
  document.getElementById('agent-table').replaceChildren(...tableParts(titles, data.agents.map((agent, index) => element('tr', {},
    element('td', {class: 'agent', title: agent.files.join('\n')}, swatch(lookOf(index).colour), agent.label,
      element('span', {class: 'sub'}, plural(agent.files.length, 'seed'))),
    ...SCORES.map((score) => figureCell(score, agent[score.key]))))));
}

function main() {
  const data = readData();
  const draw = () => {
    drawScores(data);
    drawPairs(data);
    drawProfileSection(data);
  };
  document.getElementById('page-title').textContent = `comparison on ${data.title}`;
  document.getElementById('lead').textContent = `${plural(data.num_courses, 'course')}. ${data.protocol}`;
  document.getElementById('notes').replaceChildren(
    ...data.notes.map((note) => element('p', {class: 'note caution'}, note)));
  document.getElementById('provenance').textContent =
    `Made of ${data.agents.flatMap((agent) => agent.files).join(', ')}.`;
  drawNumbers(data);
  document.getElementById('settings').replaceChildren(...settingTables(data.settings));
  document.getElementById('settings').hidden = data.settings.length === 0;
  document.querySelector('nav a[href="#settings"]').hidden = data.settings.length === 0;
  draw();
  redrawOnChange(draw);
  document.body.dataset.ready = 'true';
}

main();
