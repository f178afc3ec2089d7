// Mouse, touch, wheel and keys, translated to changes of the view.

const DEGREES_A_PIXEL = 0.5, KEY_DEGREES = 5, KEY_PIXELS = 20, KEY_ZOOM = 1.15, WHEEL = 0.0015;

// does: turn(azimuth, elevation) in degrees, move(right, up) in the picture's pixels, zoom(factor), all(), side(letter),
// and scale(), the picture's pixels in one of the page's.
export function listen(stage, does) {
  const fingers = new Map();
  const distance = () => {
    const [a, b] = [...fingers.values()];
    return Math.hypot(a.x - b.x, a.y - b.y);
  };

  stage.addEventListener('pointerdown', e => {
    if (e.button !== 0)
      return;
    stage.setPointerCapture(e.pointerId);
    fingers.set(e.pointerId, {x: e.clientX, y: e.clientY});
  });
  stage.addEventListener('pointermove', e => {
    const before = fingers.get(e.pointerId);
    if (!before)
      return;
    const apart = fingers.size === 2 ? distance() : 0, dx = e.clientX - before.x, dy = e.clientY - before.y;
    fingers.set(e.pointerId, {x: e.clientX, y: e.clientY});
    if (apart)
      does.zoom(distance() / apart);
    else if (e.shiftKey)
      does.move(dx * does.scale(), -dy * does.scale());
    else
      does.turn(-dx * DEGREES_A_PIXEL, dy * DEGREES_A_PIXEL);
  });
  for (const end of ['pointerup', 'pointercancel'])
    stage.addEventListener(end, e => fingers.delete(e.pointerId));
  stage.addEventListener('wheel', e => {
    e.preventDefault();
    does.zoom(Math.exp(-e.deltaY * WHEEL));
  }, {passive: false});

  const arrows = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]};
  stage.addEventListener('keydown', e => {
    if (e.ctrlKey || e.metaKey || e.altKey)
      return;
    const arrow = arrows[e.key];
    if (arrow && e.shiftKey)
      does.move(arrow[0] * KEY_PIXELS, arrow[1] * KEY_PIXELS);
    else if (arrow)
      does.turn(arrow[0] * KEY_DEGREES, arrow[1] * KEY_DEGREES);
    else if (e.key === '+' || e.key === '=')
      does.zoom(KEY_ZOOM);
    else if (e.key === '-')
      does.zoom(1 / KEY_ZOOM);
    else if (e.key === '0')
      does.all();
    else if ('aplrhf'.includes(e.key))
      does.side(e.key);
    else
      return;
    e.preventDefault();
  });
}
