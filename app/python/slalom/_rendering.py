"""Pictures of what a robot sees."""

import numpy as np

from . import _tomllib

_PIXELS = 400
_REACH = 5.5  # Metres from the robot to the border of the picture.
_UNSEEN, _FREE, _HIT, _ROBOT, _GOAL = np.array(
    [[216, 220, 226], [255, 255, 255], [30, 34, 42], [43, 108, 176], [47, 133, 90]], np.uint8)
_DOT = 0.05  # Half width of a reading, in metres.


class Painter:
    """Paints frames of one task. What does not change with the frame is worked out once."""

    def __init__(self, config, clip_cm):
        """config: the task as TOML."""
        task = _tomllib.loads(config)["environment"]
        lidar, robot = task["lidar"], task["robot"]
        self._clip = clip_cm / 100
        centres = (np.arange(_PIXELS) + 0.5) * 2 * _REACH / _PIXELS - _REACH
        self._x, self._y = np.meshgrid(-centres, -centres, indexing="ij")  # Ahead is up, left is left.
        x, y = self._x - lidar["offset_x"], self._y - lidar["offset_y"]
        self._distance = np.hypot(x, y)
        fan, beams = lidar["field_of_view"], lidar["num_beams"]
        beam = np.rint((np.arctan2(y, x) / fan + 0.5) * (beams - 1)).astype(int)
        self._sees = (beam >= 0) & (beam < beams)
        self._beam = beam.clip(0, beams - 1)
        self._robot = (abs(self._x) <= robot["length"] / 2) & (abs(self._y) <= robot["width"] / 2)

    def paint(self, ranges_cm, state):
        """Returns [400, 400, 3] uint8 of a scan and a state, whose first two numbers are the goal."""
        ranges = (ranges_cm / 100)[self._beam]
        picture = np.full((_PIXELS, _PIXELS, 3), _UNSEEN)
        picture[self._sees & (self._distance < ranges)] = _FREE
        picture[self._sees & (abs(self._distance - ranges) <= _DOT) & (ranges < self._clip)] = _HIT
        picture[self._robot] = _ROBOT
        goal = np.array(state[:2], float)
        goal *= min(1.0, (_REACH - 0.2) / max(abs(goal).max(), 1e-9))
        picture[np.hypot(self._x - goal[0], self._y - goal[1]) <= 0.15] = _GOAL
        return picture
