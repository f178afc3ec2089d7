// Requests to the server. One that nobody waits for any more is given up, which ends its picture on the server too.

const pause = ms => new Promise(done => setTimeout(done, ms));

// {blob, scene}; an error has the server's own line. Where too many wait it asks again.
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
