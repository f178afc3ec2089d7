/* Data, text helpers, and the card of one series. The page concatenates its three scripts in this order. */
const data = JSON.parse(document.getElementById('data').textContent);
const $ = (selector, root = document) => root.querySelector(selector);
const $$ = (selector, root = document) => [...root.querySelectorAll(selector)];

/* ---- text and numbers ---- */

const STATES = {
  done: {word: 'Done', mark: '✓', rank: 5}, thumbnail: {word: 'Thumbnail', mark: '▫', rank: 4}, skipped: {word: 'Skipped', mark: '–', rank: 3},
  waiting: {word: 'Waiting', mark: '…', rank: 2},
  working: {word: 'Under way', mark: '…', rank: 2}, refused: {word: 'Refused', mark: '⊘', rank: 1},
  failed: {word: 'Failed', mark: '✕', rank: 0}
};
const MARKS = {warning: ['⚠', 'refused'], refusal: ['⊘', 'failed'], note: ['ℹ', '']};
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
const time = ms => ms < 1 ? '< 1 ms' : ms < 1000 ? `${Math.round(ms)} ms`
  : ms < 60e3 ? `${(ms / 1e3).toFixed(ms < 1e4 ? 2 : 1)} s`
  : ms < 3600e3 ? `${Math.floor(ms / 60e3)} min ${Math.round(ms % 60e3 / 1e3)} s`
  : `${(ms / 3600e3).toFixed(1)} h`;
const megabytes = bytes => bytes < 1e9 ? `${Math.round(bytes / 1e6)} MB` : `${(bytes / 1e9).toFixed(2)} GB`;
/* Text from outside, with invisible and bidirectional control characters replaced. */
const clean = text => spelled(String(text ?? '')).replace(
  /[\u0000-\u001f\u007f-\u009f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff]/g, '\ufffd');
/* Options, which messages write as `max-error`, as the command line has them. */
const spelled = text => text.replace(/`([a-z-]+)`/g, '--$1');
/* A UID split so that its middle is truncated first: its end distinguishes series. */
const uidParts = uid => [make('span', {class: 'head'}, uid ? uid.slice(0, -14) : '(without UID)'),
  make('span', {}, uid.slice(-14))];
const viewName = view => !/^-?[\d.]+,-?[\d.]+$/.test(view) ? view
  : view.split(',').map(angle => `${number(+angle)}°`).join(' / ');
const pictureName = p => `${clean(p.preset)} · ${viewName(clean(p.view))}`;
const url = path => path.split('/').map(encodeURIComponent).join('/');
const framePath = (file, k) => file.frames < 2 ? file.first
  : file.first.replace(/-(\d+)(\.[^./]*)$/, (all, digits, ending) =>
    `-${String(k).padStart(digits.length, '0')}${ending}`);

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
const object = value => value && typeof value === 'object' ? value : {};
const run = data.run ? object(data.run) : null; /* progress of the batch; null: it has ended */
const series = list(data.series).map(object).map((line, index) => {
  const s = {index, line, uid: clean(line.series_uid), state: STATES[line.status] ? line.status : 'failed',
    reason: clean(line.reason), geometry: object(line.geometry), pictures: list(line.pictures),
    findings: byCode(list(line.findings).map(object).filter(f => !clean(f.text) || !clean(line.reason).startsWith(clean(f.text)))),
    sources: list(line.sources).map(object), file: clean(line.reason_file), labels: list(line.labels).map(object),
    wall_ms: +line.wall_ms || 0, memory: +line.peak_rss_bytes || 0, ended: clean(line.ended)};
  if (run?.goes_on && line.unfinished !== undefined) {
    s.state = 'working';
    s.reason = `${plural(+line.unfinished || 0, 'picture')} to come`;
  }
  s.study = clean(s.geometry.study) || s.uid;
  return s;
});

/* Order of the series: by study date, where known, and series number; then by UIDs. Numbers such as 3.2 change only
 * when series are added. */
const byUid = new Intl.Collator('en', {numeric: true}).compare;
const order = (a, b) => byUid(clean(a.geometry.study_date), clean(b.geometry.study_date)) ||
  byUid(a.study, b.study) || (a.geometry.series_number || 0) - (b.geometry.series_number || 0) || byUid(a.uid, b.uid);
const studies = new Map();
[...series].sort(order).forEach((s, rank) => {
  const study = studies.get(s.study) ?? {number: studies.size + 1, n: 0};
  studies.set(s.study, study);
  s.rank = rank;
  s.number = `${study.number}.${++study.n}`;
});
/* Labels whose volume is far from the median of the same label in other series, where enough series have it. */
const ENOUGH = 5, FAR = 2;
const volumes = new Map();
for (const l of series.flatMap(s => s.labels)) {
  const name = clean(l.name), all = volumes.get(name) ?? [];
  if (l.ml > 0) all.push(l.ml);
  volumes.set(name, all);
}
volumes.forEach(all => all.sort((a, b) => a - b));
function flags(l) {
  const all = volumes.get(clean(l.name)) ?? [], share = l.ml / all[all.length >> 1];
  return [l.empty && 'empty', l.label_in_air && 'lies in air', l.touches_edge && 'touches the edge',
    l.parts > 1 && `${count(+l.parts)} parts`, l.overlap > 0 && 'overlaps',
    all.length >= ENOUGH && (share > FAR || share < 1 / FAR) && `${number(share)} × the median`].filter(Boolean);
}
for (const s of series) {
  const study = studies.get(s.study), g = s.geometry;
  s.name = `Series ${s.number}` + (study.n > 1 ? ` of study ${study.number}, ${count(study.n)} series` : '');
  s.details = [clean(g.study_date), g.series_number != null && `series number ${clean(g.series_number)}`,
    clean(g.description)].filter(Boolean).join(' · ');
  s.text = [s.uid, s.name, s.state, s.reason, s.details, s.file, clean(g.orientation), clean(g.transfer_syntax),
    SYNTAXES[g.transfer_syntax] ?? '', ...s.sources.flatMap(f => [`${clean(f.folder)}/${clean(f.first)}`]),
    ...s.findings.flatMap(f => [clean(f.code), ...f.texts, ...f.files]),
    ...s.labels.flatMap(l => [clean(l.name), ...flags(l)]), ...s.pictures.map(pictureName)].join('\n').toLowerCase();
}
const later = (a, b) => a.ended < b.ended ? 1 : a.ended > b.ended ? -1 : 0;
const SORTS = {
  study: ['Study', () => 0],
  trouble: ['What is not done', (a, b) => STATES[a.state].rank - STATES[b.state].rank ||
    b.findings.length - a.findings.length],
  ended: ['Latest', later],
  uid: ['Series UID', (a, b) => byUid(a.uid, b.uid)],
  slices: ['Slices', (a, b) => (b.geometry.slices || 0) - (a.geometry.slices || 0)],
  time: ['Time taken', (a, b) => b.wall_ms - a.wall_ms],
  memory: ['Peak memory', (a, b) => b.memory - a.memory]
};
if (series.some(s => s.labels.length))
  SORTS.volume = ['Volume of labels', (a, b) => found(b).ml - found(a).ml];

/* The labels that match the search (without a search all), with their values. */
let sought = [];
function found(s) {
  const named = s.labels.filter(l => sought.some(term => clean(l.name).toLowerCase().includes(term)));
  const labels = named.length ? named : s.labels;
  return {labels, named, ml: labels.reduce((sum, l) => sum + (+l.ml || 0), 0)};
}

/* ---- one card ---- */

function facts(s) {
  const g = s.geometry, dl = make('dl', {class: 'facts'});
  const add = (term, value) => value && dl.append(make('div', {}, make('dt', {}, term), ' ', make('dd', {}, value)));
  add('Modality', clean(g.modality));
  add(s.state === 'thumbnail' ? 'Images' : 'Slices', g.slices ? count(g.slices) : '');
  add('Matrix', list(g.dims).length === 3 ? g.dims.slice(0, 2).map(number).join(' × ') : '');
  const spacing = list(g.spacing_mm).filter(mm => typeof mm === 'number');
  add('Spacing', spacing.length ? `${spacing.map(number).join(' × ')} mm` : '');
  add(g.quantity, typeof g.value_min === 'number' ? `${number(g.value_min)} … ${number(g.value_max)} ${g.unit}` : '');
  add('Tilt', Math.abs(g.tilt_deg) > 0.1 ? `${number(g.tilt_deg)}°` : ''); // below it a stack is not sheared
  add('Orientation', clean(g.orientation));
  add('Syntax', SYNTAXES[g.transfer_syntax] ?? clean(g.transfer_syntax));
  return dl;
}

/* Each finding once, with its count. */
function byCode(findings) {
  const kinds = new Map();
  for (const f of findings) {
    const key = `${clean(f.severity)} ${clean(f.code)}`;
    const kind = kinds.get(key) ?? {code: f.code, severity: f.severity, texts: [], presets: [], files: [], count: 0};
    kinds.set(key, kind);
    kind.count += +f.count || 1;
    for (const [all, one] of [[kind.texts, clean(f.text)], [kind.presets, clean(f.preset)],
      ...list(f.files).map(file => [kind.files, clean(file)])])
      if (one && !all.includes(one)) all.push(one);
  }
  return [...kinds.values()];
}

function findings(s) {
  return make('ul', {class: 'findings'}, s.findings.map(f => {
    const [mark, kind] = MARKS[f.severity] ?? MARKS.note;
    const label = clean(f.severity) || 'note', more = [...f.texts.slice(1), ...f.files];
    return make('li', {}, make('span', {class: `mark ${kind}`, role: 'img', 'aria-label': label}, mark),
      f.count > 1 && make('b', {class: 'times-found'}, `${count(f.count)} × `),
      f.presets.length ? `${f.presets.join(', ')}: ` : '', f.texts[0], ' ', make('code', {}, clean(f.code)),
      more.length > 0 && make('details', {}, make('summary', {}, `${count(more.length)} more`),
        more.map(text => make('div', {}, text))));
  }));
}

const millilitres = ml => `${number(+ml || 0)} ml`;
function labelsLine(s) {
  const {labels, named, ml} = found(s), flagged = s.labels.filter(l => flags(l).length).length;
  return `${named.length === 1 ? clean(labels[0].name) : plural(labels.length, 'label')}, ${millilitres(ml)}` +
    (flagged ? ` · ${count(flagged)} flagged` : '');
}
/* The outlines' colours are those of the picture (patient_sections.c). */
function sections(s) {
  const path = clean(s.line.sections);
  return path && make('img', {class: 'sections', src: url(path), loading: 'lazy', width: 720, height: 240,
    alt: `Axial, coronal and sagittal section${s.labels.length ? ' with the outlines of the labels' : ''}`});
}
/* The middle image of a series that is no volume. */
function middleImage(s) {
  const path = clean(s.line.image);
  return s.state === 'thumbnail' && make('div', {class: 'image'}, !path ? 'not shown' : make('img', {src: url(path),
    loading: 'lazy', alt: `${clean(s.geometry.modality)} image`}));
}
function labels(s) {
  return make('details', {class: 'labels', open: true}, make('summary', {}, labelsLine(s)),
    make('ul', {}, s.labels.map((l, i) => {
      const dot = make('i');
      dot.style.background = `hsl(${i * .618034 % 1 * 360} 90% 60%)`;
      return make('li', {}, dot, make('bdi', {}, clean(l.name)), make('span', {}, millilitres(l.ml)),
        make('span', {}, typeof l.hu_mean === 'number' ? `${Math.round(l.hu_mean)} HU`.replace('-', '−') : ''),
        make('em', {}, flags(l).join(', ')));
    })));
}

/* The folders and first files of the series, with --show-paths. */
function sources(s) {
  return make('ul', {class: 'sources mono'}, s.sources.map(f => make('li', {}, make('bdi', {},
    `${clean(f.folder)}/${clean(f.first)}`), f.files > 1 ? ` and ${count(f.files - 1)} more` : '')));
}

/* The times of its stages are in the journal. */
function times(s) {
  return s.wall_ms > 0 && make('p', {class: 'times'},
    make('span', {}, `${time(s.wall_ms)}${s.memory ? ` · peak ${megabytes(s.memory)}` : ''}`),
    s.ended && make('time', {datetime: s.ended}, s.ended.slice(0, 16).replace('T', ' ')));
}

/* A rotation's preview: one picture with all frames side by side, shifted behind a window of one frame. */
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
  if (s.findings.some(f => f.code === 'nothing_visible' && f.presets.includes(clean(p.preset))))
    frame.append(make('span', {class: 'empty-word'}, 'nothing to see with this preset'));
  const error = typeof p.error_255 === 'number' ? ` · error ${p.error_255.toPrecision(2)}/255` : '';
  link.append(frame, make('figcaption', {}, pictureName(p) + error));
  const stays_still = matchMedia('(prefers-reduced-motion: reduce)');
  link.addEventListener('mouseenter', () => stays_still.matches || play(link, p, true));
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
  const label = `${state.word}, ${s.name}, ${s.uid}`;
  const card = make('article', {class: `card ${s.state}`, tabindex: '-1', 'aria-label': label, 'data-index': s.index},
    make('header', {}, make('span', {class: 'state'}, `${state.mark} ${state.word}`),
    make('h2', {class: 'mono uid-line', title: s.uid}, uidParts(s.uid))),
    make('p', {class: 'number'}, s.name));
  return card;
}

/* Equally full rows of previews: four become two by two where three fit into a row. */
function spread(s) {
  const previews = $('.previews', s.card), n = s.pictures.length;
  if (!previews || !previews.clientWidth) return;
  const room = Math.max(1, Math.floor((previews.clientWidth + 4) / (size.value * 15 + 4)));
  previews.style.gridTemplateColumns = `repeat(${Math.ceil(n / Math.ceil(n / room))}, 1fr)`;
}

function fill(s) {
  if (s.filled) return;
  s.filled = true;
  s.card.append(...[s.details && make('p', {class: 'description'}, make('bdi', {}, s.details)),
    s.reason && make('p', {class: 'reason'}, s.file ? `${s.file}: ${s.reason}` : s.reason),
    s.sources.length && sources(s),
    s.pictures.length && make('div', {class: 'previews'}, s.pictures.map((p, place) => preview(s, p, place))),
    middleImage(s), sections(s), s.labels.length && labels(s), facts(s), s.findings.length && findings(s), times(s)].filter(Boolean));
  spread(s);
}
