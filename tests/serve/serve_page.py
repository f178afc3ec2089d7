#!/usr/bin/env python3
"""The page of ctsplat serve in a headless Chromium: serve_page.py CTSPLAT LOOPBACK_SO DATA [PICTURES]

Runs with CTS_SOAK set (./dev soak). With PICTURES, screenshots are left in that folder."""
import os
import shlex
import subprocess
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', 'deploy'))
import webdriver  # noqa: E402
from server import Server  # noqa: E402

ctsplat, _, data, *pictures = sys.argv[1:]
RESTS = "document.querySelector('#stage').dataset.rests === 'true'"


def until(browser, script, seconds=60):
    end = time.monotonic() + seconds
    while not browser.run('return ' + script):
        assert time.monotonic() < end, (script, browser.run("return document.querySelector('#status').textContent"))
        time.sleep(0.05)


def rested(browser, doing):
    """The state shown once the stage rests again after doing."""
    before = browser.run("return document.querySelector('#picture').src")
    doing()
    until(browser, f"document.querySelector('#picture').src !== '{before}' && {RESTS}")
    return browser.run("return document.querySelector('#caption').textContent")


def shot(browser, name):
    if pictures:
        browser.screenshot(os.path.join(pictures[0], name + '.png'))


def pointer(browser, kind, x, y, **more):
    browser.devtools('Input.dispatchMouseEvent', {'type': kind, 'x': x, 'y': y, **more})


def drag(browser, dx, dy, shift=False):
    held = {'button': 'left', 'buttons': 1, 'modifiers': 8 if shift else 0}
    pointer(browser, 'mousePressed', 400, 400, clickCount=1, **held)
    for k in range(1, 6):
        pointer(browser, 'mouseMoved', 400 + dx * k / 5, 400 + dy * k / 5, **held)
    pointer(browser, 'mouseReleased', 400 + dx, 400 + dy, clickCount=1, **held)


# A drag of three seconds within the page, a move each frame of the screen. Returns previews a second, the most requests at once,
# frames without a decoded picture, and the largest difference of the picture's scale and place, in pixels of the stage.
DRAG = """
const stage = document.querySelector('#stage'), box = stage.getBoundingClientRect(), own = window.fetch;
const found = {previews: 0, most: 0, blank: 0, off: 0};
let open = 0;
window.fetch = async (...all) => {
  found.most = Math.max(found.most, ++open);
  try {
    return await own(...all);
  } finally {
    open--;
  }
};
const seen = new MutationObserver(() => found.previews++);
seen.observe(stage, {childList: true});
const begin = performance.now();
for (let ms = 0; ms < 3000; ms = performance.now() - begin) {
  const now = await new Promise(requestAnimationFrame), picture = document.querySelector('#picture');
  const shown = picture.getBoundingClientRect();
  found.blank += !(picture.complete && picture.naturalWidth);
  found.off = Math.max(found.off, Math.abs(shown.width - box.width), Math.abs((shown.left + shown.right - box.left - box.right) / 2));
  stage.dispatchEvent(new PointerEvent('pointermove', {pointerId: 1, clientX: 400 - ms / 5, clientY: 400}));
}
seen.disconnect();
window.fetch = own;
return {...found, previews: found.previews / 3};
"""


def smooth(browser, _):
    """While the pointer moves: one request at a time, no flash, every preview in the same place."""
    held = {'button': 'left', 'buttons': 1, 'clickCount': 1}
    pointer(browser, 'mousePressed', 400, 400, **held)
    found = browser.run(DRAG)
    rested(browser, lambda: pointer(browser, 'mouseReleased', 400, 400, **held))
    print(f'{found["previews"]:.0f} previews a second')
    assert found['previews'] >= 2 and found['most'] == 1 and found['blank'] == 0 and found['off'] <= 4, found
    size = browser.run("const p = document.querySelector('#picture'); return [p.naturalWidth, p.clientWidth]")
    assert size[0] == size[1], size


def occlusion(browser, _):
    """Lit presets have a slider, and it darkens the picture."""
    before = browser.run("return document.querySelector('#command').textContent")
    assert '--ambient-occlusion' not in before and not browser.run("return document.querySelector('#light').hidden")
    rested(browser, lambda: browser.run("const o = document.querySelector('#occlusion'); o.value = 0.8; o.oninput()"))
    assert browser.run("return document.querySelector('#command').textContent").rstrip().endswith('--ambient-occlusion 0.8')


def key(browser, name, text=None):
    for kind in 'keyDown', 'keyUp':
        browser.devtools('Input.dispatchKeyEvent', {'type': kind, 'key': name, **({'text': text} if text and kind == 'keyDown' else {})})


def tab_to(browser, selector):
    for _ in range(60):
        browser.press('Tab')
        if browser.run(f"return document.activeElement.matches('{selector}')"):
            return
    raise AssertionError(f'no way to {selector} by keys')


def by_keys(browser):
    """A hand on the keyboard alone."""
    tab_to(browser, '.card')
    rested(browser, lambda: browser.press('Enter'))
    assert browser.run("return document.activeElement.id") == 'stage'
    assert rested(browser, lambda: browser.press('Left', 'Up')).startswith('355°, 5°')
    tab_to(browser, '#sides button')
    assert rested(browser, lambda: browser.press('Enter')).startswith('0°, 0°')
    tab_to(browser, '[data-name=skin]')
    rested(browser, lambda: browser.press('Space'))
    assert browser.run("return document.querySelector('[data-name=skin]').getAttribute('aria-checked')") == 'true'
    tab_to(browser, '#label-list input')
    rested(browser, lambda: browser.press('Space'))
    assert "--preset skin" in (said := browser.run("return document.querySelector('#command').textContent")) and '--hide' in said
    tab_to(browser, '#downloads a')


def downloads(browser, server):
    """The picture, and the command that makes the same one."""
    base = browser.run("return document.querySelector('#downloads a').getAttribute('href')")
    command = browser.run("return document.querySelector('#command').textContent")
    command = shlex.split(command)
    assert command[:2] == ['ctsplat', 'render'], command
    command = [ctsplat if w == 'ctsplat' else data if w == 'PATH' else folder if w == 'LABELS' else w
               for w in command]
    subprocess.run([*command, '--force'], check=True, capture_output=True)
    with open('picture.png', 'rb') as f:
        assert f.read() == server.get('/' + base), base


def turn(browser, server):
    until(browser, "document.querySelectorAll('.card').length === 1 && document.querySelector('.card img').naturalWidth > 0")
    shot(browser, 'list')
    assert 'estimated error' in rested(browser, lambda: browser.run("document.querySelector('.card').click()"))
    assert rested(browser, lambda: drag(browser, -60, 0)).startswith('30°, 0°')
    assert rested(browser, lambda: drag(browser, 0, 40)).startswith('30°, 20°')
    scale = browser.run("return document.querySelector('#caption').textContent").split(', ')[2]
    assert rested(browser, lambda: pointer(browser, 'mouseWheel', 400, 400, deltaX=0, deltaY=-200)).split(', ')[2] < scale
    rested(browser, lambda: drag(browser, 30, 10, shift=True))
    shot(browser, 'turned')
    downloads(browser, server)
    assert rested(browser, lambda: key(browser, 'h', 'h')).startswith('0°, 90°')
    assert rested(browser, lambda: key(browser, 'ArrowRight')).startswith('5°, 90°')
    assert scale != rested(browser, lambda: key(browser, '+', '+')).split(', ')[2]
    rested(browser, lambda: key(browser, '0', '0'))


def labels(browser, server):
    """One box a label, and colours."""
    until(browser, "document.querySelectorAll('#label-list input').length === 2")
    rested(browser, lambda: browser.run("document.querySelector('#colours').click()"))
    rested(browser, lambda: browser.run("document.querySelectorAll('#label-list input')[1].click()"))
    assert "--hide 'part 2' --label-colours" in browser.run("return document.querySelector('#command').textContent")
    downloads(browser, server)
    shot(browser, 'labels')
    # Grey pictures have no colours.
    rested(browser, lambda: browser.run("document.querySelector('#colours').click()"))


def choose(browser, server):
    """A preset for grey pictures has a window."""
    assert browser.run("return document.querySelector('#window').hidden")
    rested(browser, lambda: browser.run("document.querySelector('[data-name=bone-window]').click()"))
    until(browser, "!document.querySelector('#window').hidden")
    rested(browser, lambda: browser.run("const low = document.querySelector('#low'); low.value = 0; low.onchange()"))
    assert 'window 0,' in browser.run("return document.querySelector('#command').textContent")
    downloads(browser, server)
    until(browser, "[...document.querySelectorAll('#presets img')].every(i => i.naturalWidth > 0)")
    shot(browser, 'presets')
    unnamed = browser.run("return [...document.querySelectorAll('button, a, input')].filter(e => e.offsetParent && "
                          "!(e.textContent.trim() || e.labels?.length || e.getAttribute('aria-label'))).length")
    assert unnamed == 0, unnamed


if not os.environ.get('CTS_SOAK'):
    print('skip: not asked for (CTS_SOAK=1 runs it)')
    sys.exit(77)
if webdriver.missing():
    print('skip: no', webdriver.missing())
    sys.exit(77)
folder = os.path.join(os.path.dirname(data), 'fuzz', 'labels', 'binary')
with Server(ctsplat, data, '--labels', folder) as whole:
    for wide, high, dark in (1200, 850, False), (390, 844, True):
        with webdriver.Browser(wide, high, dark=dark, network=True) as window:
            window.open(whole.url)
            if wide > 1000:
                turn(window, whole)
                smooth(window, whole)
                occlusion(window, whole)
                labels(window, whole)
                choose(window, whole)
            else:
                until(window, "document.querySelectorAll('.card').length === 1")
                by_keys(window)
                assert window.run('return document.documentElement.scrollWidth') <= wide
                shot(window, 'phone')
            said = window.messages()
            assert not said, said
