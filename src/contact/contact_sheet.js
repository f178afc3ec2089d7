'use strict';
(() => {
const data = JSON.parse(document.getElementById('data').textContent);
const $ = (selector, root = document) => root.querySelector(selector);
const $$ = (selector, root = document) => [...root.querySelectorAll(selector)];

/* ---- words and numbers ---- */

const STATES = {
  done: {word: 'Done', mark: '✓', rank: 2}, refused: {word: 'Refused', mark: '⊘', rank: 1},
  failed: {word: 'Failed', mark: '✕', rank: 0}
};
const MARKS = {warning: ['⚠', 'refused'], refusal: ['⊘', 'failed'], note: ['ℹ', '']};
const COLOURS = {
  scan: '#7a8793', decode: '#3f7fbf', grey: '#5fb3d9', classify: '#8e6bbf', footprint: '#c06ba8', splat: '#d97b34',
  composite: '#e0b13c', shade: '#7cae3a', warp: '#3a9d8f', export: '#4f5fc4'
};
const SYNTAXES = {
  '1.2.840.10008.1.2': 'Implicit VR', '1.2.840.10008.1.2.1': 'Explicit VR', '1.2.840.10008.1.2.2': 'Big Endian',
  '1.2.840.10008.1.2.1.99': 'Deflated', '1.2.840.10008.1.2.5': 'RLE', '1.2.840.10008.1.2.4.50': 'JPEG Baseline',
  '1.2.840.10008.1.2.4.51': 'JPEG Extended', '1.2.840.10008.1.2.4.57': 'JPEG Lossless',
  '1.2.840.10008.1.2.4.70': 'JPEG Lossless', '1.2.840.10008.1.2.4.80': 'JPEG-LS',
  '1.2.840.10008.1.2.4.81': 'JPEG-LS near-lossless', '1.2.840.10008.1.2.4.90': 'JPEG 2000 Lossless',
  '1.2.840.10008.1.2.4.91': 'JPEG 2000', '1.2.840.10008.1.2.4.201': 'HTJ2K Lossless', '1.2.840.10008.1.2.4.203': 'HTJ2K'
};
const count = n => n.toLocaleString('en');
const plural = (n, word) => `${count(n)} ${word}${n === 1 ? '' : 's'}`;
const number = x => typeof x === 'number' ? String(+x.toPrecision(4)).replace('-', '−') : '?';
const time = ms => ms < 1000 ? `${Math.round(ms)} ms` : ms < 60e3 ? `${(ms / 1e3).toFixed(ms < 1e4 ? 2 : 1)} s`
  : ms < 3600e3 ? `${Math.floor(ms / 60e3)} min ${Math.round(ms % 60e3 / 1e3)} s` : `${(ms / 3600e3).toFixed(1)} h`;
const megabytes = bytes => bytes < 1e9 ? `${Math.round(bytes / 1e6)} MB` : `${(bytes / 1e9).toFixed(2)} GB`;
/* Text from outside: marks that are not to be seen, or turn the text round, are shown as such. */
const clean = text => String(text ?? '').replace(
  /[\u0000-\u001f\u007f-\u009f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff]/g, '\ufffd');
const shortUid = uid => uid.length > 34 ? uid.slice(0, 10) + '…' + uid.slice(-20) : uid || '(without UID)';
const viewName = view => /^-?[\d.]+,-?[\d.]+$/.test(view) ? view.split(',').map(a => number(+a) + '°').join(' / ') : view;
const pictureName = p => `${clean(p.preset)} · ${viewName(clean(p.view))}`;
const url = path => path.split('/').map(encodeURIComponent).join('/');
const framePath = (file, k) => file.frames < 2 ? file.first
  : file.first.replace(/-(\d+)(\.[^./]*)$/, (all, digits, ending) => `-${String(k).padStart(digits.length, '0')}${ending}`);

/* An element with attributes and children; strings become text, never markup. */
function make(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes))
    if (value === true) element.setAttribute(key, '');
    else if (value !== false && value != null) element.setAttribute(key, value);
  element.append(...children.flat().filter(child => child != null && child !== false));
  return element;
}

/* ---- the series ---- */

const list = value => Array.isArray(value) ? value : [];
const series = list(data.series).map((line, index) => {
  const s = {index, line, uid: clean(line.series_uid), state: STATES[line.status] ? line.status : 'failed',
    reason: clean(line.reason), geometry: line.geometry ?? {}, pictures: list(line.pictures),
    findings: list(line.findings).filter(f => clean(f.text) !== clean(line.reason)),
    stages: Object.entries(line.stages ?? {}).map(([name, t]) => [clean(name), +t.wall_ms || 0]),
    wall_ms: +line.wall_ms || 0, memory: +line.peak_rss_bytes || 0, ended: clean(line.ended)};
  s.text = [s.uid, s.state, s.reason, clean(s.geometry.description), clean(s.geometry.orientation),
    clean(s.geometry.transfer_syntax), SYNTAXES[s.geometry.transfer_syntax] ?? '', ...s.findings.map(f => `${clean(f.code)} ${clean(f.text)}`),
    ...s.pictures.map(pictureName)].join('\n').toLowerCase();
  return s;
});

const byUid = new Intl.Collator('en', {numeric: true}).compare;
[...series].sort((a, b) => byUid(a.uid, b.uid)).forEach((s, rank) => { s.rank = rank; });
const later = (a, b) => a.ended < b.ended ? 1 : a.ended > b.ended ? -1 : 0;
const SORTS = {
  trouble: ['What is not done', (a, b) => STATES[a.state].rank - STATES[b.state].rank ||
    b.findings.length - a.findings.length],
  ended: ['Latest', later],
  uid: ['Series UID', () => 0],
  slices: ['Slices', (a, b) => (b.geometry.slices || 0) - (a.geometry.slices || 0)],
  time: ['Time taken', (a, b) => b.wall_ms - a.wall_ms],
  memory: ['Peak memory', (a, b) => b.memory - a.memory]
};

/* ---- one card ---- */

function facts(s) {
  const g = s.geometry, dl = make('dl', {class: 'facts'});
  const add = (term, value) => value && dl.append(make('div', {}, make('dt', {}, term), ' ', make('dd', {}, value)));
  add('Slices', g.slices ? count(g.slices) : '');
  add('Matrix', list(g.dims).length === 3 ? g.dims.slice(0, 2).map(number).join(' × ') : '');
  add('Spacing', list(g.spacing_mm).length ? `${g.spacing_mm.map(number).join(' × ')} mm` : '');
  add('HU', typeof g.hu_min === 'number' ? `${number(g.hu_min)} … ${number(g.hu_max)}` : '');
  add('Tilt', g.tilt_deg ? `${number(g.tilt_deg)}°` : '');
  add('Orientation', clean(g.orientation));
  add('Syntax', SYNTAXES[g.transfer_syntax] ?? clean(g.transfer_syntax));
  return dl;
}

function findings(s) {
  return make('ul', {class: 'findings'}, s.findings.map(f => {
    const [mark, kind] = MARKS[f.severity] ?? MARKS.note;
    return make('li', {}, make('span', {class: `mark ${kind}`, role: 'img', 'aria-label': clean(f.severity)}, mark),
      clean(f.text), ' ', make('code', {}, clean(f.code)));
  }));
}

function bar(name, share, among) {
  const i = make('i', {title: name});
  i.style.background = COLOURS[name] ?? '#9a8f7d';
  i.style[among ? 'flexGrow' : 'width'] = among ? share : `${100 * share}%`;
  return i;
}

function times(s, open) {
  if (!s.wall_ms && !s.stages.length) return null;
  const stack = make('div', {class: 'stack', 'aria-hidden': 'true'}, s.stages.map(([name, ms]) => bar(name, ms, true)));
  const largest = Math.max(...s.stages.map(stage => stage[1]), 1e-9);
  return make('details', {class: 'times', open},
    make('summary', {}, make('span', {class: 'line'}, `${time(s.wall_ms)}${s.memory ? ` · peak ${megabytes(s.memory)}` : ''}`,
      s.ended && make('time', {datetime: s.ended}, s.ended.slice(0, 16).replace('T', ' '))), stack),
    make('div', {class: 'stages'}, s.stages.flatMap(([name, ms]) => [make('span', {}, name),
      make('span', {}, bar(name, ms / largest)), make('span', {}, time(ms))])));
}

/* A rotation's frames stand side by side in one picture, which slides behind a window of one frame. */
function strip(turn) {
  const box = make('div', {class: 'strip'}, make('img', {src: url(turn.path), alt: '', draggable: 'false'}));
  box.style.setProperty('--ratio', turn.width / turn.height || 1);
  box.style.setProperty('--frames', turn.frames);
  box.style.setProperty('--seconds', `${Math.max(2, turn.frames / 9)}s`);
  return box;
}

function preview(s, p, place) {
  const file = fullFile(p) ?? Object.values(p.files ?? {})[0], small = p.thumb ?? fullFile(p)?.first;
  const link = make('a', {href: file ? url(file.first) : '#', tabindex: '-1',
    'data-picture': place, class: p.turn ? 'turns' : null});
  const still = make('img', {src: url(small ?? ''), loading: 'lazy', decoding: 'async',
    alt: `${pictureName(p)}${p.turn ? ', a rotation' : ''}`});
  still.addEventListener('error', () => still.replaceWith('no preview'));
  const frame = make('div', {class: 'frame'}, small ? still : 'no preview');
  link.append(frame, make('figcaption', {}, pictureName(p)));
  link.addEventListener('mouseenter', () => matchMedia('(prefers-reduced-motion: reduce)').matches || play(link, p, true));
  link.addEventListener('mouseleave', () => play(link, p, false));
  return make('figure', {}, link);
}

function play(link, p, on) {
  const frame = $('.frame', link), playing = $('.strip', frame);
  if (!p.turn || on === !!playing) return;
  if (playing) { playing.remove(); frame.firstChild.hidden = false; return; }
  const box = strip(p.turn), image = $('img', box);
  frame.append(box);
  box.hidden = true;
  image.decode().then(() => { box.hidden = false; frame.firstChild.hidden = true; }, () => box.remove());
}

function playCard(card, s) {
  const on = !$('.strip', card);
  $$('[data-picture]', card).forEach(link => play(link, s.pictures[link.dataset.picture], on));
}

function shell(s) {
  const state = STATES[s.state];
  const card = make('article', {class: `card ${s.state}`, tabindex: '-1', 'aria-label': `${state.word}, series ${s.uid}`,
    'data-index': s.index}, make('header', {}, make('span', {class: 'state'}, `${state.mark} ${state.word}`),
    make('h2', {class: 'mono', title: s.uid}, shortUid(s.uid))));
  return card;
}

/* Rows of previews are equally full: four stand two by two where there is room for three. */
function spread(s) {
  const previews = $('.previews', s.card), n = s.pictures.length;
  if (!previews || !previews.clientWidth) return;
  const room = Math.max(1, Math.floor((previews.clientWidth + 4) / (size.value * 15 + 4)));
  previews.style.gridTemplateColumns = `repeat(${Math.ceil(n / Math.ceil(n / room))}, 1fr)`;
}

function fill(s) {
  if (s.filled) return;
  s.filled = true;
  s.card.append(...[s.geometry.description && make('p', {class: 'description'}, make('bdi', {}, clean(s.geometry.description))),
    s.reason && make('p', {class: 'reason'}, s.reason),
    s.pictures.length && make('div', {class: 'previews'}, s.pictures.map((p, place) => preview(s, p, place))),
    facts(s), s.findings.length && findings(s), times(s)].filter(Boolean));
  spread(s);
}

/* ---- which series, in what order ---- */

const inputs = {q: $('#search'), preset: $('#preset'), view: $('#view'), finding: $('#finding'), sort: $('#sort')};
const defaults = {q: '', status: 'all', preset: '', view: '', finding: '', sort: 'ended', reverse: '', open: ''};
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
  shown = series.filter(s => matches(s, terms));
  shown.sort((a, b) => (compare(a, b) || a.rank - b.rank) * (state.reverse ? -1 : 1));
  const cards = shown.map((s, place) => {
    if (!s.card) watcher.observe(s.card = shell(s));
    s.card.setAttribute('aria-posinset', place + 1);
    s.card.setAttribute('aria-setsize', shown.length);
    return s.card;
  });
  place(cards);
  $('#empty').hidden = shown.length > 0;
  $('#count').textContent = (shown.length < series.length ? `${count(shown.length)} of ` : '') +
    `${count(series.length)} series`;
  focusable(Math.max(0, shown.indexOf(held)));
  remember();
}

/* One card at a time is a stop of the Tab key; arrows go on from it. */
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
  select.replaceChildren(make('option', {value: ''}, first), ...[...counts].sort((a, b) => b[1] - a[1] || byUid(a[0], b[0]))
    .map(([value, n]) => make('option', {value}, `${select.id === 'view' ? viewName(value) : value} (${count(n)})`)));
  select.closest('label').hidden = counts.size < 1;
}
const distinct = values => [...new Set(values)];

function setUp() {
  const all = name => series.filter(s => name === 'all' || s.state === name).length;
  $('#status').append(...['all', ...Object.keys(STATES)].map(name => {
    const button = make('button', {type: 'button', value: name});
    if (STATES[name]) button.append(make('span', {class: `mark ${name}`, 'aria-hidden': 'true'}, STATES[name].mark), ' ');
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
    `${count(series.length)} series` + (work_ms ? `, ${time(work_ms)} of work` : '') + ` · ctsplat ${clean(data.version)}` +
    (data.unreadable ? ` · ${plural(data.unreadable, 'unreadable line')} in the journal` : '');
}

/* The controls show the state, the sheet follows. */
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
  try { return value === undefined ? localStorage.getItem(`ctsplat-${key}`) : localStorage.setItem(`ctsplat-${key}`, value); }
  catch { return null; }
}

const THEMES = {auto: '◐ Auto', light: '☀ Light', dark: '☾ Dark'};
let theme = kept('theme') in THEMES ? kept('theme') : 'auto';
const dark = matchMedia('(prefers-color-scheme: dark)');
function paint() {
  const isDark = theme === 'auto' ? dark.matches : theme === 'dark';
  document.documentElement.dataset.theme = isDark ? 'dark' : 'light';
  $('#theme').textContent = THEMES[theme];
  $('#theme').setAttribute('aria-label', `Colours: ${theme}`);
}
$('#theme').addEventListener('click', () => {
  const names = Object.keys(THEMES);
  theme = names[(names.indexOf(theme) + 1) % names.length];
  kept('theme', theme);
  paint();
});
dark.addEventListener('change', paint);

function resize() {
  document.documentElement.style.setProperty('--preview', `${size.value}rem`);
  series.forEach(s => s.filled && spread(s));
}
new ResizeObserver(resize).observe(sheet);
size.value = kept('size') ?? 8;
size.addEventListener('input', () => { kept('size', size.value); resize(); });

/* ---- the viewer ---- */

const viewer = $('#viewer'), picture = $('.picture', viewer), slider = $('#frame');
const image = $('img', picture); /* the full picture; a strip stands beside it */
const open = {s: null, place: 0, frame: 0, timer: 0};
const fullFile = p => p.files?.png;
const openPicture = () => open.s.pictures[open.place];
const frames = p => fullFile(p) ? fullFile(p).frames : p.turn ? p.turn.frames : 1;

function showFrame(k) {
  const p = openPicture(), n = frames(p), full = fullFile(p);
  open.frame = (k % n + n) % n;
  slider.value = open.frame;
  $('#frame-text').textContent = `${open.frame + 1} of ${n}`;
  if (full) {
    image.src = url(framePath(full, open.frame));
    if (n > 1) new Image().src = url(framePath(full, (open.frame + 1) % n));
  } else if (p.turn) {
    const inner = $('.strip img', picture);
    inner.style.animation = 'none';
    inner.style.transform = `translateX(${-100 * open.frame / n}%)`;
  }
}

function showPicture(place) {
  const p = open.s.pictures[place];
  open.place = place;
  stop();
  $('.frame', picture)?.remove();
  $$('nav button', viewer).forEach((button, k) => button.setAttribute('aria-current', k === place));
  $('nav [aria-current=true]', viewer)?.scrollIntoView({block: 'nearest', inline: 'nearest'});
  $('.stage', viewer).setAttribute('aria-label', p ? pictureName(p) : 'No picture');
  image.hidden = !p || (!fullFile(p) && (!p.thumb || p.turn));
  picture.classList.remove('exact');
  picture.classList.toggle('turnable', !!p && frames(p) > 1);
  picture.classList.toggle('strip-only', !!p && !fullFile(p) && !!p.turn);
  $('.turning', viewer).hidden = !p || frames(p) < 2;
  $('.links', viewer)?.remove();
  if (!p) return;
  image.alt = pictureName(p);
  if (!fullFile(p) && p.turn) picture.append(make('div', {class: 'frame'}, strip(p.turn)));
  else if (!fullFile(p)) image.src = url(p.thumb ?? '');
  slider.max = frames(p) - 1;
  showFrame(0);
  const links = Object.entries(p.files ?? {}).map(([format, file]) => make('a', {href: url(framePath(file, 0)),
    target: '_blank', rel: 'noopener'}, `${clean(format).toUpperCase()}${file.frames > 1 ? `, ${file.frames} files` : ''}`));
  $('aside', viewer).prepend(make('p', {class: 'links'}, links));
}

function showSeries(s, place) {
  open.s = s;
  const known = STATES[s.state];
  $('#viewer-title').replaceChildren(make('span', {class: `state ${s.state}`}, `${known.mark} ${known.word}`), ' ',
    make('span', {class: 'mono', title: s.uid}, shortUid(s.uid)));
  $('nav', viewer).replaceChildren(...s.pictures.map((p, k) => {
    const button = make('button', {type: 'button'}, pictureName(p));
    button.addEventListener('click', () => showPicture(k));
    return button;
  }));
  const uid = make('p', {class: 'mono uid', 'aria-label': 'Series UID'}, s.uid);
  $('aside', viewer).replaceChildren(...[s.geometry.description && make('p', {}, make('bdi', {}, clean(s.geometry.description))),
    s.reason && make('p', {class: `reason ${s.state}`}, s.reason), uid, facts(s), s.findings.length && findings(s),
    times(s, true)].filter(Boolean));
  showPicture(Math.min(place, Math.max(0, s.pictures.length - 1)));
  focusable(shown.indexOf(s));
  state.open = s.uid;
  remember();
}

function openViewer(s, place = 0) {
  if (!viewer.open) viewer.showModal();
  showSeries(s, place);
  $('.stage', viewer).focus();
}

function stop() {
  clearTimeout(open.timer);
  open.timer = 0;
  $('#play').setAttribute('aria-pressed', 'false');
  $('#play').textContent = '▶ Play';
}
function toggle() {
  if (open.timer || !openPicture() || frames(openPicture()) < 2) return stop();
  $('#play').setAttribute('aria-pressed', 'true');
  $('#play').textContent = '⏸ Stop';
  /* The next frame comes when this one has been seen. */
  const step = () => { showFrame(open.frame + 1); (image.hidden ? Promise.resolve() : image.decode()).catch(() => {})
    .then(() => { if (open.timer) open.timer = setTimeout(step, 80); }); };
  open.timer = setTimeout(step, 0);
}
const nextPicture = by => open.s.pictures.length && showPicture(
  (open.place + by + open.s.pictures.length) % open.s.pictures.length);
function nextSeries(by) {
  const s = shown[shown.indexOf(open.s) + by];
  if (s) showSeries(s, open.place);
}
function zoom() {
  if (!openPicture() || !fullFile(openPicture())) return;
  picture.classList.toggle('exact');
}

$('#previous').addEventListener('click', () => nextPicture(-1));
$('#next').addEventListener('click', () => nextPicture(1));
$('#play').addEventListener('click', toggle);
$('#close').addEventListener('click', () => viewer.close());
slider.addEventListener('input', () => { stop(); showFrame(+slider.value); });
picture.addEventListener('dblclick', zoom);
viewer.addEventListener('close', () => {
  stop();
  image.removeAttribute('src');
  state.open = '';
  remember();
  focusable(Math.max(0, shown.indexOf(open.s)), true); /* the browser went back to where the viewer was opened from */
});
picture.addEventListener('pointerdown', event => {
  if (!openPicture() || frames(openPicture()) < 2 || event.button) return;
  event.preventDefault();
  stop();
  picture.setPointerCapture(event.pointerId);
  const start = event.clientX, first = open.frame, n = frames(openPicture());
  const move = e => showFrame(first + Math.round((e.clientX - start) / picture.clientWidth * n));
  picture.addEventListener('pointermove', move);
  for (const end of ['pointerup', 'pointercancel'])
    picture.addEventListener(end, () => picture.removeEventListener('pointermove', move), {once: true});
});

/* ---- clicks and keys ---- */

sheet.addEventListener('click', event => {
  const card = event.target.closest('.card'), link = event.target.closest('[data-picture]');
  if (!card || event.button || event.ctrlKey || event.metaKey || event.shiftKey) return;
  const s = series[card.dataset.index];
  focusable(shown.indexOf(s));
  if (link) {
    event.preventDefault();
    openViewer(s, +link.dataset.picture);
  }
});
sheet.addEventListener('focusin', event => {
  const place = shown.indexOf(series[event.target.closest('.card')?.dataset.index]);
  if (place >= 0 && place !== current) focusable(place);
});

function sheetKey(event) {
  const on = document.activeElement.classList.contains('card');
  const steps = {ArrowRight: 1, ArrowLeft: -1, ArrowDown: columns(), ArrowUp: -columns()};
  if (event.key === '/') inputs.q.focus();
  else if (on && steps[event.key]) {
    if (shown[current + steps[event.key]]) focusable(current + steps[event.key], true);
  } else if (on && event.key === 'Home') focusable(0, true);
  else if (on && event.key === 'End') focusable(shown.length - 1, true);
  else if (on && event.key === 'Enter') openViewer(shown[current]);
  else if (on && event.key === ' ') playCard(shown[current].card, shown[current]);
  else return false;
  return true;
}
function viewerKey(event) {
  const onSlider = event.target === slider;
  const actions = {ArrowDown: () => nextSeries(1), ArrowUp: () => nextSeries(-1), '.': () => showFrame(open.frame + 1),
    ',': () => showFrame(open.frame - 1), z: zoom, ' ': toggle, ArrowRight: () => nextPicture(1),
    ArrowLeft: () => nextPicture(-1)};
  if (!actions[event.key] || (onSlider && event.key.startsWith('Arrow')) ||
      (event.key === ' ' && event.target.closest('button, a, summary'))) return false;
  if (openPicture() || event.key.startsWith('Arrow')) actions[event.key]();
  return true;
}
document.addEventListener('keydown', event => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const typing = event.target.closest?.('input:not([type=range]), select, textarea');
  if (typing) {
    if (event.key === 'ArrowDown' && event.target === inputs.q && shown.length) {
      event.preventDefault();
      focusable(0, true);
    }
    return;
  }
  if (event.key === '?' && !$('#keys').open) { $('#keys').showModal(); return; }
  if ($('#keys').open) return;
  if (viewer.open ? viewerKey(event) : sheetKey(event)) event.preventDefault();
});
$('#keys-button').addEventListener('click', () => $('#keys').showModal());

paint();
resize();
setUp();
show();
const wanted = state.open && series.find(s => s.uid === state.open);
if (wanted) openViewer(wanted);
document.documentElement.dataset.ready = 'true';
})();
