/* The full pictures, and clicks and keys everywhere. */
const viewer = $('#viewer'), picture = $('.picture', viewer), slider = $('#frame');
const image = $('img', picture); /* the full picture; a strip is beside it */
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
  const many = file => file.frames > 1 ? `, ${file.frames} files` : '';
  const links = Object.entries(p.files ?? {}).map(([format, file]) => make('a', {href: url(file.first),
    target: '_blank', rel: 'noopener'}, clean(format).toUpperCase() + many(file)));
  $('aside', viewer).prepend(make('p', {class: 'links'}, links));
}

function showSeries(s, place) {
  open.s = s;
  const known = STATES[s.state];
  $('#viewer-title').replaceChildren(make('span', {class: `state ${s.state}`}, `${known.mark} ${known.word}`), ' ',
    make('span', {class: 'mono uid-line', title: s.uid}, uidParts(s.uid)));
  $('nav', viewer).replaceChildren(...s.pictures.map((p, k) => {
    const button = make('button', {type: 'button'}, pictureName(p));
    button.addEventListener('click', () => showPicture(k));
    return button;
  }));
  const uid = make('p', {class: 'mono uid', 'aria-label': 'Series UID'}, s.uid);
  $('aside', viewer).replaceChildren(...[make('p', {}, s.name), s.details && make('p', {}, make('bdi', {}, s.details)),
    s.reason && make('p', {class: `reason ${s.state}`}, s.file ? `${s.file}: ${s.reason}` : s.reason), uid,
    s.sources.length && sources(s), facts(s), s.labels.length && labels(s), s.findings.length && findings(s),
    times(s)].filter(Boolean));
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
  /* Shows the next frame once the current one has been decoded. */
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

/* Reloads the sheet of a running batch periodically, unless it is in use. */
if (run?.goes_on)
  setInterval(() => {
    const busy = viewer.open || $('#keys').open || document.activeElement?.closest('form, .card') || document.hidden;
    if (!busy) location.reload();
  }, 5000);

resize();
setUp();
show();
const wanted = state.open && series.find(s => s.uid === state.open);
if (wanted) openViewer(wanted);
document.documentElement.dataset.ready = 'true';
