// ---- Failures: a list of the episodes that did not reach the goal.

const FAILURES_AT_FIRST = 12;

class FailureList {
  // `onPlay(failure)`: a failure was chosen.
  constructor(data, onPlay) {
    this.data = data;
    this.onPlay = onPlay;
    for (const id of ['failure-agent', 'failure-kind']) {
      document.getElementById(id).addEventListener('change', () => this.draw());
    }
    document.getElementById('more-failures').addEventListener('click', () => {
      this.showsAll = true;
      this.draw();
    });
  }

  show(group) {
    this.group = group;
    this.showsAll = false;
    this.failures = findFailures(this.data, group);
    const select = document.getElementById('failure-agent');
    select.replaceChildren(element('option', {value: ''}, 'all agents'), ...group.results.map((index) =>
      element('option', {value: index}, this.data.results[index].label)));
    document.getElementById('failure-agent-choice').hidden = group.results.length < 2;
    const kind = document.getElementById('failure-kind');
    kind.value = 'CT';
    document.getElementById('failure-kind-choice').hidden =
      new Set(this.failures.map(({outcome}) => outcome)).size < 2;
    this.draw();
  }

  draw() {
    const agent = document.getElementById('failure-agent').value;
    const kind = document.getElementById('failure-kind').value;
    const chosen = this.failures.filter(({result, outcome}) =>
      (agent === '' || this.data.results[Number(agent)] === result) && kind.includes(outcome));
    const shown = this.showsAll ? chosen : chosen.slice(0, FAILURES_AT_FIRST);
    const several = this.group.results.length > 1;
    const rows = shown.map((failure) => this.row(failure, several));
    document.getElementById('failure-table').replaceChildren(
      ...tableParts(['Course', 'Episode', ...(several ? ['Agent'] : []), 'Ended by', 'After'], rows));
    document.getElementById('failure-note').textContent =
      describeFailures(chosen.length, chosen.filter(({track}) => track).length);
    const more = document.getElementById('more-failures');
    more.hidden = shown.length === chosen.length;
    more.textContent = `Show all ${chosen.length}`;
  }

  row(failure, several) {
    const {result, course, episode, outcome, time, track} = failure;
    const name = this.group.courses[course].name;
    const button = element('button', {class: 'link', 'data-episode': `${result.label}/${name}/${episode}`},
      (track ? '▶ ' : '') + name);
    button.addEventListener('click', () => this.onPlay(failure));
    return element('tr', {}, element('td', {}, button), element('td', {}, episode),
      ...(several ? [element('td', {title: result.label}, swatch(result.colour), result.label)] : []),
      element('td', {}, OUTCOMES[outcome]), element('td', {}, `${time.toFixed(1)} s`));
  }
}

function describeFailures(count, recorded) {
  if (count === 1) {
    return `1 failed episode. ${recorded === 1 ? 'Click it to see it driven.' :
      'It was not recorded; click it to see its course.'}`;
  }
  const which = recorded === count ? 'Click one to see it driven.' :
    recorded === 0 ? 'None of them was recorded; click one to see its course.' :
    recorded === 1 ? 'One of them was recorded and stands first (▶): click it to see it driven.' :
    `${recorded} of them were recorded and stand first (▶): click one to see it driven.`;
  return `${count} failed episodes. ${which}`;
}

// Those that were recorded first, each part in the courses' order.
function findFailures(data, group) {
  const failures = [];
  group.courses.forEach((_, course) => {
    for (const index of group.results) {
      const result = data.results[index];
      [...result.outcomes[course]].forEach((outcome, episode) => {
        if (outcome === 'S') return;
        const track = result.tracks.find((t) => t.course === course && t.episode === episode);
        failures.push({result, course, episode, outcome, time: result.times_cs[course][episode] / 100, track});
      });
    }
  });
  return failures.sort((a, b) => Boolean(b.track) - Boolean(a.track));
}
