// One volume from all sides. In motion: previews, each requested once the last one is displayed; at rest: the full picture, with
// its error estimate.
import {ask, element, inTurn, pause, showState, status} from './ask.js';
import {listen} from './hands.js';

const SIDES = {a: ['anterior', 0, 0], p: ['posterior', 180, 0], l: ['left', 90, 0], r: ['right', 270, 0],
  h: ['head', 0, 90], f: ['feet', 0, -90]};
const PREVIEW = '8', REST_MS = 150, MOST = 1024;
// Goal for a preview from request to display: 30 a second.
const GOAL_MS = 33;
// Divisors of width and height of previews; each has half the pixels of the one before.
const COARSE = [1, 1.41, 2, 2.83, 4];
const id = name => document.getElementById(name);

// The view: azimuth and elevation in degrees; scale and centre once known from the first picture.
let look = null;
let series = null;
let presets = [];

// coarse: divisor of width and height.
function options(coarse = 1) {
  const size = look.size.split('x').map(n => Math.ceil(n / coarse)).join('x');
  const w = {preset: look.preset, view: `${+look.azimuth.toFixed(2)},${+look.elevation.toFixed(2)}`, size};
  if (look.mm) {
    w['mm-per-pixel'] = (coarse * look.mm).toPrecision(6);
    w.centre = look.centre.map(x => x.toFixed(3)).join(',');
  }
  if (look.window)
    w.window = look.window.join(',');
  if (look.occlusion !== undefined)
    w['ambient-occlusion'] = look.occlusion;
  if (look.smooth)
    w.smooth = 1;
  if (look.hidden.size)
    w.hide = [...look.hidden].join(',');
  if (look.colours)
    w['label-colours'] = '';
  return w;
}

function path(ending, more, coarse) {
  return `series/${series.id}/picture.${ending}?${new URLSearchParams({...options(coarse), ...more})}`;
}

function stageSize() {
  const stage = id('stage'), factor = Math.min(devicePixelRatio, MOST / stage.clientWidth, MOST / stage.clientHeight);
  return `${Math.round(stage.clientWidth * factor)}x${Math.round(stage.clientHeight * factor)}`;
}

// Displays the picture once it is decoded, if it is still wanted then; the one before stays until then. Returns whether it did.
// The picture covers as many pixels of the stage as it has, times coarse: sizes are rounded up, so a preview may reach a little
// beyond the stage, and a point of the volume stays where it was.
async function put(blob, coarse, isWanted) {
  const next = id('picture').cloneNode(), url = URL.createObjectURL(blob);
  next.src = url;
  await next.decode();
  if (!isWanted()) {
    URL.revokeObjectURL(url);
    return false;
  }
  const [width, height] = look.size.split('x');
  next.style.width = `${100 * coarse * next.naturalWidth / width}%`;
  next.style.height = `${100 * coarse * next.naturalHeight / height}%`;
  const before = id('picture');
  before.replaceWith(next);
  URL.revokeObjectURL(before.src);
  return true;
}

function describe(scene, isPreview, coarse = 1) {
  const mm = (scene.mm_per_pixel / coarse).toPrecision(3);
  const view = `${scene.view[0].toFixed(0)}°, ${scene.view[1].toFixed(0)}°, ${mm} mm a pixel`;
  const bound = scene.bound_255 === undefined ? '' : `, estimated error ${scene.bound_255.toPrecision(2)}/255 rms`;
  id('caption').textContent = isPreview ? `${view}, refining …` : view + bound;
  id('wait').hidden = true;
  showCommand();
  id('stage').dataset.rests = !isPreview;
  id('picture').alt = `${look.preset}, ${view}`;
  if (!isPreview)
    status(scene.warnings.join('; '));
}

// Index of the next preview's size, and the time that previews of each size take; 0: unknown. The time is the shortest of the
// last ones (it rises by a tenth with each slower one), which other work on the machine disturbs least.
let level = 0, times = COARSE.map(() => 0);

// Late previews: a smaller size, unless it is known to save less than a tenth (part of the time does not depend on the size).
// Early ones: a larger size, of twice the pixels and at most about twice the time, unless it is known to be late. What is known of
// other sizes fades by one per cent a preview, so that they are tried again after some time: other views, other costs.
function adaptSize(ms) {
  times = times.map(t => 0.99 * t);
  times[level] = times[level] ? Math.min(ms, 1.1 * times[level]) : ms;
  const pays = k => !times[k] || !times[k - 1] || times[k] < 0.9 * times[k - 1];
  if (level && (!pays(level) || (times[level] < GOAL_MS / 2 && times[level - 1] <= GOAL_MS)))
    level--;
  else if (level + 1 < COARSE.length && times[level] > GOAL_MS && pays(level + 1))
    level++;
}

// One preview at a time: only the newest view is queued, intermediate ones are dropped.
let isPreviewing = false, isQueued = false, full = null, restTimer = 0;
async function preview() {
  isQueued = true;
  clearTimeout(restTimer);
  full?.abort();
  if (isPreviewing)
    return;
  isPreviewing = true;
  try {
    while (isQueued && look) {
      isQueued = false;
      const own = look, coarse = COARSE[level], begin = performance.now();
      const {blob, scene} = await ask(path('jpg', {'max-error': PREVIEW, quality: 80}, coarse));
      if (await put(blob, coarse, () => look === own)) {
        adaptSize(performance.now() - begin);
        describe(scene, true, coarse);
      }
    }
  } catch (e) {
    fail(e);
  }
  isPreviewing = false;
  clearTimeout(restTimer);
  restTimer = setTimeout(showFull, REST_MS);
}

async function showFull() {
  if (!look)
    return;
  full = new AbortController();
  const {signal} = full;
  try {
    const own = look, {blob, scene} = await ask(path('png'), signal);
    if (!await put(blob, 1, () => look === own && !signal.aborted))
      return;
    look.mm ??= scene.mm_per_pixel;
    look.centre ??= scene.centre;
    describe(scene, false);
    showWindow(scene);
    await showLabels();
  } catch (e) {
    if (e.name !== 'AbortError')
      fail(e);
  }
}

// Without a picture the stage itself has the reason.
function fail(e) {
  status(e.message);
  id('wait').textContent = e.message;
}

function showWindow(scene) {
  for (const unit of document.querySelectorAll('.unit'))
    unit.textContent = scene.unit;
  id('window').hidden = scene.mode === 'composite';
  if (document.activeElement?.type !== 'number')
    [id('low').value, id('high').value] = scene.window_hu.map(x => +x.toPrecision(4));
}

function showCommand() {
  const quoted = value => /^[\w.,/-]*$/.test(value) ? value : `'${value.replaceAll("'", "'\\''")}'`;
  const labels = id('labels').hidden ? '' : '--labels LABELS ';
  const text = labels + Object.entries(options()).map(([name, value]) => `--${name} ${quoted(value)}`.trim()).join(' ');
  // Breaks lines between words, not after the first of two hyphens.
  const command = `ctsplat render ${series.path ? quoted(series.path) : 'PATH'} -o picture.png --png-bits 8 ${text}`.split(' ');
  id('command').replaceChildren(...command.flatMap(word => [element('span', {textContent: word}), ' ']));
  for (const a of id('downloads').children)
    a.href = path(a.dataset.ending);
}

// A name, or the number where a name would be a list.
const wordOf = label => /[,*:]/.test(label.name) || /^(all|rest|\d+)$/i.test(label.name) ? `${label.number}` : label.name;

function labelBox(label) {
  const box = element('input', {type: 'checkbox', checked: true, onchange: () => {
    look.hidden[box.checked ? 'delete' : 'add'](wordOf(label));
    preview();
  }});
  const colour = element('i');
  if (label.rgb)
    colour.style.color = `rgb(${label.rgb.map(x => Math.round(255 * x)).join(' ')})`;
  const text = `${label.name}, ${label.ml.toPrecision(3)} ml`;
  return element('li', {}, element('label', {}, box, ' ', ...(label.rgb ? [colour] : []), text));
}

async function showLabels() {
  const own = series, labels = JSON.parse(await (await ask(`series/${own.id}/labels`)).blob.text());
  if (series !== own || !labels.length || !id('labels').hidden)
    return;
  id('labels').hidden = false;
  id('label-list').replaceChildren(...labels.map(labelBox));
  showCommand();
}

const turn = (azimuth, elevation) => {
  look.azimuth = (look.azimuth + azimuth + 360) % 360;
  look.elevation = Math.max(-90, Math.min(90, look.elevation + elevation));
  preview();
};

// Right and up on the picture, by so many of its pixels.
const move = (right, up) => {
  if (!look.mm)
    return;
  const a = look.azimuth * Math.PI / 180, e = look.elevation * Math.PI / 180;
  const across = [Math.cos(a), Math.sin(a), 0];
  const upward = [-Math.sin(e) * Math.sin(a), Math.sin(e) * Math.cos(a), Math.cos(e)];
  look.centre = look.centre.map((c, i) => c - look.mm * (right * across[i] + up * upward[i]));
  preview();
};

const zoom = factor => {
  if (look.mm)
    look.mm = Math.max(0.01, Math.min(10, look.mm / factor));
  preview();
};

const all = () => {
  look.mm = look.centre = undefined;
  preview();
};

const side = key => {
  [, look.azimuth, look.elevation] = SIDES[key];
  preview();
};

// The slider shows the preset's occlusion until it is moved.
function showLight(preset) {
  look.occlusion = undefined;
  id('light').hidden = !preset?.shade || (preset.mode ?? 'composite') !== 'composite';
  id('occlusion').value = preset?.shade?.occlusion ?? 0;
}

function choose(preset) {
  look.preset = preset.name;
  look.window = undefined;
  times.fill(0);
  showLight(preset);
  for (const b of id('presets').children)
    b.setAttribute('aria-checked', b.dataset.name === preset.name);
  preview();
}

function presetButton(preset) {
  const picture = element('img', {alt: '', width: 96, height: 96});
  const thumb = element('div', {className: 'thumb'}, picture);
  thumb.dataset.state = '…';
  const button = element('button', {type: 'button', onclick: () => choose(preset)}, thumb, preset.name);
  const own = series;
  button.dataset.name = preset.name;
  button.setAttribute('role', 'radio');
  button.setAttribute('aria-checked', look.preset === preset.name);
  inTurn(async () => {
    while (isPreviewing)
      await pause(REST_MS);
    if (series !== own || !look)
      return;
    const query = new URLSearchParams({preset: preset.name, size: '96x96', 'max-error': PREVIEW, quality: 80});
    const answer = await ask(`series/${own.id}/picture.webp?${query}`).catch(() => null);
    thumb.dataset.state = answer ? '' : 'no picture';
    if (answer)
      picture.src = URL.createObjectURL(answer.blob);
  });
  return button;
}

function changeWindow() {
  const hu = [+id('low').value, +id('high').value];
  if (hu[0] !== hu[1]) {
    look.window = hu;
    preview();
  }
}

function prepare() {
  for (const [key, [name]] of Object.entries(SIDES))
    id('sides').append(element('button', {type: 'button', textContent: name, onclick: () => side(key)}));
  for (const ending of ['png', 'jpg', 'webp', 'exr', 'dcm']) {
    const link = element('a', {className: 'button', textContent: ending.toUpperCase(), download: `picture.${ending}`});
    link.dataset.ending = ending;
    id('downloads').append(link);
  }
  for (const [name, value] of [['colours', 'checked'], ['smooth', 'checked'], ['occlusion', 'value']])
    id(name).oninput = () => {
      look[name] = id(name)[value];
      preview();
    };
  id('low').onchange = id('high').onchange = changeWindow;
  listen(id('stage'), {turn, move, zoom, all, side, scale: () => Number(look.size.split('x')[0]) / id('stage').clientWidth});
  new ResizeObserver(() => {
    if (look && id('stage').clientWidth && look.size !== stageSize()) {
      const before = look.size.split('x')[0];
      look.size = stageSize();
      if (look.mm)
        look.mm *= before / look.size.split('x')[0];
      preview();
    }
  }).observe(id('stage'));
}

export async function open(chosen) {
  if (!presets.length)
    prepare();
  presets = JSON.parse(await (await ask(`series/${chosen.id}/presets`)).blob.text());
  series = chosen;
  look = {preset: presets.find(p => p.default).name, azimuth: 0, elevation: 0, size: stageSize(), hidden: new Set(), colours: false};
  level = 0;
  times.fill(0);
  showLight(presets.find(p => p.name === look.preset));
  id('labels').hidden = true;
  id('colours').checked = id('smooth').checked = false;
  // Ours and the user's own; Slicer's have the names that begin with ct-, or the scale of stored values.
  const isSlicers = p => !p.own && (p.name.startsWith('ct-') || p.scale === 'stored');
  id('presets').replaceChildren(...presets.filter(p => !isSlicers(p)).map(presetButton));
  id('picture').removeAttribute('src');
  id('caption').textContent = '';
  id('wait').hidden = false;
  id('wait').textContent = 'waiting …';
  const own = look;
  showState(series.id, () => look === own && !id('wait').hidden && !id('picture').src, text => id('wait').textContent = text);
  id('stage').focus();
  showCommand();
  preview();
}

export function close() {
  full?.abort();
  clearTimeout(restTimer);
  look = null;
}
