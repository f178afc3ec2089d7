/* Selection and order of the visible series, and their controls. */
const inputs = {q: $('#search'), preset: $('#preset'), view: $('#view'), finding: $('#finding'), sort: $('#sort')};
const defaults = {q: '', status: 'all', preset: '', view: '', finding: '', sort: 'study', reverse: '', open: ''};
const state = {...defaults, ...Object.fromEntries(new URLSearchParams(location.hash.slice(1)))};
if (!SORTS[state.sort]) state.sort = defaults.sort;
let shown = [], current = 0;

function remember() {
  const changed = Object.entries(state).filter(([key, value]) => value !== defaults[key] && key in defaults);
  try { history.replaceState(null, '', changed.length ? `#${new URLSearchParams(changed)}` : location.pathname); }
  catch { /* a page that is not allowed to remember works as well */ }
}

const hasPicture = s => s.pictures.some(p => (!state.preset || clean(p.preset) === state.preset) &&
  (!state.view || clean(p.view) === state.view));
function matches(s, terms) {
  return (state.status === 'all' || s.state === state.status) && terms.every(term => s.text.includes(term)) &&
    (!state.finding || s.findings.some(f => clean(f.code) === state.finding)) &&
    (!(state.preset || state.view) || hasPicture(s));
}

const sheet = $('#sheet'), size = $('#size');
const watcher = new IntersectionObserver(entries => {
  for (const entry of entries)
    if (entry.isIntersecting) {
      fill(series[entry.target.dataset.index]);
      watcher.unobserve(entry.target);
    }
}, {rootMargin: '1200px'});

/* The first cards at once, the others while the browser has nothing else to do; flush() when they are needed. */
const FIRST = 200, STEP = 500;
const idle = window.requestIdleCallback ?? (run => setTimeout(run, 20));
let waiting = [];
function flush(n = waiting.length) {
  sheet.append(...waiting.splice(0, n));
  sheet.ariaBusy = waiting.length > 0;
}
function place(cards) {
  sheet.replaceChildren(...cards.slice(0, FIRST));
  const mine = waiting = cards.slice(FIRST);
  sheet.ariaBusy = mine.length > 0;
  const step = () => {
    if (mine !== waiting) return;
    flush(STEP);
    if (mine.length) idle(step);
  };
  if (mine.length) idle(step);
}

function apply() {
  const terms = state.q.toLowerCase().split(/\s+/).filter(Boolean), compare = SORTS[state.sort][1];
  const held = shown[current];
  sought = terms;
  shown = series.filter(s => matches(s, terms));
  shown.sort((a, b) => (compare(a, b) || a.rank - b.rank) * (state.reverse ? -1 : 1));
  const cards = shown.map((s, place) => {
    if (!s.card) watcher.observe(s.card = shell(s));
    s.card.setAttribute('aria-posinset', place + 1);
    s.card.setAttribute('aria-setsize', shown.length);
    return s.card;
  });
  series.forEach(s => s.filled && s.labels.length && ($('.labels summary', s.card).textContent = labelsLine(s)));
  place(cards);
  $('#empty').hidden = shown.length > 0;
  $('#count').textContent = (shown.length < series.length ? `${count(shown.length)} of ` : '') +
    `${count(series.length)} series`;
  focusable(Math.max(0, shown.indexOf(held)));
  remember();
}

/* Only one card is a stop of the Tab key; arrow keys move from it. */
function focusable(place, move) {
  for (const [k, value] of [[current, -1], [place, 0]]) {
    const s = shown[k];
    if (!s) continue;
    s.card.tabIndex = value;
    if (!value) fill(s);
    $$('a, summary', s.card).forEach(element => { element.tabIndex = value; });
  }
  current = place;
  if (move && shown[place]) {
    if (!shown[place].card.isConnected) flush();
    shown[place].card.focus({preventScroll: true});
    shown[place].card.scrollIntoView({block: 'nearest'});
  }
}

function columns() { return getComputedStyle(sheet).gridTemplateColumns.split(' ').length; }

/* ---- the controls ---- */

function choices(select, first, values) {
  const counts = new Map();
  values.forEach(value => counts.set(value, (counts.get(value) ?? 0) + 1));
  const sorted = [...counts].sort((a, b) => b[1] - a[1] || byUid(a[0], b[0]));
  select.replaceChildren(make('option', {value: ''}, first), ...sorted.map(([value, n]) =>
    make('option', {value}, `${select.id === 'view' ? viewName(value) : value} (${count(n)})`)));
  select.closest('label').hidden = counts.size < 1;
}
const distinct = values => [...new Set(values)];

function setUp() {
  const all = name => series.filter(s => name === 'all' || s.state === name).length;
  const states = Object.keys(STATES).filter(name => !['thumbnail', 'waiting', 'working', 'skipped'].includes(name) || all(name));
  $('#status').append(...['all', ...states].map(name => {
    const button = make('button', {type: 'button', value: name});
    if (STATES[name])
      button.append(make('span', {class: `mark ${name}`, 'aria-hidden': 'true'}, STATES[name].mark), ' ');
    button.append(`${STATES[name]?.word ?? 'All'} `, make('b', {}, count(all(name))));
    button.addEventListener('click', () => { state.status = name; show(); });
    return button;
  }));
  choices(inputs.preset, 'any', series.flatMap(s => distinct(s.pictures.map(p => clean(p.preset)))));
  choices(inputs.view, 'any', series.flatMap(s => distinct(s.pictures.map(p => clean(p.view)))));
  choices(inputs.finding, 'any or none', series.flatMap(s => distinct(s.findings.map(f => clean(f.code)))));
  inputs.sort.append(...Object.entries(SORTS).map(([value, [name]]) => make('option', {value}, name)));
  for (const [key, input] of Object.entries(inputs))
    input.addEventListener('input', () => { state[key] = input.value; show(); });
  $('#direction').addEventListener('click', () => { state.reverse = state.reverse ? '' : '1'; show(); });
  $('#more').addEventListener('click', () => {
    const more = $('#filter').classList.toggle('more');
    $('#more').setAttribute('aria-expanded', more);
  });
  $('#filter').addEventListener('submit', event => event.preventDefault());
  $('#clear').addEventListener('click', () => {
    Object.assign(state, {...defaults, sort: state.sort, reverse: state.reverse});
    show();
    inputs.q.focus();
  });
  const work_ms = series.reduce((sum, s) => sum + s.wall_ms, 0);
  $('#summary').textContent = `${plural(series.reduce((n, s) => n + s.pictures.length, 0), 'picture')} of ` +
    `${count(series.length)} series` + (work_ms ? `, ${time(work_ms)} of work` : '') +
    ` · ctsplat ${clean(data.version)}` +
    (run ? ` · ${run.goes_on ? 'under way' : 'ended early'}: ${count(+run.ended)} of ${count(+run.series)} series at ` +
      clean(run.at).replace('T', ' ').replace('Z', ' UTC') : '') +
    (data.objects ? ` · ${plural(data.objects, 'object')} without an image` : '') +
    (data.unreadable ? ` · ${plural(data.unreadable, 'unreadable line')} in the journal` : '');
}

/* Updates the controls from the state, then the sheet. */
function show() {
  for (const [key, input] of Object.entries(inputs)) {
    if (input.value !== state[key]) input.value = state[key];
    if (input.value !== state[key]) input.value = state[key] = defaults[key];
  }
  $$('#status button').forEach(button => button.setAttribute('aria-pressed', button.value === state.status));
  const direction = $('#direction');
  direction.setAttribute('aria-pressed', !!state.reverse);
  direction.setAttribute('aria-label', 'Reverse the order');
  direction.textContent = state.reverse ? '↑' : '↓';
  apply();
}

/* Kept from visit to visit, where the browser lets a page on disk do so. */
function kept(key, value) {
  const name = `ctsplat-${key}`;
  try { return value === undefined ? localStorage.getItem(name) : localStorage.setItem(name, value); }
  catch { return null; }
}

function resize() {
  document.documentElement.style.setProperty('--preview', `${size.value}rem`);
  series.forEach(s => s.filled && spread(s));
}
new ResizeObserver(resize).observe(sheet);
size.value = kept('size') ?? 8;
size.addEventListener('input', () => { kept('size', size.value); resize(); });
