// One volume from all sides. In motion: previews; at rest: the full picture, with its error estimate.
import {ask, element, inTurn, status} from './ask.js';
import {listen} from './hands.js';

const SIDES = {a: ['anterior', 0, 0], p: ['posterior', 180, 0], l: ['left', 90, 0], r: ['right', 270, 0],
  h: ['head', 0, 90], f: ['feet', 0, -90]};
const DRAFT = '8', REST_MS = 150, MOST = 1024, SLOW_MS = 100, MOST_COARSE = 4;
const id = name => document.getElementById(name);

// The view: azimuth and elevation in degrees; scale and centre once known from the first picture.
let look = null;
let series = null;
let presets = [];

// coarse: divisor of width and height.
function words(coarse = 1) {
  const size = look.size.split('x').map(n => Math.max(1, Math.round(n / coarse))).join('x');
  const w = {preset: look.preset, view: `${+look.azimuth.toFixed(2)},${+look.elevation.toFixed(2)}`, size};
  if (look.mm) {
    w['mm-per-pixel'] = (coarse * look.mm).toPrecision(6);
    w.centre = look.centre.map(x => x.toFixed(3)).join(',');
  }
  if (look.window)
    w.window = look.window.join(',');
  if (look.occlusion !== undefined)
    w.occlusion = look.occlusion;
  if (look.hidden.size)
    w.hide = [...look.hidden].join(',');
  if (look.colours)
    w['label-colours'] = '';
  return w;
}

function path(ending, more, coarse) {
  return `series/${series.id}/picture.${ending}?${new URLSearchParams({...words(coarse), ...more})}`;
}

function stageSize() {
  const stage = id('stage'), factor = Math.min(devicePixelRatio, MOST / stage.clientWidth, MOST / stage.clientHeight);
  return `${Math.round(stage.clientWidth * factor)}x${Math.round(stage.clientHeight * factor)}`;
}

let shown = null; // the URL of the displayed picture
function put(blob) {
  if (shown)
    URL.revokeObjectURL(shown);
  id('picture').src = shown = URL.createObjectURL(blob);
}

function tell(scene, isDraft, coarse = 1) {
  const mm = (scene.mm_per_pixel / coarse).toPrecision(3);
  const view = `${scene.view[0].toFixed(0)}°, ${scene.view[1].toFixed(0)}°, ${mm} mm a pixel`;
  const bound = scene.bound_255 === undefined ? '' : `, error at most ${scene.bound_255.toPrecision(2)}/255 rms`;
  id('told').textContent = isDraft ? view : view + bound;
  id('stage').dataset.rests = !isDraft;
  id('picture').alt = `${look.preset}, ${view}`;
  if (!isDraft)
    status(scene.warnings.join('; '));
}

// One preview at a time: only the newest view is queued, intermediate ones are dropped. Slow previews get fewer pixels.
let coarse = 1;
let drafting = false, wanted = false, resting = null, restTimer = 0;
async function draft() {
  wanted = true;
  clearTimeout(restTimer);
  resting?.abort();
  if (drafting)
    return;
  drafting = true;
  try {
    while (wanted && look) {
      wanted = false;
      const own = coarse, start = performance.now();
      const {blob, scene} = await ask(path('jpg', {'max-error': DRAFT, quality: 80}, own));
      const ms = performance.now() - start;
      coarse = ms > SLOW_MS ? Math.min(MOST_COARSE, 1.4 * own) : ms < SLOW_MS / 3 ? Math.max(1, own / 1.4) : own;
      if (look) {
        put(blob);
        tell(scene, true, own);
      }
    }
  } catch (e) {
    status(e.message);
  }
  drafting = false;
  clearTimeout(restTimer);
  restTimer = setTimeout(rest, REST_MS);
}

async function rest() {
  if (!look)
    return;
  resting = new AbortController();
  const {signal} = resting;
  try {
    const {blob, scene} = await ask(path('png'), signal);
    if (signal.aborted || !look)
      return;
    put(blob);
    look.mm ??= scene.mm_per_pixel;
    look.centre ??= scene.centre;
    tell(scene, false);
    showWindow(scene);
    showCommand();
    await showLabels();
  } catch (e) {
    if (e.name !== 'AbortError')
      status(e.message);
  }
}

function showWindow(scene) {
  id('window').hidden = scene.mode === 'composite';
  if (document.activeElement?.type !== 'number')
    [id('low').value, id('high').value] = scene.window_hu.map(x => Math.round(x));
}

function showCommand() {
  const quoted = value => /^[\w.,-]*$/.test(value) ? value : `'${value.replaceAll("'", "'\\''")}'`;
  const labels = id('labels').hidden ? '' : '--labels LABELS ';
  const text = labels + Object.entries(words()).map(([name, value]) => `--${name} ${quoted(value)}`.trim()).join(' ');
  // Breaks lines between words, not after the first of two hyphens.
  const command = `ctsplat render PATH -o picture.png --png-bits 8 ${text}`.split(' ');
  id('command').replaceChildren(...command.flatMap(word => [element('span', {textContent: word}), ' ']));
  for (const a of id('downloads').children)
    a.href = path(a.dataset.ending);
}

// A name, or the number where a name would be a list.
const wordOf = label => /[,*:]/.test(label.name) || /^(all|rest|\d+)$/i.test(label.name) ? `${label.number}` : label.name;

function labelBox(label) {
  const box = element('input', {type: 'checkbox', checked: true, onchange: () => {
    look.hidden[box.checked ? 'delete' : 'add'](wordOf(label));
    draft();
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
  draft();
};

// Right and up on the picture, by so many of its pixels.
const move = (right, up) => {
  if (!look.mm)
    return;
  const a = look.azimuth * Math.PI / 180, e = look.elevation * Math.PI / 180;
  const across = [Math.cos(a), Math.sin(a), 0];
  const upward = [-Math.sin(e) * Math.sin(a), Math.sin(e) * Math.cos(a), Math.cos(e)];
  look.centre = look.centre.map((c, i) => c - look.mm * (right * across[i] + up * upward[i]));
  draft();
};

const zoom = factor => {
  if (look.mm)
    look.mm = Math.max(0.01, Math.min(10, look.mm / factor));
  draft();
};

const all = () => {
  look.mm = look.centre = undefined;
  draft();
};

const side = key => {
  [, look.azimuth, look.elevation] = SIDES[key];
  draft();
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
  showLight(preset);
  for (const b of id('presets').children)
    b.setAttribute('aria-checked', b.dataset.name === preset.name);
  draft();
}

function presetButton(preset) {
  const picture = element('img', {alt: '', width: 96, height: 96});
  const button = element('button', {type: 'button', onclick: () => choose(preset)}, picture, preset.name);
  const own = series;
  button.dataset.name = preset.name;
  button.setAttribute('role', 'radio');
  button.setAttribute('aria-checked', look.preset === preset.name);
  inTurn(async () => {
    if (series !== own || !look)
      return;
    const query = new URLSearchParams({preset: preset.name, size: '96x96', 'max-error': DRAFT, quality: 80});
    const answer = await ask(`series/${own.id}/picture.webp?${query}`).catch(() => null);
    if (answer)
      picture.src = URL.createObjectURL(answer.blob);
  });
  return button;
}

function changeWindow() {
  const hu = [+id('low').value, +id('high').value];
  if (hu[0] < hu[1]) {
    look.window = hu;
    draft();
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
  id('colours').onchange = () => {
    look.colours = id('colours').checked;
    draft();
  };
  id('occlusion').oninput = () => {
    look.occlusion = id('occlusion').value;
    draft();
  };
  id('low').onchange = id('high').onchange = changeWindow;
  listen(id('stage'), {turn, move, zoom, all, side, scale: () => Number(look.size.split('x')[0]) / id('stage').clientWidth});
  new ResizeObserver(() => {
    if (look && id('stage').clientWidth && look.size !== stageSize()) {
      const before = look.size.split('x')[0];
      look.size = stageSize();
      if (look.mm)
        look.mm *= before / look.size.split('x')[0];
      draft();
    }
  }).observe(id('stage'));
}

export async function open(chosen) {
  if (!presets.length) {
    presets = JSON.parse(await (await ask('presets')).blob.text());
    prepare();
  }
  series = chosen;
  look = {preset: 'bone', azimuth: 0, elevation: 0, size: stageSize(), hidden: new Set(), colours: false};
  showLight(presets.find(p => p.name === look.preset));
  id('labels').hidden = true;
  id('colours').checked = false;
  // Ours and the user's own; Slicer's have the names that begin with ct-.
  id('presets').replaceChildren(...presets.filter(p => !p.name.startsWith('ct-')).map(presetButton));
  id('picture').removeAttribute('src');
  id('told').textContent = 'reading …';
  id('stage').focus();
  showCommand();
  draft();
}

export function close() {
  resting?.abort();
  clearTimeout(restTimer);
  look = null;
}
