// ---- Numbers as eval/report/embedded_page.h packs them.

function decodeBase64(text) {
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; ++i) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

function unpack([scale, base64]) {
  const bytes = decodeBase64(base64);
  const numbers = new Float64Array(bytes.length / 2);
  for (let i = 0; i < numbers.length; ++i) {
    const low = bytes[2 * i] | (bytes[2 * i + 1] << 8);
    numbers[i] = scale * (low < 32768 ? low : low - 65536);
  }
  return numbers;
}

// ---- What is drawn, unpacked when it is first asked for.

const OUTCOMES = {S: 'success', C: 'collision', T: 'timeout'};
const GUARD_MARKS = ' Rings: the guard changed the action.';  // Of notes below pictures.

function readReport() {
  const data = readData();
  // An agent has one colour, whatever the courses.
  const labels = [...new Set(data.results.map((result) => result.label))];
  for (const result of data.results) {
    result.look = lookOf(labels.indexOf(result.label));
    result.colour = result.look.colour;
  }
  return data;
}

// Circles, boxes and path of a course as lists of objects.
function courseShapes(course) {
  if (course.shapes) return course.shapes;
  const inGroups = (numbers, size) => {
    const groups = [];
    for (let i = 0; i < numbers.length; i += size) groups.push(numbers.subarray(i, i + size));
    return groups;
  };
  course.shapes = {
    circles: inGroups(unpack(course.circles), 3).map(([x, y, radius]) => ({x, y, radius})),
    boxes: inGroups(unpack(course.boxes), 5).map(([x, y, yaw, hx, hy]) => ({x, y, yaw, hx, hy})),
    path: inGroups(unpack(course.path), 2).map(([x, y]) => ({x, y})),
    moving: course.moving.map((obstacle) => ({
      radius: obstacle.radius,
      half: obstacle.half,
      period: obstacle.period,
      points: unpack(obstacle.points),
      yaws: unpack(obstacle.yaws),
    })),
  };
  return course.shapes;
}

// Pose of a moving obstacle at motion time `time` [s]: frames lie evenly over a round, the first at
// its beginning and the last just before its end.
function motionPose(obstacle, time) {
  const last = obstacle.yaws.length - 1;
  const phase = (time % obstacle.period) / obstacle.period * last;
  const i = Math.min(Math.floor(phase), last - 1);
  const u = phase - i;
  const mix = (values, at, step) => values[at] + u * (values[at + step] - values[at]);
  return {
    x: mix(obstacle.points, 2 * i, 2),
    y: mix(obstacle.points, 2 * i + 1, 2),
    yaw: mix(obstacle.yaws, i, 1),
  };
}

function trackFrames(track) {
  if (!track.frames) {
    track.frames = {points: unpack(track.points), yaws: unpack(track.yaws),
      guarded: track.guarded ? unpack(track.guarded) : []};
    if (track.scans) track.frames.ranges = decodeBase64(track.scans.ranges);
  }
  return track.frames;
}

// Frames are `frame_time` apart, save the last, which is the end of the episode.
function frameTime(track, k) {
  return Math.min(k * track.frame_time, track.duration);
}

function frameAt(track, time) {
  const last = trackFrames(track).yaws.length - 1;
  if (time >= track.duration) return last;
  return Math.min(Math.floor(time / track.frame_time + 1e-9), last);
}

function trackPose(track, time) {
  const {points, yaws} = trackFrames(track);
  const i = frameAt(track, time);
  const j = Math.min(i + 1, yaws.length - 1);
  const span = frameTime(track, j) - frameTime(track, i);
  const u = span > 0 ? Math.min(1, (time - frameTime(track, i)) / span) : 0;
  let turn = yaws[j] - yaws[i];
  turn -= 2 * Math.PI * Math.round(turn / (2 * Math.PI));
  return {
    x: points[2 * i] + u * (points[2 * j] - points[2 * i]),
    y: points[2 * i + 1] + u * (points[2 * j + 1] - points[2 * i + 1]),
    yaw: yaws[i] + u * turn,
  };
}

// Successes, collisions and timeouts of a result on one course.
function countOutcomes(letters) {
  const count = {S: 0, C: 0, T: 0};
  for (const letter of letters) ++count[letter];
  return count;
}

function successRate(result, course) {
  const letters = result.outcomes[course];
  return letters.length > 0 ? countOutcomes(letters).S / letters.length : 0;
}
