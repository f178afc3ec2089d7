// The series as cards: header data, and a thumbnail that is requested when its card becomes visible.
import {ask, element, inTurn, showState, status} from './ask.js';

function facts(series) {
  const shown = [series.study_date, series.description].filter(text => text).join(', ');
  return [title(series), series.traits, ...(shown ? [shown] : [])];
}

export function title(series) {
  return `${series.modality}, ${series.orientation}, ${series.dims[2]} slice${series.dims[2] === 1 ? '' : 's'}`;
}

function card(series) {
  const lines = facts(series).map(text => element('p', {textContent: text}));
  if (!series.renderable)
    lines.push(element('p', {className: 'faint', textContent: series.reason}));
  if (!series.renderable && !series.passed) {
    const none = element('div', {className: 'thumb'}, element('div', {className: 'none'}));
    none.dataset.state = 'no picture';
    return element('div', {className: 'card'}, none, ...lines);
  }
  const picture = element('img', {alt: '', width: 240, height: 240});
  const thumb = element('div', {className: 'thumb'}, picture);
  const link = series.renderable ? element('a', {className: 'card', href: `#${series.id}`}, thumb, ...lines) :
    element('div', {className: 'card'}, thumb, ...lines);
  link.setAttribute('aria-label', facts(series).join(', '));
  thumb.dataset.state = 'waiting …';
  link.make = async () => {
    let isWaiting = true;
    showState(series.id, () => isWaiting, text => thumb.dataset.state = text);
    try {
      const {blob} = await ask(`series/${series.id}/thumbnail`);
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
    if (shown.make)
      sight.observe(shown);
  }
  return all;
}
