// The page: a list of series; an address with a # and a series' name behind it opens the viewer.
import {status} from './ask.js';
import {showList, title} from './list.js';
import {close, open} from './viewer.js';

let all = [];

function show() {
  const series = all.find(s => s.renderable && `#${s.id}` === location.hash);
  document.getElementById('list').hidden = !!series;
  document.getElementById('viewer').hidden = document.getElementById('back').hidden = !series;
  document.getElementById('title').textContent = document.title = series ? title(series) : 'ctsplat';
  if (series)
    open(series).catch(e => status(e.message));
  else
    close();
}

showList().then(list => {
  all = list;
  addEventListener('hashchange', show);
  show();
}).catch(e => status(e.message));
