// ---- One agent against another on the same courses.

// What is compared, in the order of the table.
const DIFFERENCES = [
  {key: 'success_rate', title: 'Success', unit: '\u00a0points', factor: 100, digits: 1},
  {key: 'traversal_time_s', title: 'Traversal', unit: '\u00a0s', factor: 1, digits: 2},
  {key: 'barn_score', title: 'BARN score', unit: '', factor: 1, digits: 4},
];

const MAX_DIFFERENCES = 16;  // Courses drawn as bars.

// The comparison of results `a` and `b` of `group` (numbers of data.results), first minus second.
function findPair(group, a, b) {
  const found = group.pairs.find((pair) => pair.first === Math.min(a, b) && pair.second === Math.max(a, b));
  if (!found || found.first === a) return found;
  const turned = {...found, first: a, second: b};
  for (const {key} of DIFFERENCES) {
    const estimate = found[key];
    if (!estimate) continue;
    const negative = (number) => (number === null ? null : -number);
    turned[key] = [-estimate[0], negative(estimate[2]), negative(estimate[1])];
  }
  return turned;
}

class Versus {
  constructor(data, onCourse) {
    this.data = data;
    this.onCourse = onCourse;
    this.selects = ['versus-a', 'versus-b'].map((id) => document.getElementById(id));
    this.selects.forEach((select, which) => select.addEventListener('change', () => {
      this.keepApart(which);
      this.draw();
    }));
  }

  show(group) {
    this.group = group;
    if (group.results.length < 2) return;
    this.selects.forEach((select, which) => {
      select.replaceChildren(...group.results.map((index) =>
        element('option', {value: index}, this.data.results[index].label)));
      select.value = group.results[which];
      select.disabled = group.results.length === 2;
    });
  }

  // Nobody drives against himself: the select that was not touched takes another agent.
  keepApart(touched) {
    const [chosen, other] = [this.selects[touched], this.selects[1 - touched]];
    if (chosen.value !== other.value) return;
    other.value = this.group.results.find((index) => index !== Number(chosen.value));
  }

  draw() {
    if (this.group.results.length < 2) return;
    const indices = this.selects.map((select) => Number(select.value));
    this.pair = findPair(this.group, ...indices);
    [this.a, this.b] = indices.map((index) => this.data.results[index]);
    this.drawTable();
    this.drawScatter();
    this.drawBars();
  }

  drawTable() {
    const rows = DIFFERENCES.filter(({key}) => this.pair[key]).map((difference) => {
      const {key, title, unit, factor, digits} = difference;
      const [value, low, high] = this.pair[key];
      const text = (number) => signed(factor * number, digits);
      const interval = low === null ? 'none: too little to go by' : `${text(low)} to ${text(high)}${unit}`;
      const differs = low !== null && (low > 0 || high < 0);
      const verdict = !differs ? 'could be chance' : this.areTwoTrainings() ?
        'these two policies differ; of ways to train, too few seeds to tell' : 'a clear difference';
      const figure = element('td', {}, title);
      if (key === 'traversal_time_s') {
        figure.append(element('span', {class: 'sub'}, `on the ${this.pair.traversal_courses} courses both passed`));
      }
      return element('tr', {'data-difference': key, 'data-value': value, 'data-low': low, 'data-high': high},
        figure, element('td', {}, element('span', {class: 'value'}, text(value) + unit)),
        element('td', {}, interval, element('span', {class: 'sub'}, verdict)));
    });
    document.getElementById('versus-table').replaceChildren(...tableParts(['Score', 'Difference', '95 % interval'], rows));
    document.getElementById('versus-note').textContent =
      `${this.a.label} minus ${this.b.label}, course by course, which leaves out how courses differ from each other.` +
      this.episodeSentence();
  }

  // Whether the two agents differ by a training: each was trained with one seed, whose luck may be the whole difference.
  areTwoTrainings() {
    return [this.a, this.b].some(({kind}) => kind === 'policy') && this.a.source !== this.b.source;
  }

  episodeSentence() {
    if (!this.pair.same_starts) return '';
    const count = {SS: 0, S: 0, other: 0, none: 0};
    this.a.outcomes.forEach((letters, course) => [...letters].forEach((letter, k) => {
      const won = [letter === 'S', this.b.outcomes[course][k] === 'S'];
      ++count[won[0] ? (won[1] ? 'SS' : 'S') : (won[1] ? 'other' : 'none')];
    }));
    const all = count.SS + count.S + count.other + count.none;
    return ` Of ${all} episodes with the same starts, both succeeded in ${count.SS}, only ${this.a.label} in ` +
      `${count.S}, only ${this.b.label} in ${count.other}, neither in ${count.none}.`;
  }

  // Success of one over success of the other; a dot's area is its number of courses.
  drawScatter() {
    const box = document.getElementById('versus-scatter');
    document.getElementById('versus-scatter-title').textContent = 'Success on each course; larger dots are more courses.';
    const width = Math.min(widthOf(box), 460);
    const [left, right, top, bottom] = [68, 20, 14, 44];
    const side = width - left - right;
    const drawing = plotIn(box, top + side + bottom, width);
    drawing.style.maxWidth = `${width}px`;
    const x = linear(0, 1, left, left + side);
    const y = linear(0, 1, top + side, top);
    for (const tick of [0, 0.25, 0.5, 0.75, 1]) {
      drawing.append(svg('line', {x1: x(tick), x2: x(tick), y1: y(0), y2: y(1), class: 'grid'}),
        svg('line', {x1: x(0), x2: x(1), y1: y(tick), y2: y(tick), class: 'grid'}),
        svgText(x(tick), y(0) + 18, percent(tick), {'text-anchor': 'middle', class: 'faint'}),
        svgText(left - 8, y(tick) + 4, percent(tick), {'text-anchor': 'end', class: 'faint'}));
    }
    drawing.append(svg('line', {x1: x(0), x2: x(1), y1: y(0), y2: y(1), class: 'axis'}),
      svgText(x(0.5), y(0) + 36, shorten(this.a.label, side / 8), {'text-anchor': 'middle', style: `fill:${this.a.colour}`}),
      svgText(12, y(0.5), shorten(this.b.label, side / 8),
        {'text-anchor': 'middle', transform: `rotate(-90 12 ${y(0.5)})`, style: `fill:${this.b.colour}`}));
    const dots = new Map();  // By place: the courses there.
    this.group.courses.forEach((_, course) => {
      const key = `${successRate(this.a, course)} ${successRate(this.b, course)}`;
      dots.set(key, [...(dots.get(key) || []), course]);
    });
    const most = Math.max(...[...dots.values()].map((courses) => courses.length));
    for (const courses of dots.values()) {
      const [ra, rb] = [successRate(this.a, courses[0]), successRate(this.b, courses[0])];
      const colour = ra > rb ? this.a.colour : rb > ra ? this.b.colour : 'var(--muted)';
      const dot = svg('circle', {class: 'pair-dot clickable', cx: x(ra), cy: y(rb),
        r: Math.max(4, 18 * Math.sqrt(courses.length / Math.max(most, 4))), fill: colour, opacity: 0.72, 'data-courses': courses.length});
      const names = courses.slice(0, 8).map((course) => this.group.courses[course].name).join(', ');
      setTip(dot, `${plural(courses.length, 'course')}: ${this.a.label} ${percent(ra)}, ` +
        `${this.b.label} ${percent(rb)}\n${names}${courses.length > 8 ? ', …' : ''}`);
      dot.addEventListener('click', () => this.onCourse(courses[0], ra > rb ? this.b : this.a));
      drawing.append(dot);
    }
  }

  // The courses on which they differ most, as bars to the side of the better one.
  drawBars() {
    const differences = this.group.courses.map((_, course) =>
      ({course, difference: successRate(this.b, course) - successRate(this.a, course)}))
      .filter(({difference}) => Math.abs(difference) > 1e-9)
      .sort((p, q) => Math.abs(q.difference) - Math.abs(p.difference) || p.course - q.course);
    const shown = differences.slice(0, MAX_DIFFERENCES).sort((p, q) => p.difference - q.difference || p.course - q.course);
    document.getElementById('versus-differences').hidden = shown.length === 0;
    if (shown.length === 0) return;
    document.getElementById('versus-bars-title').textContent =
      (shown.length < differences.length ? `The ${shown.length} of ${differences.length}` : `The ${shown.length}`) +
      ` courses where they differ${shown.length < differences.length ? ' most' : ''}: to the left ${this.a.label} is better, to the right ${this.b.label}.`;
    const box = document.getElementById('versus-bars');
    const width = widthOf(box);
    const rowHeight = 24;
    const left = Math.min(150, width / 3);
    const drawing = plotIn(box, shown.length * rowHeight + 24, width);
    const x = linear(-1, 1, left, width - 12);
    for (const tick of [-1, -0.5, 0, 0.5, 1]) {
      drawing.append(svg('line', {x1: x(tick), x2: x(tick), y1: 2, y2: shown.length * rowHeight, class: tick === 0 ? 'axis' : 'grid'}),
        svgText(x(tick), shown.length * rowHeight + 16, percent(Math.abs(tick)), {'text-anchor': 'middle', class: 'faint'}));
    }
    shown.forEach(({course, difference}, row) => {
      const name = this.group.courses[course].name;
      drawing.append(svgText(left - 8, row * rowHeight + 16, shorten(name, left / 7), {'text-anchor': 'end'}));
      const bar = svg('rect', {class: 'pair-bar clickable', x: Math.min(x(0), x(difference)), y: row * rowHeight + 4,
        width: Math.abs(x(difference) - x(0)), height: rowHeight - 8, rx: 2,
        fill: difference > 0 ? this.b.colour : this.a.colour});
      setTip(bar, `${courseTip(this.a, this.group, course)}\n${courseTip(this.b, this.group, course)}`);
      bar.addEventListener('click', () => this.onCourse(course, difference > 0 ? this.a : this.b));
      drawing.append(bar);
    });
  }
}
