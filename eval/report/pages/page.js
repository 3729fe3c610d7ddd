'use strict';

// ---- What all pages share: errors, elements, numbers as text, the tip beside the pointer, light and dark.

// Whatever goes wrong stands on the page, for people and for the test.
function showError(text) {
  const box = document.getElementById('errors');
  box.hidden = false;
  box.append(`${text}\n`);
}
window.addEventListener('error', (event) => showError(`${event.message} (line ${event.lineno})`));
window.addEventListener('unhandledrejection', (event) => showError(String(event.reason)));

function readData() {
  return JSON.parse(document.getElementById('data').textContent);
}

// ---- Elements.

function fill(node, attributes, children) {
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  node.append(...children);
  return node;
}

function element(tag, attributes = {}, ...children) {
  return fill(document.createElement(tag), attributes, children);
}

function svg(tag, attributes = {}, ...children) {
  return fill(document.createElementNS('http://www.w3.org/2000/svg', tag), attributes, children);
}

function swatch(colour) {
  const node = element('span', {class: 'swatch'});
  node.style.background = colour;
  return node;
}

// The parts of a table: its titles (texts or elements) and its rows (elements).
function tableParts(titles, rows) {
  return [element('thead', {}, element('tr', {}, ...titles.map((title) => element('th', {}, title)))),
    element('tbody', {}, ...rows)];
}

function scrollTable(kind, titles, rows) {
  return element('div', {class: 'scroll'}, element('table', {class: kind}, ...tableParts(titles, rows)));
}

// ---- Tables of figures. A figure: {key, title, unit, factor, digits}; `factor` brings an estimate to `unit`.

function figureTitle({title, unit}) {
  return unit ? `${title} [${unit}]` : title;
}

// A cell with an estimate, [value, low, high] or null, and its interval below.
function figureCell(figure, estimate, attributes = {}) {
  const cell = element('td', {...attributes, 'data-figure': figure.key, 'data-title': figureTitle(figure),
    'data-value': estimate === null ? '' : estimate[0]});
  if (estimate === null) {
    cell.append(element('span', {class: 'sub'}, 'none'));
    return cell;
  }
  const text = (number) => (figure.factor * number).toFixed(figure.digits === undefined ? 1 : figure.digits);
  cell.append(element('span', {class: 'value'}, text(estimate[0])));
  if (estimate[1] !== null) cell.append(element('span', {class: 'interval'}, `${text(estimate[1])} – ${text(estimate[2])}`));
  return cell;
}

// ---- Settings in which agents differ: a heading and a table for each kind of agent.

// A key as code that may break after its dots.
function keyNode(key) {
  return element('code', {}, ...key.split('.').flatMap((part, i) => (i === 0 ? [part] : ['.', element('wbr'), part])));
}

function settingTables(settings) {
  return settings.flatMap(({title, labels, rows}) => [element('h2', {}, title),
    scrollTable('settings', ['Key', ...labels], rows.map(([key, ...values]) => element('tr', {'data-setting': key},
      element('td', {}, keyNode(key)), ...values.map((value) => element('td', {}, element('code', {}, value))))))]);
}

// ---- Numbers as text. What is not known (null) is a dash.

const UNKNOWN = '–';

function isKnown(value) {
  return value !== null && value !== undefined;
}

function count(value) {
  if (!isKnown(value)) return UNKNOWN;
  for (const [unit, size] of [['G', 1e9], ['M', 1e6], ['k', 1e3]]) {
    if (Math.abs(value) >= size) return `${Number((value / size).toPrecision(3))}${unit}`;
  }
  return `${Number(value.toPrecision(3))}`;
}

function percent(rate, digits = 0) {
  return isKnown(rate) ? `${(100 * rate).toFixed(digits)} %` : UNKNOWN;
}

function duration(seconds) {
  if (!isKnown(seconds)) return UNKNOWN;
  const whole = Math.round(seconds);
  const two = (number) => String(number).padStart(2, '0');
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return `${Math.floor(whole / 60)}:${two(whole % 60)} min`;
  return `${Math.floor(whole / 3600)}:${two(Math.floor(whole / 60) % 60)} h`;
}

function signed(number, digits = 1) {
  const text = Math.abs(number).toFixed(digits);
  return Number(text) === 0 ? text : `${number > 0 ? '+' : '−'}${text}`;
}

function pText(p) {
  if (!isKnown(p)) return UNKNOWN;
  return p < 0.001 ? '< 0.001' : p.toFixed(3);
}

// "74.2 % (70.1 – 78.0 %)" of [value, low, high], which `factor` brings to `unit`.
function estimateText(estimate, {factor = 100, unit = ' %', digits = 1, sign = false} = {}) {
  if (!isKnown(estimate)) return UNKNOWN;
  const [value, low, high] = estimate.map((number) =>
    (number === null ? null : sign ? signed(factor * number, digits) : (factor * number).toFixed(digits)));
  return `${value}${unit}` + (low === null ? '' : ` (${low} ${sign ? 'to' : '–'} ${high}${unit})`);
}

function plural(number, noun) {
  return `${number} ${noun}${number === 1 ? '' : 's'}`;
}

function shorten(text, length) {
  return text.length <= length ? text : `${text.slice(0, length - 1)}…`;
}

// ---- The tip beside the pointer. `text`: what it says, or a function of the event.

function setTip(node, text) {
  const tip = document.getElementById('tip');
  node.addEventListener('pointermove', (event) => {
    tip.hidden = false;
    tip.textContent = typeof text === 'function' ? text(event) : text;
    const right = event.clientX + 14 + tip.offsetWidth < window.innerWidth;
    tip.style.left = `${right ? event.clientX + 14 : event.clientX - 14 - tip.offsetWidth}px`;
    tip.style.top = `${Math.max(4, event.clientY - tip.offsetHeight - 8)}px`;
  });
  node.addEventListener('pointerleave', () => {
    tip.hidden = true;
  });
}

// ---- Light or dark: page.html sets it before the page is first drawn, as the system asks; the button takes over from
// there. Paper is always light.

function isDark() {
  return document.documentElement.dataset.theme === 'dark';
}

// The value of a colour of page.css, "--ink" or "var(--ink)": a canvas knows no variables.
function themeColour(name) {
  const variable = name.replace(/^var\((.*)\)$/, '$1');
  return getComputedStyle(document.documentElement).getPropertyValue(variable).trim();
}

// Calls `draw` whenever the colours or the width of the page change.
function redrawOnChange(draw) {
  const system = window.matchMedia('(prefers-color-scheme: dark)');
  const button = document.getElementById('theme');
  let chosen = null;  // By the button; null: as the system asks.
  const wanted = () => chosen || (system.matches ? 'dark' : 'light');
  const show = (theme) => {
    const isNew = document.documentElement.dataset.theme !== theme;
    document.documentElement.dataset.theme = theme;
    button.textContent = isDark() ? 'Light' : 'Dark';
    if (isNew) draw();
  };
  button.addEventListener('click', () => {
    chosen = isDark() ? 'light' : 'dark';
    show(chosen);
  });
  system.addEventListener('change', () => show(wanted()));
  window.addEventListener('beforeprint', () => show('light'));
  window.addEventListener('afterprint', () => show(wanted()));
  show(wanted());
  let width = window.innerWidth;
  window.addEventListener('resize', () => {
    if (window.innerWidth === width) return;
    width = window.innerWidth;
    draw();
  });
}
