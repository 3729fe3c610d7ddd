'use strict';

// Whatever goes wrong stands on the page, for people and for the test.
window.addEventListener('error', (event) => {
  const box = document.getElementById('errors');
  box.hidden = false;
  box.append(`${event.message} (line ${event.lineno})\n`);
});

