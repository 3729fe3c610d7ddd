// ---- A course from above, on a canvas.

// A view of the world W. Courses much taller than wide are turned, so that up in W is right here.
class CourseView {
  constructor(canvas, course, tracks) {
    this.canvas = canvas;
    this.course = course;
    this.fit(tracks);
  }

  fit(tracks) {
    let [x0, y0, x1, y1] = this.course.bounds;
    const include = (x, y) => {
      [x0, y0, x1, y1] = [Math.min(x0, x), Math.min(y0, y), Math.max(x1, x), Math.max(y1, y)];
    };
    include(this.course.start[0], this.course.start[1]);
    include(this.course.goal[0], this.course.goal[1]);
    for (const track of tracks) {
      const {points} = trackFrames(track);
      for (let i = 0; i < points.length; i += 2) include(points[i], points[i + 1]);
    }
    const margin = 0.6;
    this.centre = [(x0 + x1) / 2, (y0 + y1) / 2];
    const [spanX, spanY] = [x1 - x0 + 2 * margin, y1 - y0 + 2 * margin];
    this.turned = spanY > 1.2 * spanX;
    const [across, down] = this.turned ? [spanY, spanX] : [spanX, spanY];
    const width = widthOf(this.canvas);
    const height = Math.round(Math.min(620, Math.max(240, width * down / across)));
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    this.canvas.width = width * ratio;
    this.canvas.height = height * ratio;
    this.size = [width, height];
    this.scale = Math.min(width / across, height / down);
    this.context = this.canvas.getContext('2d');
    this.ratio = ratio;
  }

  // Everything after this is in metres of W, until `end`.
  begin() {
    const {context, scale} = this;
    const [cx, cy] = this.centre;
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    context.clearRect(0, 0, ...this.size);
    context.translate(this.size[0] / 2, this.size[1] / 2);
    context.scale(scale, -scale);
    if (this.turned) context.rotate(-Math.PI / 2);
    context.translate(-cx, -cy);
    context.lineJoin = 'round';
    context.lineCap = 'round';
  }

  pixels(count) {
    return count / this.scale;
  }

  circle(x, y, radius) {
    this.context.moveTo(x + radius, y);
    this.context.arc(x, y, radius, 0, 2 * Math.PI);
  }

  box(x, y, yaw, hx, hy) {
    const [c, s] = [Math.cos(yaw), Math.sin(yaw)];
    [[hx, hy], [-hx, hy], [-hx, -hy], [hx, -hy]].forEach(([u, v], k) => {
      this.context[k === 0 ? 'moveTo' : 'lineTo'](x + c * u - s * v, y + s * u + c * v);
    });
    this.context.closePath();
  }

  drawCourse(goalTolerance) {
    const {context, course} = this;
    const shapes = courseShapes(course);
    const [x0, y0, x1, y1] = course.bounds;
    context.fillStyle = themeColour('--floor');
    context.fillRect(x0, y0, x1 - x0, y1 - y0);
    context.fillStyle = themeColour('--obstacle');
    context.beginPath();
    for (const c of shapes.circles) this.circle(c.x, c.y, c.radius);
    for (const b of shapes.boxes) this.box(b.x, b.y, b.yaw, b.hx, b.hy);
    context.fill();
    context.fillStyle = themeColour('--goal-area');
    context.strokeStyle = themeColour('--goal');
    context.lineWidth = this.pixels(1.5);
    context.beginPath();
    this.circle(course.goal[0], course.goal[1], goalTolerance);
    context.fill();
    context.stroke();
    this.drawScaleBar();
  }

  drawReferencePath() {
    const {context, course} = this;
    const points = [{x: course.start[0], y: course.start[1]}, ...courseShapes(course).path,
      {x: course.goal[0], y: course.goal[1]}];
    context.strokeStyle = themeColour('--path');
    context.lineWidth = this.pixels(1.2);
    context.setLineDash([this.pixels(2), this.pixels(5)]);
    context.beginPath();
    points.forEach((p, k) => context[k === 0 ? 'moveTo' : 'lineTo'](p.x, p.y));
    context.stroke();
    context.setLineDash([]);
  }

  // Moving obstacles at a motion time, each with the way it goes.
  drawMoving(time) {
    const {context} = this;
    for (const obstacle of courseShapes(this.course).moving) {
      context.strokeStyle = themeColour('--moving-way');
      context.lineWidth = this.pixels(1);
      context.beginPath();
      for (let i = 0; i < obstacle.points.length; i += 2) {
        context[i === 0 ? 'moveTo' : 'lineTo'](obstacle.points[i], obstacle.points[i + 1]);
      }
      context.stroke();
      const pose = motionPose(obstacle, time);
      context.fillStyle = themeColour('--moving');
      context.beginPath();
      if (obstacle.radius > 0) this.circle(pose.x, pose.y, obstacle.radius);
      else this.box(pose.x, pose.y, pose.yaw, obstacle.half[0], obstacle.half[1]);
      context.fill();
    }
  }

  drawTrack(track, colour, untilTime = Infinity) {
    const {context} = this;
    const {points} = trackFrames(track);
    const last = Number.isFinite(untilTime) ? frameAt(track, untilTime) : points.length / 2 - 1;
    context.strokeStyle = themeColour(colour);
    context.lineWidth = this.pixels(2);
    context.beginPath();
    for (let i = 0; i <= last; ++i) {
      context[i === 0 ? 'moveTo' : 'lineTo'](points[2 * i], points[2 * i + 1]);
    }
    if (Number.isFinite(untilTime)) {
      const pose = trackPose(track, untilTime);
      context.lineTo(pose.x, pose.y);
    }
    context.stroke();
    this.drawGuardMarks(track, colour, last);
  }

  // Rings where a guard changed the action, up to frame `last`, without those that would hide each other.
  drawGuardMarks(track, colour, last) {
    const {context} = this;
    const {points, guarded} = trackFrames(track);
    const r = this.pixels(3);
    let [x, y] = [Infinity, Infinity];
    context.fillStyle = themeColour('--floor');
    context.strokeStyle = themeColour(colour);
    context.lineWidth = this.pixels(1.2);
    context.beginPath();
    for (const k of guarded) {
      if (k > last || Math.hypot(points[2 * k] - x, points[2 * k + 1] - y) < 2 * r) continue;
      [x, y] = [points[2 * k], points[2 * k + 1]];
      this.circle(x, y, r);
    }
    context.fill();
    context.stroke();
  }

  // Where an episode ended: a dot for success, a cross for a collision, a square for a timeout.
  drawEnd(track, colour) {
    const {context} = this;
    const {points} = trackFrames(track);
    const [x, y] = [points[points.length - 2], points[points.length - 1]];
    const r = this.pixels(6);
    context.lineWidth = this.pixels(3);
    context.strokeStyle = themeColour(colour);
    context.fillStyle = themeColour(colour);
    context.beginPath();
    if (track.outcome === 'S') {
      this.circle(x, y, r * 0.8);
      context.fill();
    } else if (track.outcome === 'C') {
      context.moveTo(x - r, y - r);
      context.lineTo(x + r, y + r);
      context.moveTo(x - r, y + r);
      context.lineTo(x + r, y - r);
      context.stroke();
    } else {
      context.fillRect(x - r * 0.8, y - r * 0.8, 1.6 * r, 1.6 * r);
    }
  }

  drawRobot(pose, [length, width], colour) {
    const {context} = this;
    context.fillStyle = themeColour(colour);
    context.strokeStyle = themeColour('--ink');
    context.lineWidth = this.pixels(1.2);
    context.beginPath();
    this.box(pose.x, pose.y, pose.yaw, length / 2, width / 2);
    context.fill();
    context.stroke();
    const [c, s] = [Math.cos(pose.yaw), Math.sin(pose.yaw)];
    const at = (u, v) => [pose.x + c * u - s * v, pose.y + s * u + c * v];
    context.fillStyle = themeColour('--floor');
    context.beginPath();
    context.moveTo(...at(length * 0.38, 0));
    context.lineTo(...at(-length * 0.05, width * 0.28));
    context.lineTo(...at(-length * 0.05, -width * 0.28));
    context.fill();
  }

  // The scan of frame `k`: the area that its beams cross, and where they end at something.
  drawScan(track, k) {
    const {context} = this;
    const {points, yaws, ranges} = trackFrames(track);
    const {sensor, angle_min: angleMin, angle_step: angleStep, beams, longest} = track.scans;
    const [x, y, yaw] = [points[2 * k], points[2 * k + 1], yaws[k]];
    const [c, s] = [Math.cos(yaw), Math.sin(yaw)];
    const [sx, sy] = [x + c * sensor[0] - s * sensor[1], y + s * sensor[0] + c * sensor[1]];
    const ends = [];
    for (let b = 0; b < beams; ++b) {
      const range = ranges[k * beams + b] * longest / 255;
      const angle = yaw + angleMin + b * angleStep;
      ends.push({x: sx + range * Math.cos(angle), y: sy + range * Math.sin(angle), hit: ranges[k * beams + b] < 254});
    }
    context.fillStyle = themeColour('--scan');
    context.beginPath();
    context.moveTo(sx, sy);
    for (const end of ends) context.lineTo(end.x, end.y);
    context.fill();
    context.fillStyle = themeColour('--hit');
    context.beginPath();
    for (const end of ends) if (end.hit) this.circle(end.x, end.y, this.pixels(2.6));
    context.fill();
    return ends.length;
  }

  drawScaleBar() {
    const {context} = this;
    context.save();
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    const [width, height] = this.size;
    context.strokeStyle = themeColour('--muted');
    context.fillStyle = themeColour('--muted');
    context.lineWidth = 2;
    context.beginPath();
    context.moveTo(width - 14 - this.scale, height - 12);
    context.lineTo(width - 14, height - 12);
    context.stroke();
    context.font = '12px system-ui, sans-serif';
    context.textAlign = 'right';
    context.fillText('1 m', width - 14, height - 18);
    context.restore();
  }
}
