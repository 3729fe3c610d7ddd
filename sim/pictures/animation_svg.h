#pragma once

#include <string>

#include "sim/pictures/animation.h"

namespace slalom::sim {

/// The animation as one SVG file that plays by itself wherever a browser shows it, in an `<img>`
/// too: declarative animation (SMIL), no script, nothing loaded, for ever from the beginning. It
/// has a ground of its own and follows the reader's choice of a dark or a light page. A viewer that
/// knows no animation shows the end.
///
/// Poses are kept to 0.4 pixels, so a drive of 10 s takes about 1 kB, a course of 250 obstacles 4
/// kB; with scans 20 kB more for a drive.
std::string PrintAnimationSvg(const Animation& animation);

}  // namespace slalom::sim
