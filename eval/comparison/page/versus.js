// ---- One agent against another on the same courses.

const MAX_DIFFERENCES = 16;  // Courses drawn as bars.

// The comparison of agents `a` and `b` (places in the group), first minus second; none: they were not compared.
function findPair(group, a, b) {
  const found = group.pairs.find((pair) => pair.first === Math.min(a, b) && pair.second === Math.max(a, b));
  if (!found || found.first === a) return found;
  const negative = (number) => (number === null ? null : -number);
  const turn = ([value, low, high]) => [-value, negative(high), negative(low)];
  return {...found, first: a, second: b, differences: Object.fromEntries(
    Object.entries(found.differences).map(([key, estimate]) => [key, turn(estimate)]))};
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
    if (group.agents.length < 2) return;
    this.selects.forEach((select, which) => {
      select.replaceChildren(...group.agents.map((agent, place) => element('option', {value: place}, agent.label)));
      select.value = which;
      select.disabled = group.agents.length === 2;
    });
    document.getElementById('pairs').replaceChildren(...(group.pairs.length === 0 ? [] :
      [pairTable(group, group.agents.map((agent) => agent.label)), element('p', {class: 'note'}, PAIR_NOTE)]));
  }

  // Nobody drives against himself: the select that was not touched takes another agent.
  keepApart(touched) {
    const [chosen, other] = [this.selects[touched], this.selects[1 - touched]];
    if (chosen.value !== other.value) return;
    other.value = chosen.value === '0' ? 1 : 0;
  }

  draw() {
    if (this.group.agents.length < 2) return;
    const places = this.selects.map((select) => Number(select.value));
    this.pair = findPair(this.group, ...places);
    [this.a, this.b] = places.map((place) => this.data.results[this.group.results[place]]);
    this.drawTable();
    this.drawScatter();
    this.drawBars();
  }

  drawTable() {
    const columns = this.pair ? quantityColumns(this.data.quantities, this.group).filter(({key}) => this.pair.differences[key]) : [];
    const rows = columns.map(({key, title, difference_unit: unit, factor, digits}) => {
      const [value, low, high] = this.pair.differences[key];
      const text = (number) => signed(factor * number, digits);
      const interval = low === null ? 'none: too little to go by' : `${text(low)} to ${text(high)} ${unit}`;
      const verdict = key === 'success_rate' ? [element('span', {class: 'sub'}, this.pair.verdict)] : [];
      return element('tr', {'data-difference': key, 'data-value': value, 'data-low': low, 'data-high': high},
        element('td', {}, title), element('td', {}, element('span', {class: 'value'}, `${text(value)} ${unit}`)),
        element('td', {}, interval, ...verdict));
    });
    document.getElementById('versus-table').replaceChildren(...tableParts(['Figure', 'Difference', '95 % interval'], rows));
    document.getElementById('versus-note').textContent = this.pair ?
      `${this.a.label} minus ${this.b.label} on the same courses, which leaves out how courses differ from each other.${this.episodeSentence()}` :
      'These two were not compared.';
  }

  episodeSentence() {
    if (!this.pair.same_starts || [this.pair.first, this.pair.second].some((place) => this.group.agents[place].seeds > 1)) return '';
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
