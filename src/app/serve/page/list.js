// The series as cards: header data, and a thumbnail that is requested when its card becomes visible.
import {ask, element, inTurn, showState, status} from './ask.js';

const THUMBNAIL = 'size=240x240&max-error=8&quality=80';

function facts(series) {
  const shown = [series.study_date, series.description].filter(text => text).join(', ');
  return [title(series), series.traits, ...(shown ? [shown] : [])];
}

export function title(series) {
  return `${series.modality}, ${series.orientation}, ${series.dims[2]} slice${series.dims[2] === 1 ? '' : 's'}`;
}

function card(series) {
  const lines = facts(series).map(text => element('p', {textContent: text}));
  if (!series.renderable) {
    const why = element('p', {className: 'faint', textContent: series.reason});
    const none = element('div', {className: 'thumb'}, element('div', {className: 'none'}));
    none.dataset.state = 'no picture';
    return element('div', {className: 'card'}, none, ...lines, why);
  }
  const picture = element('img', {alt: '', width: 240, height: 240});
  const thumb = element('div', {className: 'thumb'}, picture);
  const link = element('a', {className: 'card', href: `#${series.id}`}, thumb, ...lines);
  link.setAttribute('aria-label', facts(series).join(', '));
  thumb.dataset.state = 'waiting …';
  link.make = async () => {
    let isWaiting = true;
    showState(series.id, () => isWaiting, text => thumb.dataset.state = text);
    try {
      const {blob} = await ask(`series/${series.id}/picture.webp?${THUMBNAIL}`);
      picture.src = URL.createObjectURL(blob);
      thumb.dataset.state = '';
    } catch (e) {
      thumb.dataset.state = e.message;
    }
    isWaiting = false;
  };
  return link;
}

// One thumbnail after the other, so that the viewer's requests are not queued behind all of them.
const sight = new IntersectionObserver(entries => {
  for (const {isIntersecting, target} of entries)
    if (isIntersecting) {
      sight.unobserve(target);
      inTurn(() => target.make().catch(e => status(e.message)));
    }
});

export async function showList() {
  const all = JSON.parse(await (await ask('series')).blob.text());
  const volumes = all.filter(s => s.renderable).length;
  status(`${all.length} series, ${volumes} of them volumes`);
  all.sort((a, b) => b.renderable - a.renderable);
  for (const series of all) {
    const shown = card(series);
    document.getElementById('list').append(shown);
    if (series.renderable)
      sight.observe(shown);
  }
  return all;
}
