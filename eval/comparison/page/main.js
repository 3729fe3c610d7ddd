// ---- The page: what is chosen, and who draws it.

class Page {
  constructor(data) {
    this.data = data;
    this.player = new Player(data);
    this.hidden = new Set();  // Results whose trajectories are not shown.
    this.group = data.groups[0];
    this.course = 0;
    const toCourse = (course, result) => {
      this.showCourse(course, result);
      document.getElementById('trajectories').scrollIntoView();
    };
    this.toCourse = toCourse;
    this.failures = new FailureList(data, (failure) => this.playFailure(failure));
    this.versus = new Versus(data, toCourse);
    this.listen();
    this.fillGroups();
    drawWarnings(data);
    document.getElementById('protocol').textContent =
      `${data.protocol} ${plural(data.num_evaluations, 'evaluation')}.`;
    this.showGroup(0);
    this.drawProvenance();
  }

  listen() {
    const on = (id, type, action) => document.getElementById(id).addEventListener(type, action);
    on('group', 'change', (event) => this.showGroup(Number(event.target.value)));
    on('course-order', 'change', () => this.drawPlots());
    on('measure', 'change', () => drawDifficulty(this.data, this.group));
    on('course', 'change', (event) => this.showCourse(Number(event.target.value)));
    on('previous-course', 'click', () => this.stepCourse(-1));
    on('next-course', 'click', () => this.stepCourse(1));
    on('track', 'change', (event) => this.showTrack(Number(event.target.value)));
    redrawOnChange(() => this.redraw());
  }

  redraw() {
    this.drawPlots();
    this.drawTrajectories();
    this.player.layOut();
  }

  fillGroups() {
    const select = document.getElementById('group');
    select.replaceChildren(...this.data.groups.map((group, index) =>
      element('option', {value: index}, group.title)));
    document.getElementById('group-choice').hidden = this.data.groups.length < 2;
  }

  results() {
    return this.group.results.map((index) => this.data.results[index]);
  }

  showGroup(index) {
    this.group = this.data.groups[index];
    const measure = document.getElementById('measure');
    measure.replaceChildren(...this.group.measures.map((m) =>
      element('option', {value: m.key}, m.unit ? `${m.name} [${m.unit}]` : m.name)));
    document.getElementById('course').replaceChildren(...this.group.courses.map((course, c) =>
      element('option', {value: c}, course.name)));
    document.getElementById('settings').replaceChildren(...settingTables(this.group.settings));
    drawDrawnFields(this.data, this.group);
    this.fillAgents();
    this.failures.show(this.group);
    this.versus.show(this.group);
    this.hideEmpty();
    this.drawPlots();
    this.showCourse(this.firstCourse());
  }

  // Sections, plots and controls with nothing in them are left out, and so are the links to them.
  // Before anything is drawn, as what is left takes the room.
  hideEmpty() {
    const hide = (id, isEmpty) => {
      document.getElementById(id).hidden = isEmpty;
    };
    const none = (letters) => this.results().every((result) =>
      result.outcomes.every((course) => ![...course].some((letter) => letters.includes(letter))));
    hide('settings', this.group.settings.length === 0);
    hide('versus', this.group.results.length < 2);
    hide('failures', none('CT'));
    hide('difficulty', this.group.measures.length === 0);
    hide('drawn', this.group.drawn.length === 0);
    hide('traversal', none('S'));
    hide('survival', none('CT'));
    hide('agent-choice', this.group.results.length < 2);
    for (const id of ['order-choice', 'previous-course', 'next-course']) hide(id, this.group.courses.length < 2);
    const hasTracks = this.results().some((result) => result.tracks.length > 0);
    document.getElementById('trajectories-title').textContent = hasTracks ? 'Trajectories' : 'Course';
    this.hideLinks();
  }

  hideLinks() {
    for (const link of document.querySelectorAll('nav a')) {
      link.hidden = document.querySelector(link.getAttribute('href')).hidden;
    }
    document.querySelector('nav a[href="#trajectories"]').textContent =
      document.getElementById('trajectories-title').textContent;
  }

  // A failure of the list: its episode is played, or, where it was not recorded, its course shown.
  playFailure({result, course, track}) {
    this.toCourse(course, result);
    const index = this.tracksHere().findIndex((here) => here.track === track);
    if (index < 0) return;
    this.showTrack(index);
    document.getElementById('episode').scrollIntoView();
    this.player.play();
  }

  // The hardest of the courses on which a scan was kept, else the hardest.
  firstCourse() {
    const order = orderCourses(this.data, this.group, 'hardest');
    const hasScan = (course) => this.results().some((result) =>
      result.tracks.some((track) => track.course === course && track.scans));
    const found = order.find(hasScan);
    return found === undefined ? order[0] : found;
  }

  fillAgents() {
    const box = document.getElementById('agent-choice');
    box.replaceChildren(...this.results().map((result) => {
      const button = element('button', {'aria-pressed': !this.hidden.has(result)}, swatch(result.colour), result.label);
      button.addEventListener('click', () => {
        if (!this.hidden.delete(result)) this.hidden.add(result);
        button.setAttribute('aria-pressed', !this.hidden.has(result));
        this.drawTrajectories();
      });
      return button;
    }));
  }

  drawPlots() {
    drawFigures(this.data, this.group);
    drawProfileSection(this.data, this.group);
    this.versus.draw();
    drawCourseMap(this.data, this.group, this.toCourse);
    drawDifficulty(this.data, this.group);
    drawTimes(this.data, this.group, 'traversal-plot', 'S');
    drawTimes(this.data, this.group, 'survival-plot', 'CT');
  }

  stepCourse(step) {
    const n = this.group.courses.length;
    this.showCourse((this.course + step + n) % n);
  }

  // Episodes on the chosen course: those with scans first, then by agent.
  tracksHere() {
    const here = this.results().flatMap((result) => result.tracks
      .filter((track) => track.course === this.course).map((track) => ({result, track})));
    return here.sort((a, b) => Boolean(b.track.scans) - Boolean(a.track.scans));
  }

  showCourse(course, preferred = null) {
    this.course = course;
    document.getElementById('course').value = course;
    this.drawTrajectories();
    const here = this.tracksHere();
    document.getElementById('track').replaceChildren(...here.map(({result, track}, index) =>
      element('option', {value: index}, `${result.label}, episode ${track.episode}: ${OUTCOMES[track.outcome]}`)));
    this.showTrack(Math.max(0, here.findIndex(({result}) => result === preferred)));
  }

  showTrack(index) {
    const chosen = this.tracksHere()[index];
    const select = document.getElementById('track');
    if (chosen) select.value = index;
    document.getElementById('episode').hidden = !chosen;
    this.hideLinks();
    const course = this.group.courses[this.course];
    document.getElementById('scan-choice').hidden = !chosen || !chosen.track.scans;
    this.player.load(course, chosen ? chosen.result : null, chosen ? chosen.track : null);
    const note = document.getElementById('episode-note');
    if (!chosen) return;
    if (chosen.track.scans) {
      note.textContent = `${course.name}: orange is what the range finder saw, ${chosen.track.scans.beams} of its beams.`;
    } else {
      note.textContent = `${course.name}: the scans of this episode were not kept.`;
    }
    if (course.moving.length > 0) note.textContent += ` ${course.moving.length} obstacles move (violet).`;
    if (chosen.track.guarded) note.textContent += GUARD_MARKS;
  }

  drawTrajectories() {
    const canvas = document.getElementById('trajectory-canvas');
    const course = this.group.courses[this.course];
    const shown = this.tracksHere().filter(({result}) => !this.hidden.has(result));
    const view = new CourseView(canvas, course, shown.map(({track}) => track));
    view.begin();
    view.drawCourse(this.data.goal_tolerance);
    view.drawMoving(0);
    view.drawReferencePath();
    for (const {result, track} of shown) view.drawTrack(track, result.colour);
    for (const {result, track} of shown) view.drawEnd(track, result.colour);
    view.drawRobot({x: course.start[0], y: course.start[1], yaw: course.start[2]}, this.results()[0].robot, '--start');
    canvas.dataset.obstacles = courseShapes(course).circles.length + courseShapes(course).boxes.length;
    canvas.dataset.tracks = shown.length;
    document.getElementById('trajectory-note').textContent =
      `${course.name}, reference path ${course.length.toFixed(2)} m (dotted).` +
      (shown.length > 0 ? ' Ends: ● success, ✕ collision, ■ timeout.' : ' No episode shown.') +
      (course.moving.length > 0 ? ' Moving obstacles stand where their motion begins.' : '') +
      (shown.some(({track}) => track.guarded) ? GUARD_MARKS : '');
  }

  drawProvenance() {
    document.getElementById('provenance').replaceChildren(...this.data.results.map((result) =>
      element('div', {}, `${result.label}: ${result.source}, made by commit `, element('code', {}, result.commit || 'unknown'))));
  }
}

// ---- What a reader must know before any figure.

// "40 of these 50 courses"
function overlapText({training_overlap: overlap}) {
  return overlap.courses === overlap.of ? `all of these ${overlap.of} courses` :
    `${overlap.courses} of these ${overlap.of} courses`;
}

function drawWarnings(data) {
  const warned = data.groups.flatMap((group) => group.results.map((index) => ({group, result: data.results[index]})))
    .filter(({result}) => result.training_overlap);
  document.getElementById('warnings').replaceChildren(...warned.map(({group, result}) =>
    element('div', {class: 'warning', role: 'note', 'data-overlap': result.training_overlap.courses},
      element('strong', {}, 'Trained on its test. '),
      `${result.label} was trained on ${overlapText(result)} of ${group.title} (its training set is ` +
      `${result.training_overlap.trained_on}). What it scores on them says what it remembers, not how it drives where it has never been.`)));
}

// Opened as report.html#play, the episode plays at once.
const page = new Page(readReport());
for (const section of document.querySelectorAll('section')) section.dataset.drawn = 'true';
document.body.dataset.ready = 'true';
if (location.hash === '#play') page.player.play();
