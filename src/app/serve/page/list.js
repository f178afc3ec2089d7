// The series as cards: what the headers say, and a small picture that is made when its card comes into sight.
import {ask} from './ask.js';

const list = document.getElementById('list');
const THUMBNAIL = 'size=240x240&max-error=8&quality=80';

function element(name, properties, ...children) {
  const e = Object.assign(document.createElement(name), properties);
  e.append(...children);
  return e;
}

export function status(text) {
  document.getElementById('status').textContent = text;
}

function facts(series) {
  const [columns, rows, slices] = series.dims;
  const size = series.spacing_mm.map(mm => mm.toFixed(2)).join(' × ');
  return [`${series.modality}, ${series.orientation}`, `${columns} × ${rows}, ${slices} slices`, `${size} mm`];
}

function card(series) {
  const lines = facts(series).map(text => element('p', {textContent: text}));
  if (!series.renderable) {
    const why = element('p', {className: 'faint', textContent: series.reason});
    return element('div', {className: 'card'}, element('div', {className: 'none'}), ...lines, why);
  }
  const picture = element('img', {alt: '', width: 240, height: 240});
  const link = element('a', {className: 'card', href: `#${series.id}`}, picture, ...lines);
  link.setAttribute('aria-label', facts(series).join(', '));
  link.thumbnail = async () => {
    const {blob} = await ask(`series/${series.id}/picture.webp?${THUMBNAIL}`);
    picture.src = URL.createObjectURL(blob);
  };
  return link;
}

// One after the other, so that who looks at one patient does not wait for all the others.
const waiting = [];
let busy = false;
async function makeThumbnails() {
  if (busy)
    return;
  busy = true;
  while (waiting.length)
    await waiting.shift()().catch(e => status(e.message));
  busy = false;
}

const sight = new IntersectionObserver(entries => {
  for (const {isIntersecting, target} of entries)
    if (isIntersecting) {
      sight.unobserve(target);
      waiting.push(target.thumbnail);
    }
  makeThumbnails();
});

export async function showList() {
  const all = await (await ask('series')).blob.text().then(JSON.parse);
  const volumes = all.filter(s => s.renderable).length;
  status(`${all.length} series, ${volumes} of them volumes`);
  all.sort((a, b) => b.renderable - a.renderable);
  for (const series of all) {
    const shown = card(series);
    list.append(shown);
    if (series.renderable)
      sight.observe(shown);
  }
}

showList().catch(e => status(e.message));
