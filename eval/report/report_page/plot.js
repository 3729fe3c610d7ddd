// ---- Parts of plots.

function svgText(x, y, text, attributes = {}) {
  return svg('text', {x, y, 'font-size': 12, ...attributes}, String(text));
}

// A drawing as wide as `box`, so that its unit is a pixel; it is drawn anew when the width changes.
function plotIn(box, height, width) {
  const drawing = svg('svg', {viewBox: `0 0 ${width} ${height}`, role: 'img'});
  box.replaceChildren(drawing);
  return drawing;
}

function widthOf(box) {
  return Math.max(300, Math.round(box.getBoundingClientRect().width) || 900);
}

function linear(fromLow, fromHigh, toLow, toHigh) {
  const span = fromHigh - fromLow || 1;
  return (value) => toLow + (value - fromLow) / span * (toHigh - toLow);
}

// Round numbers from 0 to at least `highest`.
function niceTicks(highest, about = 5) {
  const raw = Math.max(highest, 1e-9) / about;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw);
  const ticks = [];
  for (let k = 0; k * step < highest + step; ++k) ticks.push(k * step);
  return ticks;
}

function percent(rate, digits = 0) {
  return `${(100 * rate).toFixed(digits)} %`;
}

// ---- The tip beside the pointer.

function setTip(node, text) {
  const tip = document.getElementById('tip');
  node.addEventListener('pointermove', (event) => {
    tip.hidden = false;
    tip.textContent = text;
    const right = event.clientX + 14 + tip.offsetWidth < window.innerWidth;
    tip.style.left = `${right ? event.clientX + 14 : event.clientX - 14 - tip.offsetWidth}px`;
    tip.style.top = `${Math.max(4, event.clientY - tip.offsetHeight - 8)}px`;
  });
  node.addEventListener('pointerleave', () => {
    tip.hidden = true;
  });
}

function swatch(colour) {
  const node = element('span', {class: 'swatch'});
  node.style.background = colour;
  return node;
}

function fillAgentLegend(box, results) {
  box.replaceChildren(...results.map((result) => element('span', {}, swatch(result.colour), result.label)));
}

function shorten(text, length) {
  return text.length <= length ? text : `${text.slice(0, length - 1)}…`;
}
