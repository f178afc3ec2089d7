// Requests to the server, and helpers for all modules of the page.

export const pause = ms => new Promise(done => setTimeout(done, ms));

// Returns {blob, scene}; an error has the server's message. Retries while the server's queue is full. Aborting the signal
// cancels the picture on the server too.
export async function ask(path, signal) {
  for (;;) {
    const answer = await fetch(path, {signal});
    if (answer.ok)
      return {blob: await answer.blob(), scene: JSON.parse(answer.headers.get('Ctsplat-Scene'))};
    const why = (await answer.text()).trim();
    if (answer.status !== 503 || !answer.headers.get('Retry-After'))
      throw new Error(why);
    await pause(1000 * answer.headers.get('Retry-After'));
    signal?.throwIfAborted();
  }
}

let last = Promise.resolve();
// Small pictures are made one after the other.
export function inTurn(make) {
  last = last.then(make);
}

// What the server does for a series: shows it until the picture is there.
export async function showState(seriesId, isWaiting, show) {
  const words = {reading: 'reading the slices …', preparing: 'preparing the volume …', rendering: 'rendering …'};
  while (isWaiting()) {
    const all = JSON.parse(await (await ask('series')).blob.text());
    if (isWaiting())
      show(words[all.find(s => s.id === seriesId)?.state] ?? 'waiting …');
    await pause(300);
  }
}

export function element(name, properties, ...children) {
  const e = Object.assign(document.createElement(name), properties);
  e.append(...children);
  return e;
}

export function status(text) {
  document.getElementById('status').textContent = text;
}
