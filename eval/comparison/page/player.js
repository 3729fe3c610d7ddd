// ---- One episode, played back.

class Player {
  constructor(data) {
    this.data = data;
    this.canvas = document.getElementById('episode-canvas');
    this.playButton = document.getElementById('play');
    this.scrub = document.getElementById('scrub');
    this.clock = document.getElementById('clock');
    this.speed = document.getElementById('speed');
    this.showScan = document.getElementById('show-scan');
    this.time = 0;
    this.playing = false;
    this.playButton.addEventListener('click', () => this.toggle());
    this.scrub.addEventListener('input', () => {
      if (!this.track) return;
      this.time = this.scrub.value / 1000 * this.track.duration;
      this.draw();
    });
    this.showScan.addEventListener('change', () => this.draw());
  }

  // `result` may be null: there is no episode to play.
  load(course, result, track) {
    this.pause();
    [this.course, this.result, this.track, this.time] = [course, result, track, 0];
    this.layOut();
  }

  layOut() {
    this.view = new CourseView(this.canvas, this.course, this.track ? [this.track] : []);
    this.draw();
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  play() {
    if (!this.track) return;
    if (this.time >= this.track.duration) this.time = 0;
    this.playing = true;
    this.playButton.textContent = 'Pause';
    this.lastShown = performance.now();
    this.wait();
  }

  // A timer, not requestAnimationFrame: headless browsers, whose clock is simulated, hold to it.
  wait() {
    setTimeout(() => this.advance(performance.now()), 16);
  }

  pause() {
    this.playing = false;
    this.playButton.textContent = 'Play';
  }

  advance(now) {
    if (!this.playing) return;
    this.time += (now - this.lastShown) / 1000 * Number(this.speed.value);
    this.lastShown = now;
    if (this.time >= this.track.duration) {
      this.time = this.track.duration;
      this.pause();
    }
    this.draw();
    if (this.playing) this.wait();
  }

  draw() {
    const {view, track, result} = this;
    view.begin();
    view.drawCourse(this.data.goal_tolerance);
    if (!track) {
      this.clock.textContent = '';
      return;
    }
    const frame = frameAt(track, this.time);
    // A scan is of its frame: robot and obstacles stand there, too, while it is shown.
    const withScan = Boolean(track.scans) && this.showScan.checked;
    const time = withScan ? frameTime(track, frame) : this.time;
    view.drawMoving(track.motion_start + time);
    view.drawTrack(track, result.colour, time);
    const beams = withScan ? view.drawScan(track, frame) : 0;
    view.drawRobot(trackPose(track, time), result.robot, result.colour);
    if (time >= track.duration) view.drawEnd(track, '--ink');
    this.scrub.value = Math.round(1000 * this.time / Math.max(track.duration, 1e-9));
    this.clock.textContent = `${this.time.toFixed(1)} of ${track.duration.toFixed(1)} s`;
    this.canvas.dataset.time = this.time;
    this.canvas.dataset.episode = `${result.label}/${this.course.name}/${track.episode}`;
    this.canvas.dataset.beams = beams;
    this.canvas.dataset.moving = courseShapes(this.course).moving.length;
  }
}
