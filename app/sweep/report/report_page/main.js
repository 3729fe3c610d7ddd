// ---- The page: sections in turn.

const MAX_MISSING = 100;  // Lines of the list; report.csv has all.

class Page {
  constructor(data) {
    this.data = data;
    this.drawings = [];
    document.title = `${data.title} · Slalom sweep`;
    document.getElementById('title').textContent = data.title;
    document.getElementById('warnings').append(...data.warnings.map((text) => element('p', {class: 'warning'}, text)));
    document.getElementById('provenance').append(...data.provenance.map(([name, value]) =>
      element('tr', {}, element('td', {}, name), element('td', {}, value))));
    addAxisSections(this);
    for (const score of data.scores) addScoreSection(this, score);
    this.addFailures();
    this.addMissing();
    this.draw();
    redrawOnChange(() => this.draw());
  }

  addSection(id, title, link) {
    const section = element('section', {id, class: 'long'}, element('h2', {}, title));
    document.getElementById('main').append(section);
    document.getElementById('links').append(element('a', {href: `#${id}`}, shorten(link, 28)));
    return section;
  }

  // What the names of rows say, for the head of their column.
  rowHead() {
    return this.data.axes.length > 0 ? this.data.axes.join(' / ') : 'Row';
  }

  // The row's name where nothing else says what its numbers are.
  rowTitle(row) {
    return this.data.rows[row].title;
  }

  // Calls `action` whenever the page is drawn.
  onDraw(action) {
    this.drawings.push(action);
  }

  draw() {
    for (const action of this.drawings) action();
  }

  addFailures() {
    if (this.data.failures.length === 0) return;
    const section = this.addSection('failures', 'Failed cells', 'Failures');
    for (const {cell, id, what, log} of this.data.failures) {
      section.append(element('h3', {}, cell), element('p', {class: 'note'}, `cells/${id}: ${what}`));
      if (log) section.append(element('pre', {class: 'log'}, log));
    }
  }

  addMissing() {
    const {missing} = this.data;
    if (missing.length === 0) return;
    const section = this.addSection('missing', 'Missing evaluations', 'Missing');
    section.append(element('ul', {class: 'missing'}, ...missing.slice(0, MAX_MISSING).map((text) => element('li', {}, text))));
    if (missing.length > MAX_MISSING) {
      section.append(element('p', {class: 'note'}, `And ${missing.length - MAX_MISSING} more, which report.csv lists.`));
    }
  }
}

new Page(readData());
document.body.dataset.ready = 'true';
