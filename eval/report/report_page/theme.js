// ---- Light or dark: page.html sets it before the page is first drawn, as the system asks; the
// button takes over from there. Paper is always light.

class Theme {
  // `redraw`: draws again what holds colours as numbers (canvases, the scale of success).
  constructor(redraw) {
    this.redraw = redraw;
    this.system = window.matchMedia('(prefers-color-scheme: dark)');
    this.chosen = null;  // By the button; null: as the system asks.
    this.button = document.getElementById('theme');
    this.button.addEventListener('click', () => {
      this.chosen = isDark() ? 'light' : 'dark';
      this.show(this.wanted());
    });
    this.system.addEventListener('change', () => this.show(this.wanted()));
    window.addEventListener('beforeprint', () => this.show('light'));
    window.addEventListener('afterprint', () => this.show(this.wanted()));
    this.nameButton();
  }

  wanted() {
    return this.chosen || (this.system.matches ? 'dark' : 'light');
  }

  show(theme) {
    if (document.documentElement.dataset.theme === theme) return;
    document.documentElement.dataset.theme = theme;
    this.nameButton();
    this.redraw();
  }

  nameButton() {
    this.button.textContent = isDark() ? 'Light' : 'Dark';
  }
}

function isDark() {
  return document.documentElement.dataset.theme === 'dark';
}

// The value of a colour of page.css, "--ink" or "var(--ink)": a canvas knows no variables.
function themeColour(name) {
  const variable = name.replace(/^var\((.*)\)$/, '$1');
  return getComputedStyle(document.documentElement).getPropertyValue(variable).trim();
}
